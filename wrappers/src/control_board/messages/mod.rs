//! Messages between a control board and its clients, in both wire versions.
//!
//! Everything here is pure and shared by both sides, so that each word is read and written in one place. Requests and
//! results are the same in both wire versions; each file below names those that it handles.
//!
//! | file | message | port |
//! | --- | --- | --- |
//! | `vocabulary` | the words of 3.x, and of streamed commands | all |
//! | `axis_selection` | one joint, several, all: three spellings for each call | all |
//! | `request` | queries and commands | |
//! | `request_table` | what can be read and set, generated from the descriptions of the interfaces | all |
//! | `spelling` | the words and functions of a row of the descriptions | all |
//! | `arguments`, `results` | the types in requests and replies, and their layouts | both |
//! | `vocab_requests` | queries and commands of 3.x | `rpc:i` |
//! | `thrift_calls` | queries and commands of 4.0 | `nws/rpc:i` |
//! | `reply_layout` | results of queries in the layouts of both | both |
//! | `reply` | replies of 3.x | `rpc:i` |
//! | `pid_messages`, `variable_value` | gains of control loops, values of variables | both |
//! | `streaming_command` | commands without a reply, in both | `command:i` |
//! | `motion_update` | numbered motions, our own messages | `rpc:i`, `nws/rpc:i`, `async:o` |
//! | `extended_state` | the whole state of the board, in both | `stateExt:o` |

mod arguments;
mod axis_selection;
mod extended_state;
mod motion_update;
mod number_parsing;
mod pid_messages;
mod reply;
mod reply_layout;
mod request;
mod request_table;
mod results;
mod spelling;
mod streaming_command;
mod thrift_calls;
mod variable_value;
mod vocab_requests;
pub mod vocabulary;

pub use arguments::SentMotorParameters;
pub use axis_selection::{Forms, Functions, Selection, Words};
pub use extended_state::{Field, JointData};
pub use motion_update::{MotionEnd, MotionState, MotionUpdate, Numbered};
pub(crate) use number_parsing::{axis, count, float, floats, integer};
pub use reply::{ProtocolVersion, Reply};
pub(crate) use reply_layout::read_flag;
pub use request::{Get, Malformed, Request};
pub use request_table::{Action, Quantity, Query, Set, Setting};
pub(crate) use results::{Choices, Outcome};
pub(crate) use spelling::Spelling;
pub use streaming_command::{Command, StreamingCommand};
pub(crate) use thrift_calls::FUNCTIONS;

#[cfg(test)]
mod recorded_tests;
