//! Depth images: distance along the optical axis of a second sensor.

use std::path::Path;

use opencv::core::{CV_16UC1, MatTraitConst, MatTraitConstManual};
use opencv::imgcodecs;

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

    /// Reads an image file of 16 bits per pixel, in mm; 0 is no measurement.
    ///
    /// Errors: [`VisionError::File`], [`VisionError::Unsuitable`], [`VisionError::OpenCv`].
    pub fn read(path: &Path) -> Result<Self> {
        std::fs::metadata(path).map_err(VisionError::file("read a depth image", path))?;
        let failed = || VisionError::cv("read a depth image");
        let mat = imgcodecs::imread(path, imgcodecs::IMREAD_UNCHANGED).map_err(failed())?;
        if mat.typ() != CV_16UC1 || mat.empty() {
            return Err(VisionError::Unsuitable {
                what: format!("depth image {}", path.display()),
                expected: "a PNG with one channel of 16 bits, mm".to_owned(),
                actual: format!("{} channels, depth type {}", mat.channels(), mat.depth()),
            });
        }
        let values = mat.data_typed::<u16>().map_err(failed())?;
        let metres = values.iter().map(|value| f32::from(*value) / 1e3).collect();
        Self::new(mat.cols() as usize, mat.rows() as usize, metres)
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
