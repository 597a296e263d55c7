//! `websocket`: binary messages without an index, in the frames of RFC 6455; for pages.

use super::{Carrier, Framing, Transport};

/// `GET /?ws` and whatever follows; only browsers begin such a connection.
pub(super) static WEBSOCKET: Carrier = Carrier {
    name: "websocket",
    magic: *b"GET /?ws",
    recognises: |magic| magic == b"GET /?ws",
    framing: Framing::Bare,
    transport: Transport::WebSocket,
    acknowledges: false,
    connectionless: false,
    push: true,
};
