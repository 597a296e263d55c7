//! What a control board and its clients say to each other, in both generations.
//!
//! Everything here is pure and shared by both sides, so that each word is read and written in one place. What is
//! wanted and answered is the same in both generations; each file below says which of them it is about.
//!
//! | file | message | port |
//! | --- | --- | --- |
//! | `vocabulary` | the words of 3.x, and of streamed commands | all |
//! | `selection` | one joint, several, all: three spellings for each call | all |
//! | `quantity` | the numbers that can be asked for and set, and how both spell them | all |
//! | `request` | questions and orders | |
//! | `words` | questions and orders as 3.x says them | `rpc:i` |
//! | `calls` | questions and orders as 4.0 says them | `nws/rpc:i` |
//! | `answer` | results of questions in the layouts of both | both |
//! | `reply` | what stands around results in 3.x | `rpc:i` |
//! | `loops`, `variable` | gains of control loops, values of variables | both |
//! | `command` | orders that nobody waits for, in both | `command:i` |
//! | `motion` | numbered motions, words of ours | `rpc:i`, `nws/rpc:i`, `async:o` |
//! | `joint_data` | the whole state of the board, in both | `stateExt:o` |

mod answer;
mod calls;
mod command;
mod joint_data;
mod loops;
mod motion;
mod number;
mod quantity;
mod reply;
mod request;
mod selection;
mod variable;
pub mod vocabulary;
mod words;

pub(crate) use answer::{gains, read_flag, read_gains};
pub(crate) use calls::FUNCTIONS;
pub use command::{Command, Streamed};
pub use joint_data::{Field, JointData};
pub(crate) use loops::{info as pid_info, kind_of, kind_word, read_info as read_pid_info};
pub use motion::{MotionEnd, MotionNews, MotionState, Numbered};
pub(crate) use number::{axis, count, float, floats, integer};
pub use quantity::{Quantity, Setting};
pub use reply::{ProtocolVersion, Reply};
pub(crate) use reply::{joint_type_from_value, joint_type_to_value};
pub use request::{Action, Get, Malformed, Question, Range, Request, Set};
pub use selection::{Forms, Functions, Selection, Words};
pub(crate) use variable::{read as read_variable, to_values as variable_to_values};

#[cfg(test)]
mod recorded_tests;
