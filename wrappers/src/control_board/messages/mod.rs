//! What a control board and its clients say to each other (YARP 3.5 to 3.12).
//!
//! Everything here is pure and shared by both sides, so that each word is read and written in one place.
//!
//! | file | message | port |
//! | --- | --- | --- |
//! | `vocabulary` | the words themselves | all |
//! | `selection` | one joint, several, all: three words for each call | `rpc:i`, `command:i` |
//! | `quantity` | the numbers that can be asked for and set | `rpc:i` |
//! | `request` | questions and orders | `rpc:i` |
//! | `reply` | what they are answered with | `rpc:i` |
//! | `command` | orders that nobody waits for | `command:i` |
//! | `joint_data` | the whole state of the board | `stateExt:o` |
//!
//! YARP 4.0 speaks another protocol on these ports.

mod command;
mod joint_data;
mod number;
mod quantity;
mod reply;
mod request;
mod selection;
pub mod vocabulary;

pub use command::{Command, Streamed};
pub use joint_data::{Field, JointData};
pub use quantity::{Quantity, Setting};
pub use reply::{ProtocolVersion, Reply};
pub(crate) use reply::{joint_type_from_value, joint_type_to_value};
pub use request::{Get, Malformed, Request, Set};
pub use selection::{Selection, Words};

#[cfg(test)]
mod recorded_tests;
