//! An image with its number and time.

use super::{Crop, Image};
use crate::DeviceError;

/// An image of a camera, with its number and time. Cloning shares the pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The image.
    pub image: Image,
    /// Goes up by one from frame to frame, as long as the camera is not opened anew.
    pub number: u64,
    /// Time of the image, in seconds since the start of 1970.
    pub time: f64,
}

impl Frame {
    /// Returns the part of it that `crop` selects.
    ///
    /// Errors: [`DeviceError::Unsuitable`] for parts outside the image.
    pub fn cropped(&self, crop: &Crop) -> Result<Self, DeviceError> {
        let image = crop.of(&self.image)?;
        Ok(Self { image, ..*self })
    }

    /// The same in grey.
    pub fn to_mono(&self) -> Result<Self, DeviceError> {
        let image = self.image.to_mono()?;
        Ok(Self { image, ..*self })
    }
}
