//! Images of one kind of pixel out of another.

use super::pixel::PixelCode;
use super::typed_image::{Image, ImageError};

impl Image {
    /// Converts the image to pixels of `code`; both codes must be one of `mono`, `rgb`, `bgr`,
    /// `rgba`, `bgra`.
    ///
    /// As in stock: grey is the mean of red, green and blue, rounded down; opacity is kept, or 255
    /// if there was none. Rows keep their order, quantum and mark.
    ///
    /// Source: images converted by 3.5.0.
    pub fn converted(&self, code: PixelCode) -> Result<Self, ImageError> {
        if code == self.code() {
            return Ok(self.clone());
        }
        let none = || ImageError::NoConversion {
            from: self.code(),
            to: code,
        };
        let from = Channels::of(self.code()).ok_or_else(none)?;
        let to = Channels::of(code).ok_or_else(none)?;
        let mut packed = vec![0; self.width() * self.height() * to.bytes];
        let sources = self.rows().flat_map(|row| row.chunks_exact(from.bytes));
        for (pixel, source) in packed.chunks_exact_mut(to.bytes).zip(sources) {
            if to.bytes == 1 {
                let sum = [from.red, from.green, from.blue].map(|at| u16::from(source[at]));
                pixel[0] = (sum.iter().sum::<u16>() / 3) as u8;
                continue;
            }
            pixel[to.red] = source[from.red];
            pixel[to.green] = source[from.green];
            pixel[to.blue] = source[from.blue];
            if let Some(at) = to.opacity {
                pixel[at] = from.opacity.map_or(255, |at| source[at]);
            }
        }
        let image = Self::from_padded(code, self.width(), self.height(), 1, packed)?;
        Ok(image
            .with_quantum(self.quantum())?
            .with_mark(self.is_marked()))
    }
}

/// The positions of the channels of a pixel of u8.
struct Channels {
    bytes: usize,
    red: usize,
    green: usize,
    blue: usize,
    opacity: Option<usize>,
}

impl Channels {
    fn of(code: PixelCode) -> Option<Self> {
        let (bytes, red, green, blue, opacity) = match code {
            PixelCode::MONO => (1, 0, 0, 0, None),
            PixelCode::RGB => (3, 0, 1, 2, None),
            PixelCode::BGR => (3, 2, 1, 0, None),
            PixelCode::RGBA => (4, 0, 1, 2, Some(3)),
            PixelCode::BGRA => (4, 2, 1, 0, Some(3)),
            _ => return None,
        };
        Some(Self {
            bytes,
            red,
            green,
            blue,
            opacity,
        })
    }
}
