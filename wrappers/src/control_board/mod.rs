//! Control boards: the server `controlBoard_nws_yarp` and the client `remote_controlboard` of stock.
//!
//! ```text
//!   client                                       server, named /wam
//!   /local/rpc:o      ── questions, orders ──▶   /wam/rpc:i        answered one by one
//!   /local/command:o  ── velocities ─────────▶   /wam/command:i    never answered
//!   /local/stateExt:i ◀── whole state ────────   /wam/stateExt:o   every period
//!                         joint positions ────   /wam/state:o      every period, for whoever connects
//! ```
//!
//! | folder | what it is about |
//! | --- | --- |
//! | [`messages`] | the words and bytes, shared by both sides |
//! | `server` | [`ControlBoardServer`]: a device on ports |
//! | `client` | [`RemoteControlBoard`]: the device at the other end |

mod client;
mod error;
pub mod messages;
mod opening;
mod server;

pub use client::{RemoteControlBoard, RemoteControlBoardOptions};
pub use error::OpenError;
pub use server::{ControlBoardOptions, ControlBoardServer};
