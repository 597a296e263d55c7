//! Images with left and right swapped.

use crate::DeviceError;
use crate::image::{Image, PixelFormat};

/// Swaps left and right of an image in red, green and blue.
pub(in crate::camera) fn mirrored(image: &Image) -> Result<Image, DeviceError> {
    let mut pixels = Vec::with_capacity(image.pixels().len());
    for line in image.pixels().chunks_exact((image.width() * 3).max(1)) {
        pixels.extend(line.rchunks_exact(3).flatten());
    }
    Image::new(PixelFormat::Rgb, image.width(), image.height(), pixels)
}
