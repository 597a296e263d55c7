//! `tcp`: binary, each message acknowledged after its reader has consumed it.

use super::{Carrier, Transport, specifier};
use crate::protocol::INDEXED;

/// Tells `tcp` from `fast_tcp`.
const ACKNOWLEDGE: i32 = 128;

/// Bit 7 of the specifier asks for acknowledgements.
pub(super) static TCP: Carrier = Carrier {
    name: "tcp",
    magic: super::magic(3 + ACKNOWLEDGE),
    recognises: |magic| matches!(specifier(magic), Some(s) if s % 16 == 3 && s & ACKNOWLEDGE != 0),
    protocol: &INDEXED,
    transport: Transport::Stream,
    acknowledges: true,
    connectionless: false,
    push: true,
    initiates: true,
};
