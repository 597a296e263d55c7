//! Images.

use bytes::{BufMut, Bytes, BytesMut};

use super::element::Element;
use super::image_header::{DEFAULT_QUANTUM, HEADER, Header};
use super::pixel::PixelCode;
use super::prefix_reader::{Front, ReadPrefix, read_whole};
use crate::bottle::DecodeError;
use crate::message::{Payload, Pieces, ReadObject, WireObject};
use crate::wire_version::WireVersion;

/// An image of any kind of pixel, stock's `yarp::sig::Image`, `ImageOf<T>` and `FlexImage`.
///
/// ```text
///  0  256  4            list of four
///  8  9    "mat"        vocab
/// 16  9    pixel code   vocab, see PixelCode
/// 24  257  5            list of five int32
/// 32  bytes per pixel
/// 36  size in bytes
/// 40  quantum           3.x: int16 quantum, int16 mark; 4.0: int32 quantum
/// 44  width in pixels
/// 48  height in pixels
/// 52  12   size         blob
/// 60  rows
/// ```
///
/// The same bytes are the bottle `[mat] [rgb] (3 size quantum width height) {pixels}`. A row is
/// padded to a multiple of the quantum, 8 by default; the content of the padding is ignored. Size
/// is the padded row times the height.
///
/// **The mark.** Versions differ in the number next to the quantum, and an image does not state the
/// version of its sender:
///
/// | version | writes | on reading |
/// | --- | --- | --- |
/// | up to 3.4.5 | no mark: quantum is an int32 | as 4.0 |
/// | 3.4.6 | always 0 | takes 1 for bottom row first |
/// | 3.5 to 3.9 | 0 top row first, 1 bottom row first | as written |
/// | 3.10 to 3.12 | always 1, rows from the top | passes over it |
/// | 4.0 | no mark: quantum is an int32 | takes 1 for a quantum of 65536 more, and loses the message |
///
/// Rows are therefore given in the order received, and [`Image::is_marked`] keeps the mark; callers
/// that know the sender to be 3.5 to 3.9 apply [`Image::flipped`] to a marked image. Images are
/// written with 0 by default, which every version reads as rows from the top.
///
/// Pixels share the message they were read from. A header whose numbers contradict each other
/// (size, rows, pixel) is refused before anything is allocated; stock aborts or reads past it.
///
/// Source: images written and read by 3.5.0; recorded images of 3.12.3 and 4.0.0; for the mark in
/// other versions their `sig/ImageNetworkHeader.h`.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Image {
    header: Header,
    pixels: Bytes,
}

/// The reason why an image is impossible.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The number of bytes of a pixel is unknown.
    #[error("pixels of code {code} have no known size")]
    UnknownPixel {
        /// The code.
        code: PixelCode,
    },
    /// The padding multiple of rows is invalid or exceeds the range of the header.
    #[error("rows padded to a multiple of {quantum} bytes, expected 1 to 32767")]
    Quantum {
        /// The multiple asked for.
        quantum: usize,
    },
    /// More bytes than a header can tell.
    #[error("an image of {width} x {height} pixels takes more than 2 GiB")]
    TooLarge {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// Pixels that do not fill the image.
    #[error("the pixels take {expected} bytes, got {got}")]
    WrongLength {
        /// Bytes that width, height and pixel code ask for.
        expected: usize,
        /// Bytes given.
        got: usize,
    },
    /// Pixels that cannot be made out of these.
    #[error("cannot convert pixels of code {from} to {to}")]
    NoConversion {
        /// The code there is.
        from: PixelCode,
        /// The code asked for.
        to: PixelCode,
    },
}

impl Image {
    /// Returns an image of `width` x `height` pixels, all bytes 0.
    pub fn new(code: PixelCode, width: usize, height: usize) -> Result<Self, ImageError> {
        let header = Header::new(code, width, height, DEFAULT_QUANTUM)?;
        let pixels = vec![0; header.size().expect("checked")].into();
        Ok(Self { header, pixels })
    }

    /// Returns an image of pixels without padding, row after row from the top.
    ///
    /// Shares `packed` if rows need no padding, and copies it into padded rows otherwise.
    ///
    /// ```
    /// use yarp_wire::typed::{Image, PixelCode};
    /// let image = Image::from_packed(PixelCode::RGB, 1, 2, vec![1, 2, 3, 4, 5, 6])?;
    /// assert_eq!(image.stride(), 8);
    /// assert_eq!(image.pixel(0, 1), Some(&[4, 5, 6][..]));
    /// # Ok::<(), yarp_wire::typed::ImageError>(())
    /// ```
    pub fn from_packed(
        code: PixelCode,
        width: usize,
        height: usize,
        packed: impl Into<Bytes>,
    ) -> Result<Self, ImageError> {
        Self::from_padded(code, width, height, 1, packed)?.with_quantum(DEFAULT_QUANTUM)
    }

    /// Returns an image of rows padded to multiples of `quantum` bytes. Shares `pixels`.
    pub fn from_padded(
        code: PixelCode,
        width: usize,
        height: usize,
        quantum: usize,
        pixels: impl Into<Bytes>,
    ) -> Result<Self, ImageError> {
        let header = Header::new(code, width, height, quantum)?;
        let pixels = pixels.into();
        let expected = header.size().expect("checked");
        if pixels.len() != expected {
            let got = pixels.len();
            return Err(ImageError::WrongLength { expected, got });
        }
        Ok(Self { header, pixels })
    }

    /// Returns the same pixels in rows padded to multiples of `quantum` bytes.
    pub fn with_quantum(self, quantum: usize) -> Result<Self, ImageError> {
        let header = self.header.with_quantum(quantum)?;
        if header.stride() == self.header.stride() {
            let pixels = self.pixels;
            return Ok(Self { header, pixels });
        }
        let stride = header.stride().expect("checked");
        let mut pixels = BytesMut::with_capacity(header.size().expect("checked"));
        for (y, row) in self.rows().enumerate() {
            pixels.put_slice(row);
            pixels.resize((y + 1) * stride, 0);
        }
        let pixels = pixels.freeze();
        Ok(Self { header, pixels })
    }

    /// The same image with or without the mark for 3.x readers; see the type.
    pub fn with_mark(mut self, marked: bool) -> Self {
        self.header.marked = marked;
        self
    }

    /// The image upside down, without a mark. Copies the rows.
    pub fn flipped(&self) -> Self {
        let mut pixels = BytesMut::with_capacity(self.pixels.len());
        if self.stride() > 0 {
            for row in self.pixels.chunks_exact(self.stride()).rev() {
                pixels.put_slice(row);
            }
        }
        let header = Header {
            marked: false,
            ..self.header
        };
        let pixels = pixels.freeze();
        Self { header, pixels }
    }

    /// Returns the kind of the pixels.
    pub fn code(&self) -> PixelCode {
        self.header.code
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.header.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.header.height
    }

    /// Bytes of a pixel, as the header states them.
    pub fn bytes_per_pixel(&self) -> usize {
        self.header.depth
    }

    /// Returns the padding multiple of rows, in bytes. A header of 0 means 8, as in stock.
    pub fn quantum(&self) -> usize {
        self.header.padding()
    }

    /// Returns whether the header has the mark of 3.x, which need not mean anything; see the type.
    pub fn is_marked(&self) -> bool {
        self.header.marked
    }

    /// Bytes from one row to the next.
    pub fn stride(&self) -> usize {
        self.header
            .stride()
            .expect("checked when the image was made")
    }

    /// All rows with their padding.
    pub fn pixels(&self) -> &Bytes {
        &self.pixels
    }

    /// All rows without their padding; shared if there is none.
    pub fn packed(&self) -> Bytes {
        if self.row_bytes() == self.stride() {
            return self.pixels.clone();
        }
        let mut packed = BytesMut::with_capacity(self.row_bytes() * self.height());
        for row in self.rows() {
            packed.put_slice(row);
        }
        packed.freeze()
    }

    /// Row `y` as it came, without padding.
    pub fn row(&self, y: usize) -> Option<&[u8]> {
        let start = self.stride() * y;
        (y < self.height()).then(|| &self.pixels[start..start + self.row_bytes()])
    }

    /// All rows as they came, without padding.
    pub fn rows(&self) -> impl DoubleEndedIterator<Item = &[u8]> {
        // A loop over a height without pixels could be long.
        let rows = if self.pixels.is_empty() {
            0
        } else {
            self.height()
        };
        (0..rows).map(|y| self.row(y).expect("a row of the image"))
    }

    /// Returns the bytes of the pixel in column `x` of row `y`.
    pub fn pixel(&self, x: usize, y: usize) -> Option<&[u8]> {
        let bytes = self.header.code.stored_bytes(self.header.depth);
        let row = self.row(y).filter(|_| x < self.width())?;
        Some(&row[x * bytes..(x + 1) * bytes])
    }

    /// Returns the numbers of row `y`, channel by channel: `row_of::<f32>` of a `dec` image gives
    /// its depths.
    ///
    /// `None` if there is no such row or its pixels consist of other numbers.
    pub fn row_of<'a, T>(&'a self, y: usize) -> Option<impl ExactSizeIterator<Item = T> + 'a>
    where
        T: Element + 'a,
    {
        let pixel = self.header.code.stored_bytes(self.header.depth);
        let row = self.row(y).filter(|_| pixel.is_multiple_of(T::WIDTH))?;
        Some(row.chunks_exact(T::WIDTH).map(T::from_bytes))
    }

    fn row_bytes(&self) -> usize {
        self.header.row().expect("checked when the image was made")
    }
}

impl WireObject for Image {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        out.reserve(HEADER + self.pixels.len());
        out.put_slice(&self.header.to_bytes(wire_version));
        out.put_slice(&self.pixels);
    }

    fn write_pieces(&self, out: &mut Pieces, wire_version: WireVersion) {
        out.written().put_slice(&self.header.to_bytes(wire_version));
        out.share(&self.pixels);
    }
}

/// The expected content at the start of an image.
const WHOLE: &str = "an image whose header agrees with itself";

impl ReadPrefix for Image {
    fn take(bytes: &mut Bytes, _wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut front = Front::new(bytes, WHOLE);
        let (header, size) = Header::take(&mut front)?;
        let pixels = front.run(size, 1)?;
        Ok(Self { header, pixels })
    }
}

impl ReadObject for Image {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        read_whole(bytes, wire_version)
    }

    fn read(payload: &Payload) -> Result<Self, DecodeError> {
        // A writer of the same process hands over header and pixels as it had them.
        if let [head, pixels] = payload.pieces() {
            let mut head = head.clone();
            let mut front = Front::new(&mut head, WHOLE);
            let (header, size) = Header::take(&mut front)?;
            if head.is_empty() && size == pixels.len() {
                let pixels = pixels.clone();
                return Ok(Self { header, pixels });
            }
        }
        let wire_version = payload.wire_version();
        Self::read_binary(&payload.to_binary(wire_version)?, wire_version)
    }
}
