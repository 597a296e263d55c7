//! Live view of a robot in a browser, recordings and replay.
//!
//! [`View`] is a port with a web page. It reads the state of arm, hand, camera and table from their ports, and streams it to every
//! browser that shows the page. `docs/live-view.md` describes the page, and the messages that other programs may send to it.
//!
//! | file | content |
//! | --- | --- |
//! | `live_view` | the ports of a view and their life |
//! | `sources` | connections to the ports that are shown, made while somebody watches |
//! | `view_model`, `view_message` | the latest data, and the messages that bring it |
//! | `viewer_stream` | the messages to browsers |
//! | `control`, `guiding`, `board_client` | commands of the page, with `--control` |
//! | `robot_urdf`, `mesh` | URDF and meshes, generated from the kinematic models |
//! | `page_files` | the page itself |
//! | `mcap`, `recorder`, `recording_replay` | recordings in files, and back into the network |

mod board_client;
mod camera_image;
mod guiding;
mod live_view;
mod log_lines;
mod mcap;
mod mesh;
mod network_status;
mod page_commands;
mod page_files;
mod port_sources;
mod recorder;
mod recording_replay;
mod robot_urdf;
mod view_message;
mod view_model;
mod viewer_stream;

pub use live_view::{View, ViewOptions};
pub use log_lines::{LogLevel, LogLines};
pub use mcap::McapError;
pub use recorder::{RecordCounts, RecordError, Recorder};
pub use recording_replay::{Replay, ReplayError};

/// True if this build contains the three-dimensional part of the page.
pub const HAS_SCENE: bool = cfg!(scene_bundled);
