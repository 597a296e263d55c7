//! `text_ack`: lines, each message answered `<ACK>`; the usual carrier of administration.

use super::{Carrier, Framing, Transport};

/// `CONNACK NAME`, answered `Welcome NAME`.
pub(super) static TEXT_ACK: Carrier = Carrier {
    name: "text_ack",
    magic: *b"CONNACK ",
    recognises: |magic| magic == b"CONNACK ",
    framing: Framing::Lines,
    transport: Transport::Stream,
    acknowledges: true,
    connectionless: false,
    push: true,
};
