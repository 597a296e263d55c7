//! The parts of one message on a connection.
//!
//! ```text
//! index (binary carriers)  |  command block or line  |  payload
//! ```

mod message_index;
mod payload;
mod pieces;
mod port_command;
mod wire_object;

pub use message_index::{Index, IndexError};
pub use payload::{Form, Payload};
pub use pieces::{Piece, Pieces};
pub use port_command::{Command, CommandError, SPELLED_LIMIT};
pub use wire_object::{RawText, ReadObject, WireObject};
