//! The hand's own language, GCL, as text and as bytes: commands and replies.
//!
//! | file | content |
//! | --- | --- |
//! | `motor_set` | the four motors, and the prefix of a command |
//! | `firmware_version` | differences between versions of the firmware |
//! | `gcl_parameter` | parameters that can be set and read, with ranges |
//! | `gcl_command` | commands: encoding and parsing |
//! | `status_code` | the bits of an error |
//! | `gcl_reply` | parsing replies |
//! | `realtime_blocks` | the blocks of RealTime mode |
//!
//! No line, thread or clock here; the driver and the simulated hand share it. Any split of the bytes gives the same
//! answer.
//!
//! Source: Barrett, *BH8-Series User's Manual*, firmware 4.3x and 4.4.x, chapters 5 to 7; tables 20 to 23 of the
//! thesis. Choices that they leave open are marked in the code.

mod firmware_version;
mod gcl_command;
mod gcl_parameter;
mod gcl_reply;
mod motor_set;
mod realtime_blocks;
mod status_code;

pub use firmware_version::FirmwareVersion;
pub use gcl_command::{Command, Listing, SettingsCommand, Verb};
pub use gcl_parameter::{Parameter, Scope};
pub use gcl_reply::{ABORT, BANNER, MAX_REPLY, PROMPT, Reply, ReplyError, ReplyReader};
pub use motor_set::{Finger, Motor, MotorSet};
pub use realtime_blocks::{
    BlockError, Control, Feedback, Header, Layout, MotorControl, MotorFeedback, MotorLayout,
};
pub use status_code::{Status, StatusBits};
