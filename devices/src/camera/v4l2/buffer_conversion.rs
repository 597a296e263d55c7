//! Conversion of a driver's buffers to images, with every length checked.

use std::borrow::Cow;
use std::fmt;

use crate::camera::hardware::{MAX_BUFFER_BYTES, MAX_PIXELS};
use crate::image::{Image, MAX_IMAGE_SIDE, PixelFormat, image_file};

/// Encoding of the pixels in a driver's buffer, in the order of preference: the cheapest to convert first.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub enum Encoding {
    /// Red, green, blue.
    Rgb,
    /// Blue, green, red.
    Bgr,
    /// Luminance of two pixels with the chrominance that they share (4:2:2).
    Yuyv,
    /// JPEG images.
    Mjpg,
}

impl Encoding {
    /// All of them, in the order of preference.
    pub const ALL: [Self; 4] = [Self::Rgb, Self::Bgr, Self::Yuyv, Self::Mjpg];

    /// Returns the code of four characters that V4L2 gives it.
    pub const fn fourcc(self) -> &'static str {
        match self {
            Self::Rgb => "RGB3",
            Self::Bgr => "BGR3",
            Self::Yuyv => "YUYV",
            Self::Mjpg => "MJPG",
        }
    }

    /// Returns the encoding of a code of four characters.
    pub fn from_fourcc(fourcc: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.fourcc() == fourcc)
    }

    /// Returns the least number of bytes of a line, or `None` for JPEG images, which have no lines.
    fn line_bytes(self, width: usize) -> Option<usize> {
        match self {
            Self::Rgb | Self::Bgr => Some(width * 3),
            Self::Yuyv => Some(width.div_ceil(2) * 4),
            Self::Mjpg => None,
        }
    }
}

impl fmt::Display for Encoding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.fourcc())
    }
}

/// Reasons why a buffer is no image.
#[derive(Debug, thiserror::Error, PartialEq)]
pub(super) enum FrameError {
    /// The sides are outside the limits.
    #[error(
        "the driver says {width} x {height} pixels, expected sides of 1 to {MAX_IMAGE_SIDE}, together at most {MAX_PIXELS} pixels"
    )]
    Size { width: usize, height: usize },
    /// A line has no room for its pixels.
    #[error("the driver says {got} bytes per line, expected {expected} at least")]
    Line { got: usize, expected: usize },
    /// Buffers are larger than any image.
    #[error("the driver wants {got} bytes for an image, expected at most {MAX_BUFFER_BYTES}")]
    Buffer { got: usize },
    /// The buffer ends before the image.
    #[error("the driver delivered {got} bytes, expected {expected}")]
    Short { got: usize, expected: usize },
    /// The driver marked the buffer.
    #[error("the driver marked the image as damaged")]
    Damaged,
    /// The bytes are no JPEG image.
    #[error("{0}")]
    Jpeg(String),
    /// A JPEG image has another size than the negotiated one.
    #[error("a JPEG image of {got:?} pixels, expected {expected:?}")]
    OtherSize {
        got: (usize, usize),
        expected: (usize, usize),
    },
}

/// Layout of the images in a driver's buffers.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct FrameLayout {
    encoding: Encoding,
    width: usize,
    height: usize,
    bytes_per_line: usize,
}

impl FrameLayout {
    /// Returns whether an image of this size is small enough.
    pub(super) fn has_valid_size(size: (usize, usize)) -> bool {
        Self::new(Encoding::Mjpg, size, 0, 0).is_ok()
    }

    /// Creates a layout from a driver's claims, if an image and a buffer of it have a bounded size, and lines have room for
    /// the pixels.
    pub(super) fn new(
        encoding: Encoding,
        (width, height): (usize, usize),
        bytes_per_line: usize,
        buffer_bytes: usize,
    ) -> Result<Self, FrameError> {
        let sides = 1..=MAX_IMAGE_SIDE;
        if !(sides.contains(&width) && sides.contains(&height) && width * height <= MAX_PIXELS) {
            return Err(FrameError::Size { width, height });
        }
        let expected = encoding.line_bytes(width).unwrap_or(0);
        if bytes_per_line < expected {
            let got = bytes_per_line;
            return Err(FrameError::Line { got, expected });
        }
        if buffer_bytes > MAX_BUFFER_BYTES {
            return Err(FrameError::Buffer { got: buffer_bytes });
        }
        Ok(Self {
            encoding,
            width,
            height,
            bytes_per_line,
        })
    }

    /// Returns width and height.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Returns the encoding.
    pub(super) fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Converts the bytes of a buffer to an image in red, green and blue.
    pub(super) fn image(&self, bytes: &[u8]) -> Result<Image, FrameError> {
        let Some(line_bytes) = self.encoding.line_bytes(self.width) else {
            return self.jpeg(bytes);
        };
        // The last line may end with its pixels.
        let expected = self.bytes_per_line.saturating_mul(self.height - 1);
        let expected = expected.saturating_add(line_bytes);
        if bytes.len() < expected {
            let got = bytes.len();
            return Err(FrameError::Short { got, expected });
        }
        let mut pixels = Vec::with_capacity(self.width * self.height * 3);
        for line in bytes.chunks(self.bytes_per_line).take(self.height) {
            let line = &line[..line_bytes];
            match self.encoding {
                Encoding::Rgb => pixels.extend_from_slice(line),
                Encoding::Bgr => {
                    let swapped = line
                        .chunks_exact(3)
                        .flat_map(|bgr| [bgr[2], bgr[1], bgr[0]]);
                    pixels.extend(swapped);
                }
                Encoding::Yuyv | Encoding::Mjpg => yuyv_line(line, self.width, &mut pixels),
            }
        }
        Image::new(PixelFormat::Rgb, self.width, self.height, pixels)
            .map_err(|error| FrameError::Jpeg(error.to_string()))
    }

    fn jpeg(&self, bytes: &[u8]) -> Result<Image, FrameError> {
        let refused = |error: &dyn fmt::Display| FrameError::Jpeg(format!("no JPEG: {error}"));
        if !bytes.starts_with(&[0xff, 0xd8]) {
            return Err(refused(&"no marker SOI at the beginning"));
        }
        let image = image_file::decode(&with_table_mark(bytes)).map_err(|error| refused(&error))?;
        let got = (image.width(), image.height());
        if got != self.size() {
            let expected = self.size();
            return Err(FrameError::OtherSize { got, expected });
        }
        image.to_rgb().map_err(|error| refused(&error))
    }
}

/// Appends a line of `width` pixels.
fn yuyv_line(line: &[u8], width: usize, pixels: &mut Vec<u8>) {
    let end = pixels.len() + width * 3;
    for pair in line.chunks_exact(4) {
        pixels.extend(rgb_of(pair[0], pair[1], pair[3]));
        pixels.extend(rgb_of(pair[2], pair[1], pair[3]));
    }
    // An odd width leaves half of the last pair.
    pixels.truncate(end);
}

/// Converts luminance and chrominance to red, green and blue: ITU-R BT.601 in the limited range, luminance 16 to 235,
/// in units of 1/256, which is what V4L2 means unless a driver says otherwise.
fn rgb_of(y: u8, cb: u8, cr: u8) -> [u8; 3] {
    let y = 298 * (i32::from(y) - 16) + 128;
    let (cb, cr) = (i32::from(cb) - 128, i32::from(cr) - 128);
    let rgb = [y + 409 * cr, y - 100 * cb - 208 * cr, y + 516 * cb];
    rgb.map(|value| (value >> 8).clamp(0, 255) as u8)
}

/// Returns a JPEG image of a camera with a mark that it uses the tables of the standard, if it brings none.
///
/// Cameras leave the Huffman tables out, as in AVI files; the mark of such files (`AVI1`) makes the decoder use those of
/// ITU-T T.81, K.3.3.
fn with_table_mark(bytes: &[u8]) -> Cow<'_, [u8]> {
    const MARK: [u8; 9] = *b"\xff\xe0\x00\x07AVI1\0";
    if has_tables(bytes) {
        return Cow::Borrowed(bytes);
    }
    let mut marked = Vec::with_capacity(bytes.len() + MARK.len());
    marked.extend_from_slice(&bytes[..2]);
    marked.extend_from_slice(&MARK);
    marked.extend_from_slice(&bytes[2..]);
    Cow::Owned(marked)
}

/// Returns true if Huffman tables (DHT) stand before the scan (SOS) of a JPEG image.
fn has_tables(bytes: &[u8]) -> bool {
    let mut rest = bytes.get(2..).unwrap_or_default();
    while let [0xff, marker, high, low, ..] = *rest {
        match marker {
            0xc4 => return true,
            0xda => return false,
            _ => {}
        }
        let length = usize::from(u16::from_be_bytes([high, low]));
        rest = rest.get(2 + length..).unwrap_or_default();
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(
        encoding: Encoding,
        size: (usize, usize),
        line: usize,
    ) -> Result<FrameLayout, FrameError> {
        FrameLayout::new(encoding, size, line, 0)
    }

    /// Colour bars of 100 % in the limited range of BT.601, as ITU-R BT.801 and SMPTE EG 1 print them.
    const BARS: [([u8; 3], [u8; 3]); 8] = [
        ([235, 128, 128], [255, 255, 255]),
        ([210, 16, 146], [255, 255, 0]),
        ([170, 166, 16], [0, 255, 255]),
        ([145, 54, 34], [0, 255, 0]),
        ([106, 202, 222], [255, 0, 255]),
        ([81, 90, 240], [255, 0, 0]),
        ([41, 240, 110], [0, 0, 255]),
        ([16, 128, 128], [0, 0, 0]),
    ];

    #[test]
    fn yuyv_has_the_published_colours() {
        for ([y, cb, cr], expected) in BARS {
            let layout = layout(Encoding::Yuyv, (2, 1), 4).unwrap();
            let image = layout.image(&[y, cb, y, cr]).unwrap();
            for (got, expected) in image.pixels().iter().zip([expected, expected].concat()) {
                let off = i32::from(*got) - i32::from(expected);
                assert!(off.abs() <= 2, "{y} {cb} {cr}: {:?}", image.pixels());
            }
        }
        // Two luminances share a chrominance.
        let layout = layout(Encoding::Yuyv, (2, 1), 4).unwrap();
        let image = layout.image(&[16, 128, 235, 128]).unwrap();
        assert_eq!(image.pixels()[..], [0, 0, 0, 255, 255, 255]);
    }

    #[test]
    fn lines_may_be_padded_and_widths_odd() {
        let three = layout(Encoding::Yuyv, (3, 2), 12).unwrap();
        let mut bytes = vec![99; 24];
        bytes[..8].copy_from_slice(&[16, 128, 235, 128, 235, 128, 16, 128]);
        bytes[12..20].copy_from_slice(&[235, 128, 235, 128, 16, 128, 99, 128]);
        let image = three.image(&bytes).unwrap();
        let grey: Vec<u8> = image.pixels().iter().step_by(3).copied().collect();
        assert_eq!(grey, [0, 255, 255, 255, 255, 0]);
        // The padding of the last line may be left out.
        assert_eq!(three.image(&bytes[..20]).unwrap(), image);
        let bgr = layout(Encoding::Bgr, (1, 2), 4).unwrap();
        let image = bgr.image(&[1, 2, 3, 0, 4, 5, 6]).unwrap();
        assert_eq!(image.pixels()[..], [3, 2, 1, 6, 5, 4]);
        let rgb = layout(Encoding::Rgb, (1, 2), 4).unwrap();
        let image = rgb.image(&[1, 2, 3, 0, 4, 5, 6]).unwrap();
        assert_eq!(image.pixels()[..], [1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn short_buffers_are_refused() {
        for (encoding, expected) in [
            (Encoding::Rgb, 27),
            (Encoding::Bgr, 27),
            (Encoding::Yuyv, 24),
        ] {
            let layout = layout(encoding, (3, 3), expected / 3).unwrap();
            assert!(layout.image(&vec![0; expected]).is_ok());
            for got in 0..expected {
                let refused = layout.image(&vec![0; got]).unwrap_err();
                assert_eq!(refused, FrameError::Short { got, expected });
            }
        }
    }

    #[test]
    fn claims_of_a_driver_are_bounded() {
        let long = usize::MAX;
        for size in [
            (0, 1),
            (1, 0),
            (MAX_IMAGE_SIDE + 1, 1),
            (1, MAX_IMAGE_SIDE + 1),
        ] {
            for encoding in Encoding::ALL {
                let (width, height) = size;
                let refused = layout(encoding, size, long).unwrap_err();
                assert_eq!(refused, FrameError::Size { width, height });
            }
        }
        assert!(layout(Encoding::Mjpg, (8192, 4096), 0).is_ok());
        assert!(layout(Encoding::Mjpg, (8192, 4097), 0).is_err());
        let expected = 1280;
        let refused = layout(Encoding::Yuyv, (640, 480), 1279).unwrap_err();
        assert_eq!(
            refused,
            FrameError::Line {
                got: 1279,
                expected
            }
        );
        assert!(layout(Encoding::Rgb, (640, 480), 640 * 3 - 1).is_err());
        let with_buffer = |bytes| FrameLayout::new(Encoding::Mjpg, (2, 2), 0, bytes);
        assert!(with_buffer(1 << 27).is_ok());
        let got = (1 << 27) + 1;
        assert_eq!(with_buffer(got).unwrap_err(), FrameError::Buffer { got });
        assert!(FrameLayout::has_valid_size((8192, 4096)));
        assert!(!FrameLayout::has_valid_size((8192, 4097)));
        // Lines as long as memory are no reason to allocate it, nor to wrap around.
        for line in [long, 1 << (usize::BITS - 1)] {
            let endless = layout(Encoding::Rgb, (2, 3), line).unwrap();
            let refused = endless.image(&[0; 64]);
            assert!(matches!(refused, Err(FrameError::Short { .. })), "{line}");
        }
    }

    fn jpeg(side: u16) -> Vec<u8> {
        let mut bytes = Vec::new();
        let colours = [250, 30, 60].repeat(usize::from(side) * usize::from(side));
        jpeg_encoder::Encoder::new(&mut bytes, 95)
            .encode(&colours, side, side, jpeg_encoder::ColorType::Rgb)
            .unwrap();
        bytes
    }

    /// Returns a JPEG image without its Huffman tables, as cameras send it.
    fn without_tables(bytes: &[u8]) -> Vec<u8> {
        let mut kept = bytes[..2].to_vec();
        let mut at = 2;
        while bytes[at + 1] != 0xda {
            let end = at + 2 + usize::from(u16::from_be_bytes([bytes[at + 2], bytes[at + 3]]));
            if bytes[at + 1] != 0xc4 {
                kept.extend_from_slice(&bytes[at..end]);
            }
            at = end;
        }
        kept.extend_from_slice(&bytes[at..]);
        kept
    }

    #[test]
    fn jpeg_images_are_decoded_with_and_without_tables() {
        let layout = layout(Encoding::Mjpg, (16, 16), 0).unwrap();
        let whole = jpeg(16);
        let image = layout.image(&whole).unwrap();
        let colour = image.pixel(8, 8).unwrap();
        for (got, expected) in colour.iter().zip([250, 30, 60]) {
            assert!((i32::from(*got) - expected).abs() <= 4, "{colour:?}");
        }
        let bare = without_tables(&whole);
        assert!(bare.len() + 400 < whole.len(), "tables were there");
        assert_eq!(layout.image(&bare).unwrap(), image);
    }

    #[test]
    fn broken_jpeg_images_are_refused() {
        let layout = layout(Encoding::Mjpg, (16, 16), 0).unwrap();
        assert_eq!(
            layout.image(&jpeg(24)).unwrap_err(),
            FrameError::OtherSize {
                got: (24, 24),
                expected: (16, 16)
            }
        );
        let whole = jpeg(16);
        for end in 0..whole.len() / 2 {
            assert!(layout.image(&whole[..end]).is_err(), "{end} bytes");
        }
        for bytes in [&b""[..], b"P6 16 16 255 ", &[0xff, 0xd8, 0xff, 0xc4]] {
            assert!(matches!(layout.image(bytes), Err(FrameError::Jpeg(_))));
        }
    }

    #[test]
    fn encodings_have_the_codes_of_v4l2() {
        for one in Encoding::ALL {
            assert_eq!(Encoding::from_fourcc(one.fourcc()), Some(one));
        }
        assert_eq!(Encoding::from_fourcc("NV12"), None);
    }
}
