//! Messages between a control board and its clients, in both wire versions.
//!
//! Everything here is pure and shared by both sides, so that each word is read and written in one place. Requests and
//! results are the same in both wire versions; each file below names those that it handles.
//!
//! | file | message | port |
//! | --- | --- | --- |
//! | `board_vocabulary` | the words of 3.x, and of streamed commands | all |
//! | `axis_selection` | one joint, several, all: three spellings for each call | all |
//! | `board_request` | queries and commands | |
//! | `repeated_axes` | commands that name an axis twice | all |
//! | `request_table` | what can be read and set, generated from the descriptions of the interfaces | all |
//! | `spelling` | the words and functions of a row of the descriptions | all |
//! | `board_arguments`, `results` | the types in requests and replies, and their layouts | both |
//! | `board_vocab_requests` | queries and commands of 3.x | `rpc:i` |
//! | `board_thrift_calls` | queries and commands of 4.0 | `nws/rpc:i` |
//! | `reply_layout` | results of queries in the layouts of both | both |
//! | `board_reply` | replies of 3.x | `rpc:i` |
//! | `pid_messages`, `variable_value` | gains of control loops, values of variables | both |
//! | `streaming_command` | commands without a reply, in both | `command:i` |
//! | `motion_update` | numbered motions, our own messages | `rpc:i`, `nws/rpc:i`, `async:o` |
//! | `extended_state` | the whole state of the board, in both | `stateExt:o` |

mod axis_selection;
mod board_arguments;
mod board_reply;
mod board_request;
mod board_thrift_calls;
mod board_vocab_requests;
pub mod board_vocabulary;
mod extended_state;
mod motion_update;
mod number_parsing;
mod pid_messages;
mod repeated_axes;
mod reply_layout;
mod request_spelling;
mod request_table;
mod results;
mod streaming_command;
mod variable_value;

pub use axis_selection::{Forms, Functions, Selection, Words};
pub use board_arguments::SentMotorParameters;
pub use board_reply::{ProtocolVersion, Reply};
pub use board_request::{Get, Malformed, Request};
pub(crate) use board_thrift_calls::FUNCTIONS;
pub use extended_state::{Field, JointData};
pub use motion_update::{MotionEnd, MotionState, MotionUpdate, Numbered};
pub(crate) use number_parsing::{axis, count, float, floats, integer};
pub(crate) use request_spelling::Spelling;
pub use request_table::{Action, Quantity, Query, Set, Setting};
pub(crate) use results::{Choices, Outcome, read_flag};
pub use streaming_command::{Command, StreamingCommand};
pub(crate) use variable_value::{read as read_variable, to_values as variable_values};

#[cfg(test)]
mod recorded_tests;
