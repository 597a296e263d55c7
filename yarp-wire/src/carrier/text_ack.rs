//! `text_ack`: lines, each message answered `<ACK>`; the usual carrier of administration.

use super::{Carrier, Framing};

/// `CONNACK NAME`, answered `Welcome NAME`.
pub(super) static TEXT_ACK: Carrier = Carrier {
    name: "text_ack",
    magic: *b"CONNACK ",
    recognises: |magic| magic == b"CONNACK ",
    framing: Framing::Lines,
    acknowledges: true,
    connectionless: false,
};
