//! Receivers of images.

use crate::DeviceError;
use crate::image::Image;

/// A device that images are written to (stock: `IFrameWriterImage`).
pub trait FrameWriterImage: Send + Sync {
    /// Writes an image, in red, green and blue or convertible to it (`putImage`).
    ///
    /// * Errors: [`DeviceError::Unsuitable`] when the device takes no more or not this one, [`DeviceError::File`], and others of the device.
    fn put_image(&self, image: &Image) -> Result<(), DeviceError>;
}
