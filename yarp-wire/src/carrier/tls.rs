//! `tls`: as `tcp`, with the whole connection inside TLS; not known to stock.

use super::{Carrier, Transport};
use crate::protocol::INDEXED;

/// Only inside an encrypted connection; the header is the first of it that is encrypted.
pub(super) static TLS: Carrier = Carrier {
    name: "tls",
    magic: *b"YARP_TLS",
    recognises: |magic| magic == b"YARP_TLS",
    protocol: &INDEXED,
    transport: Transport::Encrypted,
    acknowledges: true,
    connectionless: false,
    push: true,
    initiates: true,
};
