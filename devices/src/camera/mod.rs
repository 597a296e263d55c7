//! A camera that shows a test pattern, a picture or a film.
//!
//! ```text
//! ImageSource ──▶ FeatureSettings ──▶ LatestValue ──▶ whoever asks
//! pattern,   knobs         a thread of the camera writes at its rate and never waits;
//! file       change it     readers take the newest, whole
//! ```
//!
//! | file | what it is about |
//! | --- | --- |
//! | `simulated_camera` | [`SimulatedCamera`]: the thread and the device interfaces |
//! | `simulated_firewire` | the same as a camera on IEEE 1394 |
//! | `camera_options` | [`CameraOptions`], [`Scene`] |
//! | `image_source`, `pattern`, [`mjpeg`] | where pictures come from |
//! | `feature_settings` | what the knobs do |
//! | `latest_value` | [`LatestValue`]: how readers get frames without holding up the camera |

mod camera_options;
mod feature_settings;
mod image_source;
mod latest_value;
pub mod mjpeg_splitter;
mod simulated_camera;
mod simulated_firewire;
mod test_pattern;

pub use camera_options::{CameraOptions, Scene};
pub use latest_value::LatestValue;
pub use simulated_camera::SimulatedCamera;
pub use test_pattern::Pattern;
