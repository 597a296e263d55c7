//! Images as devices have them: pixels row after row from the top, without padding.
//!
//! | file | content |
//! | --- | --- |
//! | `mod` | [`Image`] and [`PixelFormat`] |
//! | `stamped_image` | [`Frame`]: an image with its number and time |
//! | `image_crop` | [`Crop`]: a part of an image |
//! | `image_file`, `compressed_image` | image files: PPM and PGM; PNG and JPEG |
//! | `file_checks` | the checks of both |
//!
//! Pixels are shared, never copied by cloning. This module makes no messages: network wrappers turn them into
//! messages, and share the pixels where the message has the same layout.

#[cfg(feature = "image-files")]
mod compressed_image;
mod file_checks;
mod image_crop;
pub mod image_file;
mod stamped_image;

use bytes::Bytes;

pub use image_crop::Crop;
pub use stamped_image::Frame;

use crate::DeviceError;

/// Maximum length of a side of an image that devices make or read, in pixels.
pub const MAX_IMAGE_SIDE: usize = 16_384;

/// Format of a pixel.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum PixelFormat {
    /// Grey.
    Mono,
    /// Red, green, blue.
    Rgb,
    /// Blue, green, red.
    Bgr,
    /// Anything else, by the code that stock gives it. There are no [`Image`]s of it.
    Other(i32),
}

impl PixelFormat {
    /// Bytes of a pixel, where they are known.
    pub const fn bytes(self) -> Option<usize> {
        match self {
            Self::Mono => Some(1),
            Self::Rgb | Self::Bgr => Some(3),
            Self::Other(_) => None,
        }
    }
}

/// An image.
///
/// ```
/// use yarp_devices::image::{Image, PixelFormat};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let image = Image::new(PixelFormat::Rgb, 2, 1, vec![255, 0, 0, 0, 0, 255])?;
/// assert_eq!(image.pixel(1, 0), Some(&[0, 0, 255][..]));
/// assert_eq!(image.to_mono()?.pixels()[..], [85, 85]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Image {
    format: PixelFormat,
    width: usize,
    height: usize,
    pixels: Bytes,
}

impl Image {
    /// An image of pixels that are there, which it shares.
    ///
    /// Errors: [`DeviceError::Unsuitable`] if the number of bytes does not match width, height and format.
    pub fn new(
        format: PixelFormat,
        width: usize,
        height: usize,
        pixels: impl Into<Bytes>,
    ) -> Result<Self, DeviceError> {
        let pixels = pixels.into();
        let expected = format
            .bytes()
            .and_then(|bytes| width.checked_mul(height)?.checked_mul(bytes));
        if expected != Some(pixels.len()) {
            return Err(DeviceError::Unsuitable {
                what: "an image of so many bytes of pixels:",
                asked: pixels.len().to_string(),
                expected: match expected {
                    Some(expected) => format!("{expected} for {width} x {height} {format:?}"),
                    None => format!("a format of known size, not {format:?}"),
                },
            });
        }
        Ok(Self {
            format,
            width,
            height,
            pixels,
        })
    }

    /// Returns the pixel format.
    pub fn format(&self) -> PixelFormat {
        self.format
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row after row from the top.
    pub fn pixels(&self) -> &Bytes {
        &self.pixels
    }

    /// The bytes of the pixel in column `x` of row `y`.
    pub fn pixel(&self, x: usize, y: usize) -> Option<&[u8]> {
        let bytes = self.format.bytes()?;
        let start = (y * self.width + x) * bytes;
        (x < self.width && y < self.height).then(|| &self.pixels[start..start + bytes])
    }

    /// Converts the image to grey, as stock does: the mean of red, green and blue, rounded down. Shares the pixels if
    /// it is grey already.
    pub fn to_mono(&self) -> Result<Self, DeviceError> {
        if self.format == PixelFormat::Mono {
            return Ok(self.clone());
        }
        let grey =
            |pixel: &[u8]| (pixel.iter().map(|byte| u16::from(*byte)).sum::<u16>() / 3) as u8;
        let pixels: Vec<u8> = self.pixels.chunks_exact(3).map(grey).collect();
        Self::new(PixelFormat::Mono, self.width, self.height, pixels)
    }

    /// The image in red, green and blue. Shares the pixels if it is in this format already.
    pub fn to_rgb(&self) -> Result<Self, DeviceError> {
        let pixels: Vec<u8> = match self.format {
            PixelFormat::Rgb => return Ok(self.clone()),
            PixelFormat::Mono => self.pixels.iter().flat_map(|grey| [*grey; 3]).collect(),
            _ => self
                .pixels
                .chunks_exact(3)
                .flat_map(|pixel| [pixel[2], pixel[1], pixel[0]])
                .collect(),
        };
        Self::new(PixelFormat::Rgb, self.width, self.height, pixels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_as_many_bytes_as_pixels_need() {
        let made = |format, width, height, bytes| {
            Image::new(format, width, height, vec![0; bytes]).is_ok()
        };
        assert!(made(PixelFormat::Mono, 3, 2, 6));
        assert!(made(PixelFormat::Rgb, 3, 2, 18));
        assert!(!made(PixelFormat::Rgb, 3, 2, 17));
        assert!(!made(PixelFormat::Mono, usize::MAX, 2, 6));
        assert!(!made(PixelFormat::Other(7), 1, 1, 1));
    }

    #[test]
    fn formats_turn_into_each_other() {
        let bgr = Image::new(PixelFormat::Bgr, 2, 1, vec![1, 2, 3, 10, 20, 40]).unwrap();
        assert_eq!(bgr.to_rgb().unwrap().pixels()[..], [3, 2, 1, 40, 20, 10]);
        let mono = bgr.to_mono().unwrap();
        assert_eq!(mono.pixels()[..], [2, 23]);
        assert_eq!(mono.to_rgb().unwrap().pixels()[..], [2, 2, 2, 23, 23, 23]);
        assert_eq!(
            mono.to_mono().unwrap().pixels().as_ptr(),
            mono.pixels().as_ptr()
        );
    }
}
