//! Optical parameters of a camera.

use crate::DeviceError;
use crate::image::PixelFormat;

/// A size and rate at which a camera can run (stock: `CameraConfig`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraConfiguration {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Images a second.
    pub rate: f64,
    /// Pixel format.
    pub format: PixelFormat,
}

/// Projection from lines of sight to pixels (stock: the properties of `IntrinsicParams`).
#[derive(Clone, Debug, PartialEq)]
pub struct Intrinsics {
    /// Focal length of the lens, metres; 0 if it is not known.
    pub physical_focal_length: f64,
    /// Focal lengths in pixels, across and down.
    pub focal_length: (f64, f64),
    /// Intersection of the lens axis with the image, in pixels from the left and the top.
    pub principal_point: (f64, f64),
    /// Model of the lens distortion, for instance `plumb_bob`; `none` if there is none.
    pub distortion_model: String,
    /// Radial distortion: k1, k2, k3.
    pub radial: [f64; 3],
    /// Tangential distortion: t1, t2.
    pub tangential: [f64; 2],
    /// The rotation that aligns the rows of two cameras.
    pub rectification: [f64; 9],
}

impl Default for Intrinsics {
    /// An ideal lens of no known focal length.
    fn default() -> Self {
        Self {
            physical_focal_length: 0.0,
            focal_length: (1.0, 1.0),
            principal_point: (0.0, 0.0),
            distortion_model: "none".to_owned(),
            radial: [0.0; 3],
            tangential: [0.0; 2],
            rectification: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        }
    }
}

/// Optical parameters of a camera (stock: `IRgbVisualParams`).
pub trait RgbVisualParams: Send + Sync {
    /// Sizes and rates it can run at (`getRgbSupportedConfigurations`).
    fn supported_configurations(&self) -> Result<Vec<CameraConfiguration>, DeviceError>;

    /// Width and height, in pixels (`getRgbResolution`, `getRgbWidth`, `getRgbHeight`).
    fn resolution(&self) -> Result<(usize, usize), DeviceError>;

    /// Sets width and height, in pixels, from the next image on (`setRgbResolution`).
    ///
    /// Errors: [`DeviceError::Unsuitable`], [`DeviceError::NotSupported`] where the images have a size of their own.
    fn set_resolution(&self, width: usize, height: usize) -> Result<(), DeviceError>;

    /// Angles of view across and down, degrees (`getRgbFOV`).
    fn field_of_view(&self) -> Result<(f64, f64), DeviceError>;

    /// Sets the angles of view, degrees (`setRgbFOV`).
    ///
    /// Errors: [`DeviceError::Unsuitable`].
    fn set_field_of_view(&self, across: f64, down: f64) -> Result<(), DeviceError>;

    /// Returns the projection from lines of sight to pixels (`getRgbIntrinsicParam`).
    fn intrinsics(&self) -> Result<Intrinsics, DeviceError>;

    /// Returns whether left and right are swapped (`getRgbMirroring`).
    fn mirroring(&self) -> Result<bool, DeviceError>;

    /// Swaps left and right, from the next image on (`setRgbMirroring`).
    fn set_mirroring(&self, mirrored: bool) -> Result<(), DeviceError>;
}
