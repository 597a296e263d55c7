//! The state machines of a connection.
//!
//! An [`Acceptor`] is the side that listened: it learns carrier and sender from the first bytes,
//! then yields messages. An [`Initiator`] is the side that connected: it announces itself, then
//! sends messages and yields replies and acknowledgements. Either is fed a buffer that the driver
//! fills from a socket and takes what it can use; any split of the stream gives the same events.
//!
//! ```text
//!   initiator                        acceptor
//!   magic, sender         ------->   Event::Opened
//!   Progress::Ready       <-------   header reply
//!   message               ------->   Event::Message
//!   Progress::Reply       <-------   reply      (if the message asked for one)
//!   Progress::Done        <-------   acknowledgement   (if the carrier has them)
//! ```

mod accept;
mod datagrams;
mod error;
mod incoming;
mod initiate;
mod line;
mod outgoing;

pub use accept::{Acceptor, Event, REFUSAL, header_reply};
pub use datagrams::DatagramReader;
pub use error::ProtocolError;
pub use incoming::{Message, MessageReader};
pub use initiate::{Initiator, Progress, put_group};
pub use outgoing::{ACKNOWLEDGEMENT_LINE, put_acknowledgement, put_head, put_message, put_reply};
