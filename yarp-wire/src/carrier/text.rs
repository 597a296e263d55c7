//! `text`: lines, for people with a terminal.

use super::{Carrier, Transport};
use crate::protocol::TEXT_LINES;

/// `CONNECT NAME`, answered `Welcome NAME`.
pub(super) static TEXT: Carrier = Carrier {
    name: "text",
    magic: *b"CONNECT ",
    recognises: |magic| magic == b"CONNECT ",
    protocol: &TEXT_LINES,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: true,
    initiates: true,
};
