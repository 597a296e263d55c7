//! WebSocket frames between web pages and ports, RFC 6455.
//!
//! ```text
//!   page                                       port
//!   GET /?ws HTTP/1.1, Upgrade     ------->
//!                                  <-------    HTTP/1.1 101 Switching Protocols
//!   frames, masked                 ------->    data frames one behind the other are a stream of
//!                                              command blocks and payloads
//!                                  <-------    frames, unmasked
//!   ping                           ------->
//!                                  <-------    pong
//!   close                          ------->    acts as the command `q`
//! ```
//!
//! Text frames count as data like binary ones, as in stock, so their content is not checked to be
//! text. No extensions are negotiated.

mod websocket_frame;
mod websocket_handshake;

pub use websocket_frame::{FrameReader, put_close, put_frame_head};
pub use websocket_handshake::response;

/// The reason why a WebSocket connection cannot continue.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WebSocketError {
    /// The request does not ask for frames, or its key is none.
    #[error("expected `Upgrade: websocket` and a key of 16 bytes")]
    Handshake,
    /// A frame with a bit set that only an extension gives a meaning.
    #[error("a frame of an extension that was not agreed upon")]
    Extension,
    /// A frame of an unknown kind.
    #[error("a frame of unknown kind {kind:#x}")]
    Kind {
        /// Its number.
        kind: u8,
    },
    /// A frame that is not masked: no browser sends such.
    #[error("a WebSocket frame that is not masked")]
    Unmasked,
    /// A ping, pong or close that is cut into pieces or longer than 125 bytes.
    #[error("a control frame in pieces, or of more than 125 bytes")]
    Control,
    /// A message begins within another, or continues before its beginning.
    #[error("a frame out of order")]
    Order,
    /// A frame larger than we take.
    #[error("a frame of {length} bytes, allowed are {limit}")]
    TooLarge {
        /// The length as it stands.
        length: u64,
        /// The limit in force.
        limit: usize,
    },
    /// The page closed the connection.
    #[error("the WebSocket client closed the connection")]
    Closed,
}
