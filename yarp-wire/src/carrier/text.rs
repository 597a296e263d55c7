//! `text`: lines, for people with a terminal.

use super::{Carrier, Framing};

/// `CONNECT NAME`, answered `Welcome NAME`.
pub(super) static TEXT: Carrier = Carrier {
    name: "text",
    magic: *b"CONNECT ",
    recognises: |magic| magic == b"CONNECT ",
    framing: Framing::Lines,
    acknowledges: false,
    connectionless: false,
};
