//! Image sources, calibration, object recognition and its evaluation.
//!
//! | module | content |
//! | --- | --- |
//! | [`calibration`] | intrinsic parameters, pose of a camera relative to an arm |
//! | `intrinsics` | [`Intrinsics`]: focal length, principal point and lens distortion of a camera |
//! | `mat` | conversion between our images and OpenCV's, used inside this crate only |
//! | `error` | [`VisionError`] |
//!
//! The image type is [`Image`] of `yarp-devices`; OpenCV's types stay inside this crate. Units are m, **radians** and
//! pixels; pixel centres have whole coordinates. Poses are in the base frame of the arm unless said otherwise.

pub mod calibration;
mod error;
mod intrinsics;
mod mat;

pub use error::VisionError;
pub use intrinsics::{CameraModel, Intrinsics};
pub use yarp_devices::image::{Crop, Frame, Image, PixelFormat};
pub use yarp_devices::kinematics::Pose;

/// The result of a call of this crate.
pub type Result<T, E = VisionError> = std::result::Result<T, E>;
