//! A camera that shows a test pattern, an image or a film, and cameras of the machine; a device that writes images to files.
//!
//! ```text
//! ImageSource ──▶ FeatureSettings ──▶ LatestValue ──▶ whoever asks
//! pattern,   knobs         a thread of the camera writes at its rate and never waits;
//! file       change it     readers take the newest, whole
//! ```
//!
//! | file | content |
//! | --- | --- |
//! | `simulated_camera` | [`SimulatedCamera`]: the thread and the device interfaces |
//! | `simulated_firewire` | the same as a camera on IEEE 1394 |
//! | `camera_options` | [`CameraOptions`], [`Scene`] |
//! | `camera_images`, `test_pattern`, [`mjpeg_splitter`] | sources of images |
//! | `feature_settings` | effects of the features |
//! | `shared_latest` | [`LatestValue`]: hands frames to readers without blocking the camera |
//! | `camera_with_microphone` | [`CameraWithMicrophone`]: images with sound |
//! | `image_folder_writer` | [`ImageFolderWriter`]: takes images and sound, and writes them to files |
//! | `iidc` | `IidcCamera`: a camera on IEEE 1394 or USB, through libdc1394 (feature `dc1394`, Linux) |
//! | `hardware` | parts that `iidc` and `v4l2` share |
//! | `v4l2` | `V4l2Camera`: a camera of the machine (feature `v4l2`, Linux) |

mod camera_images;
mod camera_options;
mod camera_with_microphone;
mod feature_settings;
#[cfg(all(any(feature = "dc1394", feature = "v4l2"), target_os = "linux"))]
mod hardware;
#[cfg(all(feature = "dc1394", target_os = "linux"))]
mod iidc;
mod image_folder_writer;
pub mod mjpeg_splitter;
mod shared_latest;
mod simulated_camera;
mod simulated_firewire;
mod test_pattern;
#[cfg(all(feature = "v4l2", target_os = "linux"))]
mod v4l2;

pub use camera_options::{CameraOptions, Scene};
pub use camera_with_microphone::CameraWithMicrophone;
#[cfg(all(feature = "dc1394", target_os = "linux"))]
pub use iidc::{IidcCamera, IidcChoice, IidcFormat, IidcOptions};
pub use image_folder_writer::{ImageFolderOptions, ImageFolderWriter};
pub use shared_latest::LatestValue;
pub use simulated_camera::SimulatedCamera;
pub use test_pattern::Pattern;
#[cfg(all(feature = "v4l2", target_os = "linux"))]
pub use v4l2::{Encoding, V4l2Camera, V4l2Options};
