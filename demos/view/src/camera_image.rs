//! Images of the camera for browsers: smaller, and as JPEG.

use libjpeg_turbo_rs::{PixelFormat, Subsampling};
use yarp_wire::typed::{Image, PixelCode};

/// Maximum width of a shown image, pixels.
const MAX_WIDTH: usize = 720;
/// Quality of 100.
const QUALITY: u8 = 78;

/// A JPEG image, and the size of the image of the camera.
#[derive(Debug)]
pub(crate) struct ShownImage {
    pub(crate) jpeg: Vec<u8>,
    pub(crate) width: usize,
    pub(crate) height: usize,
}

/// Returns an image for browsers; `None` for pixels that cannot be shown.
pub(crate) fn encode(image: &Image) -> Option<ShownImage> {
    let (format, channels, converted) = match image.code() {
        PixelCode::MONO => (PixelFormat::Grayscale, 1, None),
        PixelCode::RGB => (PixelFormat::Rgb, 3, None),
        PixelCode::BGR => (PixelFormat::Bgr, 3, None),
        _ => (
            PixelFormat::Rgb,
            3,
            Some(image.converted(PixelCode::RGB).ok()?),
        ),
    };
    let (width, height) = (image.width(), image.height());
    if width == 0 || height == 0 {
        return None;
    }
    let pixels = converted.as_ref().unwrap_or(image).packed();
    let factor = width.div_ceil(MAX_WIDTH);
    let (across, down) = (width / factor, (height / factor).max(1));
    let small = match factor {
        1 => pixels.to_vec(),
        _ => shrink(&pixels, [width, height], factor, channels),
    };
    let jpeg = libjpeg_turbo_rs::compress(&small, across, down, format, QUALITY, Subsampling::S420);
    Some(ShownImage {
        jpeg: jpeg.ok()?,
        width,
        height,
    })
}

/// Averages squares of `factor` pixels; rows and columns that fill no square are left out.
fn shrink(pixels: &[u8], [width, height]: [usize; 2], factor: usize, channels: usize) -> Vec<u8> {
    let (across, down) = (width / factor, (height / factor).max(1));
    let rows = factor.min(height);
    let count = (factor * rows) as u32;
    let mut small = Vec::with_capacity(across * down * channels);
    for y in 0..down {
        for x in 0..across {
            for channel in 0..channels {
                let mut sum = count / 2;
                for row in 0..rows {
                    let start = ((y * factor + row) * width + x * factor) * channels + channel;
                    sum += (0..factor)
                        .map(|column| u32::from(pixels[start + column * channels]))
                        .sum::<u32>();
                }
                small.push((sum / count) as u8);
            }
        }
    }
    small
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_images_are_averaged() {
        // Two by two squares of one grey value each, with a column and a row too many.
        let value = |x: usize, y: usize| [[10, 20], [30, 40]][(y / 2).min(1)][(x / 2).min(1)];
        let pixels: Vec<u8> = (0..25).map(|index| value(index % 5, index / 5)).collect();
        assert_eq!(shrink(&pixels, [5, 5], 2, 1), [10, 20, 30, 40]);
    }

    #[test]
    fn images_of_any_size_are_encoded() {
        for (width, height) in [(1, 1), (3, 2), (1288, 964), (2000, 1), (1, 2000), (721, 3)] {
            let pixels = vec![90_u8; width * height * 3];
            let image = Image::from_packed(PixelCode::RGB, width, height, pixels).unwrap();
            let shown = encode(&image).unwrap();
            assert_eq!((shown.width, shown.height), (width, height));
            assert!(shown.jpeg.starts_with(&[0xff, 0xd8]));
        }
    }
}
