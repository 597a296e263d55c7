//! IIDC cameras, on IEEE 1394 and USB, through libdc1394.
//!
//! ```text
//! callers ──tasks──▶ iidc_thread ──▶ iidc_session ──▶ opened_camera ──▶ libdc1394
//!                    owns the        settings,        one call each
//!                    camera          features
//! ```
//!
//! | file | content |
//! | --- | --- |
//! | `iidc_camera`, `iidc_firewire` | [`IidcCamera`]: the device interfaces |
//! | `iidc_options` | [`IidcOptions`], [`IidcChoice`], [`IidcFormat`] |
//! | `iidc_thread` | takes images, executes the tasks of callers, and opens an unplugged camera again |
//! | `iidc_session` | the camera with its settings, which are made again after it was unplugged |
//! | `iidc_state` | state that the thread shares with the callers |
//! | `session_features` | features as registers of the camera |
//! | `video_modes` | sizes, codings and rates of the specification; choice among them |
//! | `frame_conversion` | frames to images |
//! | `opened_camera` | the calls of the library, each with its error |
//! | `library`, `bindings` | loading of the library; its structures, numbers and functions |
//!
//! `make test-iidc` runs it with a simulated camera on USB.

mod bindings;
mod frame_conversion;
mod iidc_camera;
mod iidc_firewire;
mod iidc_options;
mod iidc_session;
mod iidc_state;
mod iidc_thread;
mod library;
mod opened_camera;
mod session_features;
mod video_modes;

pub use iidc_camera::IidcCamera;
pub use iidc_options::{IidcChoice, IidcFormat, IidcOptions};
