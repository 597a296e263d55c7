//! `text`: lines, for people with a terminal.

use super::{Carrier, Framing, Transport};

/// `CONNECT NAME`, answered `Welcome NAME`.
pub(super) static TEXT: Carrier = Carrier {
    name: "text",
    magic: *b"CONNECT ",
    recognises: |magic| magic == b"CONNECT ",
    framing: Framing::Lines,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: true,
};
