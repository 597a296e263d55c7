//! Depth images: distance along the optical axis of a second sensor.

use crate::{Image, PixelFormat, Result, VisionError};

/// A depth image.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    width: usize,
    height: usize,
    metres: Vec<f32>,
}

impl DepthImage {
    /// Creates an image from depths along the optical axis, m, row after row; 0 where nothing was measured.
    ///
    /// Errors: [`VisionError::Unsuitable`] unless there are `width` times `height` values.
    pub fn new(width: usize, height: usize, metres: Vec<f32>) -> Result<Self> {
        if width.checked_mul(height) == Some(metres.len()) {
            return Ok(Self {
                width,
                height,
                metres,
            });
        }
        Err(VisionError::Unsuitable {
            what: "depth image".to_owned(),
            expected: format!("{width} x {height} values"),
            actual: format!("{} values", metres.len()),
        })
    }

    /// Reads a grey image in which value v of 1 to 255 is `from + step * v` m and 0 is no measurement, as frame grabbers
    /// of depth sensors serve it.
    ///
    /// Errors: [`VisionError::Unsuitable`] if the image is not grey.
    pub fn from_grey(image: &Image, from: f64, step: f64) -> Result<Self> {
        if image.format() != PixelFormat::Mono {
            return Err(VisionError::Unsuitable {
                what: "depth image".to_owned(),
                expected: "one grey value per pixel; read the raw images of the depth sensor"
                    .to_owned(),
                actual: format!("{:?}", image.format()),
            });
        }
        let metres = |value: &u8| match value {
            0 => 0.0,
            value => (from + step * f64::from(*value)) as f32,
        };
        Self::new(
            image.width(),
            image.height(),
            image.pixels().iter().map(metres).collect(),
        )
    }

    /// Returns the number of pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the depths, m, row after row; 0 where nothing was measured.
    pub fn metres(&self) -> &[f32] {
        &self.metres
    }
}
