//! `text_ack`: lines, each message answered `<ACK>`; the usual carrier of administration.

use super::{Carrier, Transport};
use crate::protocol::TEXT_LINES;

/// `CONNACK NAME`, answered `Welcome NAME`.
pub(super) static TEXT_ACK: Carrier = Carrier {
    name: "text_ack",
    magic: *b"CONNACK ",
    recognises: |magic| magic == b"CONNACK ",
    protocol: &TEXT_LINES,
    transport: Transport::Stream,
    acknowledges: true,
    connectionless: false,
    push: true,
    initiates: true,
};
