//! Control boards: the server `controlBoard_nws_yarp` of stock, and its clients `remote_controlboard` (3.x) and
//! `controlBoard_nwc_yarp` (4.0).
//!
//! ```text
//!   client                                       server, named /wam
//!   /local/rpc:o      ── questions, orders ──▶   /wam/rpc:i        answered one by one (3.x)
//!   /local/nwc/rpc:o  ── questions, orders ──▶   /wam/nws/rpc:i    the same (4.0)
//!   /local/command:o  ── velocities … ───────▶   /wam/command:i    never answered
//!   /local/stateExt:i ◀── whole state ────────   /wam/stateExt:o   every period
//!                         joint positions ────   /wam/state:o      every period, for whoever connects
//!   /local/async:i    ◀── ends of moves ──────   /wam/async:o      once each; ours alone, stock has no such port
//! ```
//!
//! | folder | content |
//! | --- | --- |
//! | [`messages`] | the words and bytes, shared by both sides |
//! | `server` | [`ControlBoardServer`]: a device on ports |
//! | `client` | [`RemoteControlBoard`]: the remote device |

mod client;
pub mod messages;
mod open_error;
mod server;

pub use client::{RemoteControlBoard, RemoteControlBoardOptions, RemoteMotion};
pub use open_error::OpenError;
pub use server::{ControlBoardOptions, ControlBoardServer};
