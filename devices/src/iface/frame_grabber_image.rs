//! Images of a camera, in colour and as they come from the sensor.

use crate::DeviceError;
use crate::image::{Crop, Frame};

/// Images in colour (stock: `IFrameGrabberImage`, `IFrameGrabberRgb` of old).
pub trait FrameGrabberImage: Send + Sync {
    /// Width and height of the images, in pixels (`width`, `height`).
    ///
    /// Errors: [`DeviceError::NoDataYet`] of a camera at the end of a network that has sent nothing so far.
    fn image_size(&self) -> Result<(usize, usize), DeviceError>;

    /// The newest image, in red, green and blue, with its time (`getImage`, and `getLastInputStamp` of
    /// `IPreciselyTimed`). Never waits for the next; two calls within a frame return the same image.
    ///
    /// Errors: [`DeviceError::NoDataYet`].
    fn image(&self) -> Result<Frame, DeviceError>;

    /// A part of the newest image (`getImageCrop`).
    ///
    /// Errors: [`DeviceError::NoDataYet`], [`DeviceError::Unsuitable`] for places outside the image.
    fn image_crop(&self, crop: &Crop) -> Result<Frame, DeviceError> {
        self.image()?.cropped(crop)
    }
}

/// Images in one channel: grey, or from behind a Bayer filter (stock: `IFrameGrabberImageRaw`).
pub trait FrameGrabberImageRaw: Send + Sync {
    /// Returns the size of raw images; see [`FrameGrabberImage::image_size`].
    fn raw_image_size(&self) -> Result<(usize, usize), DeviceError>;

    /// Returns a raw image, with one byte per pixel; see [`FrameGrabberImage::image`].
    fn raw_image(&self) -> Result<Frame, DeviceError>;

    /// Returns a part of a raw image; see [`FrameGrabberImage::image_crop`].
    fn raw_image_crop(&self, crop: &Crop) -> Result<Frame, DeviceError> {
        self.raw_image()?.cropped(crop)
    }
}
