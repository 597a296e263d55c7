//! A camera that shows a test pattern, a picture or a film.
//!
//! ```text
//! Source ──▶ Settings ──▶ Newest ──▶ whoever asks
//! pattern,   knobs         a thread of the camera writes at its rate and never waits;
//! file       change it     readers take the newest, whole
//! ```
//!
//! | file | what it is about |
//! | --- | --- |
//! | `simulated` | [`SimulatedCamera`]: the thread and the device interfaces |
//! | `firewire` | the same as a camera on IEEE 1394 |
//! | `options` | [`CameraOptions`], [`Scene`] |
//! | `source`, `pattern`, [`mjpeg`] | where pictures come from |
//! | `settings` | what the knobs do |
//! | `newest` | [`Newest`]: how readers get frames without holding up the camera |

mod firewire;
pub mod mjpeg;
mod newest;
mod options;
mod pattern;
mod settings;
mod simulated;
mod source;

pub use newest::Newest;
pub use options::{CameraOptions, Scene};
pub use pattern::Pattern;
pub use simulated::SimulatedCamera;
