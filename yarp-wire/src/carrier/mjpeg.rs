//! `mjpeg`: pictures, as cameras send them to browsers; the reader connects and pulls.

use super::{Carrier, Framing, Transport};

/// `GET /?action=stream`, of which the magic is the beginning.
pub(super) static MJPEG: Carrier = Carrier {
    name: "mjpeg",
    magic: *b"GET /?ac",
    recognises: |magic| magic == b"GET /?ac",
    framing: Framing::Pictures,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: false,
};
