//! Image sources, calibration, object recognition and its evaluation.
//!
//! | module | content |
//! | --- | --- |
//! | [`calibration`] | intrinsic parameters, pose of a camera relative to an arm |
//! | `intrinsics` | [`Intrinsics`]: focal length, principal point and lens distortion of a camera |
//! | `circle_fit` | circle through points in the plane |
//! | `mat` | conversion between our images and OpenCV's, used inside this crate only |
//! | `detector/` | [`Detector`]: a table's objects with poses, by colour and depth |
//! | `depth` | [`DepthImage`] |
//! | `recognition/` | [`Recogniser`]: SIFT, circles, polygons, in this order |
//! | `evaluation` | detections against ground truth: counts, ROC curve, equal-error point |
//! | `image_source` | the latest image of a camera, a thread, a folder |
//! | [`servoing`] | the last centimetres of an approach, corrected from images |
//! | `back_projection` | pixels to points and directions in the arm's base frame |
//! | `simulated/` | evaluation on the simulated table (feature `table`) |
//! | `object_shape` | [`Shape`], [`Detection`] |
//! | `error` | [`VisionError`] |
//!
//! The image type is [`Image`] of `yarp-devices`; OpenCV's types stay inside this crate. Units are m, **radians** and
//! pixels; pixel centres have whole coordinates. Poses are in the base frame of the arm unless said otherwise.

mod back_projection;
pub mod calibration;
mod circle_fit;
mod depth;
pub mod detector;
mod error;
pub mod evaluation;
pub mod image_source;
mod intrinsics;
mod mat;
mod object_shape;
mod overlay;
pub mod recognition;
pub mod servoing;

#[cfg(feature = "table")]
pub mod simulated;

pub use back_projection::{Elevation, ObjectPose};
pub use depth::DepthImage;
pub use detector::{Detector, DetectorParameters, DetectorSetup, FoundObject, ObjectDatabase};
pub use error::VisionError;
pub use intrinsics::{CameraModel, Intrinsics};
pub use object_shape::{Detection, Polygon, Shape};
pub use overlay::write_overlay;
pub use recognition::{ModelDatabase, Recogniser, RecogniserParameters};
pub use yarp_devices::image::{Crop, Frame, Image, PixelFormat};
pub use yarp_devices::kinematics::Pose;

/// The result of a call of this crate.
pub type Result<T, E = VisionError> = std::result::Result<T, E>;
