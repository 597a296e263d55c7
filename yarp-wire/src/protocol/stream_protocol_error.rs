//! Errors in a byte stream.

use crate::bottle::DecodeError;
use crate::carrier::MAGIC;
use crate::http::Refusal;
use crate::message::{CommandError, IndexError};
use crate::websocket::WebSocketError;

/// The reason why a connection cannot continue. The peer violated the protocol; nothing that it
/// sent is used.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolError {
    /// The first bytes select no carrier that we have.
    #[error("no carrier starts with {:?}", String::from_utf8_lossy(magic))]
    UnknownCarrier {
        /// The bytes.
        magic: [u8; MAGIC],
    },
    /// A connection within a process that comes from another.
    #[error("`local` serves ports of one process, and this peer is in another: try `tcp`")]
    OtherProcess,
    /// The sender's name has an impossible length.
    #[error("the sender's name has {length} bytes, expected 1 to {limit}")]
    SenderLength {
        /// The length as it stands.
        length: i32,
        /// The most we take.
        limit: usize,
    },
    /// No header reply from the acceptor.
    #[error("expected a header reply of 8 bytes `YA....RP`, got {got:02X?}")]
    HeaderReply {
        /// The bytes.
        got: [u8; 8],
    },
    /// No acknowledgement where one was due.
    #[error("expected an acknowledgement, got {got:02X?}")]
    Acknowledgement {
        /// The bytes.
        got: Vec<u8>,
    },
    /// The message index is wrong.
    #[error(transparent)]
    Index(#[from] IndexError),
    /// The command block is wrong.
    #[error(transparent)]
    Command(#[from] CommandError),
    /// A line is too long.
    #[error("a line of more than {limit} bytes")]
    LineTooLong {
        /// The limit in force.
        limit: usize,
    },
    /// A reply is no bottle.
    #[error("the reply cannot be read")]
    Reply(#[from] DecodeError),
    /// The frames are wrong.
    #[error(transparent)]
    WebSocket(#[from] WebSocketError),
    /// A request of a browser that is not answered.
    #[error("refusing a request: {0}")]
    Browser(Refusal),
    /// Bytes arrived outside any reply.
    #[error("{count} unexpected bytes outside a reply")]
    Unexpected {
        /// Number of bytes.
        count: usize,
    },
}
