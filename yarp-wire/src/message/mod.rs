//! The parts of one message on a connection.
//!
//! ```text
//! index (binary carriers)  |  command block or line  |  payload
//! ```

mod command;
mod index;
mod object;
mod payload;
mod pieces;

pub use command::{Command, CommandError};
pub use index::{Index, IndexError};
pub use object::{RawText, ReadObject, WireObject};
pub use payload::{Form, Payload};
pub use pieces::{Piece, Pieces};
