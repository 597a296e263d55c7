//! The sixty bytes in front of the pixels.

use super::pixel::PixelCode;
use super::prefix_reader::Front;
use super::typed_image::ImageError;
use crate::bottle::DecodeError;
use crate::vocab::Vocab32;
use crate::wire_version::WireVersion;

/// Bytes of the header.
pub const HEADER: usize = 60;

/// Stock's meaning of a quantum of 0.
pub(super) const DEFAULT_QUANTUM: usize = 8;

/// The largest quantum that 16 bits of a header hold.
const MAX_QUANTUM: usize = i16::MAX as usize;

/// The largest image that a header can tell of, in bytes.
const MAX_SIZE: usize = i32::MAX as usize;

/// The content of a header.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(super) struct Header {
    pub(super) code: PixelCode,
    /// Bytes of a pixel.
    pub(super) depth: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) quantum: usize,
    /// The mark that 3.5 to 3.9 gave to images with their bottom row first.
    pub(super) marked: bool,
}

impl Header {
    /// Returns a header for pixels of a known code.
    pub(super) fn new(
        code: PixelCode,
        width: usize,
        height: usize,
        quantum: usize,
    ) -> Result<Self, ImageError> {
        let depth = code
            .bytes_per_pixel()
            .filter(|depth| *depth > 0)
            .ok_or(ImageError::UnknownPixel { code })?;
        let header = Self {
            code,
            depth,
            width,
            height,
            quantum,
            marked: false,
        };
        header.with_quantum(quantum)
    }

    /// The same with rows padded to another multiple.
    pub(super) fn with_quantum(mut self, quantum: usize) -> Result<Self, ImageError> {
        if !(1..=MAX_QUANTUM).contains(&quantum) {
            return Err(ImageError::Quantum { quantum });
        }
        self.quantum = quantum;
        let (width, height) = (self.width, self.height);
        match self.size() {
            Some(_) => Ok(self),
            None => Err(ImageError::TooLarge { width, height }),
        }
    }

    /// Bytes of a row without padding.
    pub(super) fn row(&self) -> Option<usize> {
        self.width.checked_mul(self.code.stored_bytes(self.depth))
    }

    /// Bytes from one row to the next: the row, rounded up to a multiple of the quantum.
    pub(super) fn stride(&self) -> Option<usize> {
        self.row()?.checked_next_multiple_of(self.padding())
    }

    /// Returns the padding multiple of rows, in bytes.
    pub(super) fn padding(&self) -> usize {
        match self.quantum {
            0 => DEFAULT_QUANTUM,
            quantum => quantum,
        }
    }

    /// Returns the bytes of all rows; `None` if they or a side of the image exceed the range of the
    /// header.
    pub(super) fn size(&self) -> Option<usize> {
        let fits = |number: &usize| *number <= MAX_SIZE;
        if !fits(&self.width) || !fits(&self.height) {
            return None;
        }
        self.stride()?.checked_mul(self.height).filter(fits)
    }

    /// Takes a header and checks that its numbers agree: the header and the bytes of the pixels.
    pub(super) fn take(front: &mut Front<'_>) -> Result<(Self, usize), DecodeError> {
        front.words(&[256, 4, 9, MAT, 9])?;
        let code = PixelCode::from_code(front.i32()?);
        front.words(&[257, 5])?;
        let depth = front.count()?;
        let size = front.count()?;
        let quantum = front.i32()?;
        let width = front.count()?;
        let height = front.count()?;
        front.words(&[12])?;
        let blob = front.count()?;
        let header = Self {
            code,
            depth,
            width,
            height,
            quantum: (quantum & 0xffff) as usize,
            marked: quantum >> 16 == 1,
        };
        let quantum_is_sane = header.quantum <= MAX_QUANTUM && matches!(quantum >> 16, 0 | 1);
        let known = code.bytes_per_pixel();
        let depth_is_right = match width == 0 || height == 0 {
            true => known.is_none_or(|known| known == depth || depth == 0),
            false => {
                depth > 0 && code != PixelCode::INVALID && known.is_none_or(|known| known == depth)
            }
        };
        if !quantum_is_sane || !depth_is_right || size != blob || header.size() != Some(size) {
            return Err(front.shape());
        }
        Ok((header, size))
    }

    /// Returns the bytes of the header.
    pub(super) fn to_bytes(self, wire_version: WireVersion) -> [u8; HEADER] {
        let size = self.size().expect("checked when the image was made") as i32;
        let mark = match wire_version {
            WireVersion::V3 => i32::from(self.marked) << 16,
            WireVersion::V4 => 0,
        };
        let words = [
            256,
            4,
            9,
            MAT,
            9,
            self.code.code(),
            257,
            5,
            self.depth as i32,
            size,
            self.quantum as i32 | mark,
            self.width as i32,
            self.height as i32,
            12,
            size,
        ];
        let mut bytes = [0; HEADER];
        for (place, word) in bytes.chunks_exact_mut(4).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }
}

const MAT: i32 = Vocab32::new("mat").code() as i32;
