//! `fast_tcp`: as `tcp` without acknowledgements; only the socket holds a writer back.

use super::{Carrier, Transport, specifier};
use crate::protocol::INDEXED;

/// The same specifier as `tcp` with bit 7 clear.
pub(super) static FAST_TCP: Carrier = Carrier {
    name: "fast_tcp",
    magic: super::magic(3),
    recognises: |magic| matches!(specifier(magic), Some(s) if s % 16 == 3 && s & 128 == 0),
    protocol: &INDEXED,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: true,
    initiates: true,
};
