//! The state machines of a connection.
//!
//! An [`Acceptor`] is the side that listened: it detects carrier and sender from the first bytes,
//! then yields messages. An [`Initiator`] is the side that connected: it announces itself, then
//! sends messages and yields replies and acknowledgements. The driver fills a buffer from a socket
//! and each side consumes what it can use; any split of the stream gives the same events. The
//! carrier's [protocol](crate::protocol) defines the bytes.
//!
//! ```text
//!   initiator                        acceptor
//!   magic, sender         ------->   Event::Opened
//!   Progress::Ready       <-------   header reply
//!   message               ------->   Event::Message
//!   Progress::Reply       <-------   reply      (if the message asked for one)
//!   Progress::Done        <-------   acknowledgement   (if the carrier has them)
//! ```

mod acceptor;
mod datagram_reassembly;
mod initiator;
mod message_writer;

pub(crate) use acceptor::unreadable;
pub use acceptor::{Acceptor, Event, REFUSAL};
pub use datagram_reassembly::DatagramReassembler;
pub use initiator::Initiator;
pub use message_writer::{put_acknowledgement, put_message};

pub use crate::protocol::{Message, Progress, ProtocolError};
