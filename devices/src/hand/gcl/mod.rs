//! The hand's own language, GCL, as text and as bytes: what is said to the hand and what it answers.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `motor_set` | the four motors, and the prefix of a command |
//! | `gcl_parameter` | what can be set and read, with ranges |
//! | `gcl_command` | a command as a value, written and read |
//! | `status_code` | the bits of an error |
//! | `gcl_reply` | where an answer ends, and what it says |
//! | `realtime_blocks` | the blocks of RealTime mode |
//!
//! No line, thread or clock here; the driver and the simulated hand share it. Any split of the bytes gives the same
//! answer.
//!
//! Source: Barrett, *BH8-Series User's Manual*, firmware 4.3x and 4.4.x, chapters 5 to 7; tables 20 to 23 of the
//! thesis. What they leave open is marked where it is decided.

mod gcl_command;
mod gcl_parameter;
mod gcl_reply;
mod motor_set;
mod realtime_blocks;
mod status_code;

pub use gcl_command::{Command, Listing, SettingsCommand, Verb};
pub use gcl_parameter::{Parameter, Scope};
pub use gcl_reply::{ABORT, BANNER, MAX_REPLY, PROMPT, Reply, ReplyError, ReplyReader};
pub use motor_set::{Finger, Motor, MotorSet};
pub use realtime_blocks::{
    BlockError, Control, Feedback, Header, Layout, MotorControl, MotorFeedback, MotorLayout,
};
pub use status_code::{Status, StatusBits};
