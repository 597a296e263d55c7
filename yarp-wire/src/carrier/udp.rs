//! `udp`: binary messages split into datagrams; lost datagrams are not repeated.

use super::{Carrier, Transport, specifier};
use crate::protocol::INDEXED;

/// The header goes over TCP; its reply is the UDP port that the acceptor has opened.
pub(super) static UDP: Carrier = Carrier {
    name: "udp",
    magic: super::magic(0),
    recognises: |magic| matches!(specifier(magic), Some(s) if s % 16 == 0),
    protocol: &INDEXED,
    transport: Transport::Datagrams,
    acknowledges: false,
    connectionless: true,
    push: true,
    initiates: true,
};
