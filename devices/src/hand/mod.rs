//! The BarrettHand BH8-262: three fingers, a spread, and a language of its own on a serial line.
//!
//! | file | content |
//! | --- | --- |
//! | `gcl/` | the language: commands, replies, blocks; no serial line, no clock |
//! | `serial_line`, `serial_driver`, `realtime_session` | the serial line; commands over it; RealTime over it |
//! | `gcl_connection`, `named_grasps` | the interfaces [`Hand`](crate::Hand) and [`Grasp`](crate::Grasp), in terms of commands |
//! | `board/` | the hand as a control board of four axes, in RealTime mode |
//! | `node/` | a hand behind a server, over TCP: both sides |
//! | `hand_units`, `finger_coupling`, `finger_kinematics` | counts and degrees; coupling of a motor to two links; positions of fingertips |
//! | `simulated/` | a simulated hand, at the other end of a pseudo-terminal |
//!
//! Without the feature `barrett` this module has the language, the errors and [`GclConnection`] alone.
//!
//! Source: Barrett's manuals of the BH8 series; tables 3, 4 and 17 to 23, section 5.5.1 and annex B.3.1 of the thesis.

#[cfg(feature = "barrett")]
mod board;
#[cfg(feature = "barrett")]
pub mod finger_coupling;
#[cfg(feature = "barrett")]
pub mod finger_kinematics;
pub mod gcl;
mod gcl_connection;
mod hand_error;
pub mod hand_units;
pub mod named_grasps;
#[cfg(feature = "barrett")]
pub mod node;
#[cfg(feature = "barrett")]
mod realtime_session;
#[cfg(feature = "barrett")]
mod serial_driver;
#[cfg(feature = "barrett")]
mod serial_line;
#[cfg(all(unix, feature = "barrett"))]
pub mod simulated;

#[cfg(feature = "barrett")]
pub use board::HandBoard;
#[cfg(feature = "barrett")]
pub use finger_coupling::Links;
#[cfg(feature = "barrett")]
pub use finger_kinematics::{FingerJoints, FingerSolution};
pub use gcl_connection::{GclConnection, check_move, read};
pub use hand_error::{HandError, HandErrorKind};
#[cfg(feature = "barrett")]
pub use realtime_session::RealTimeSession;
#[cfg(feature = "barrett")]
pub use serial_driver::{BarrettHand, HandOptions};
