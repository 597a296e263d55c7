//! `unix_stream`: binary messages without an index, over a socket of the file system.

use super::{Carrier, Transport};
use crate::protocol::UNINDEXED;

/// Without acknowledgements; the usual form.
pub(super) static UNIX_STREAM: Carrier = Carrier {
    name: "unix_stream",
    magic: *b"UNIX_STR",
    recognises: |magic| magic == b"UNIX_STR",
    protocol: &UNINDEXED,
    transport: Transport::UnixSocket,
    acknowledges: false,
    connectionless: false,
    push: true,
    initiates: true,
};

/// With acknowledgements, as requested by the modifier `+ack`.
pub(super) static UNIX_STREAM_ACK: Carrier = Carrier {
    name: "unix_stream",
    magic: *b"UNIX_ACK",
    recognises: |magic| magic == b"UNIX_ACK",
    protocol: &UNINDEXED,
    transport: Transport::UnixSocket,
    acknowledges: true,
    connectionless: false,
    push: true,
    initiates: true,
};
