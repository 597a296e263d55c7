//! The hand's own language, GCL, as text and as bytes: what is said to the hand and what it answers.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `motors` | the four motors, and the prefix of a command |
//! | `parameter` | what can be set and read, with ranges |
//! | `command` | a command as a value, written and read |
//! | `status` | the bits of an error |
//! | `reply` | where an answer ends, and what it says |
//! | `realtime` | the blocks of RealTime mode |
//!
//! No line, thread or clock here; the driver and the simulated hand share it. Any split of the bytes gives the same
//! answer.
//!
//! Source: Barrett, *BH8-Series User's Manual*, firmware 4.3x and 4.4.x, chapters 5 to 7; tables 20 to 23 of the
//! thesis. What they leave open is marked where it is decided.

mod command;
mod motors;
mod parameter;
mod realtime;
mod reply;
mod status;

pub use command::{Command, Kept, Listing, Verb};
pub use motors::{Finger, Motor, Motors};
pub use parameter::{Parameter, Scope};
pub use realtime::{
    BlockError, Control, Feedback, Header, Layout, MotorControl, MotorFeedback, MotorLayout,
};
pub use reply::{ABORT, BANNER, MAX_REPLY, PROMPT, Reply, ReplyError, ReplyReader};
pub use status::{Status, StatusBits};
