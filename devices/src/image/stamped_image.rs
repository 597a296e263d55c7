//! An image with its number and time.

use super::{Crop, Image};
use crate::DeviceError;

/// What a camera took at one moment. Cloning shares the pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// What it saw.
    pub image: Image,
    /// Goes up by one from frame to frame, as long as the camera is not opened anew.
    pub number: u64,
    /// When it was taken, in seconds since the start of 1970.
    pub time: f64,
}

impl Frame {
    /// The part of it that `crop` tells.
    ///
    /// Errors: [`DeviceError::Unsuitable`] for what lies outside the image.
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
