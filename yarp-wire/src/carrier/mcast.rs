//! `mcast`: binary messages in datagrams to a group, one transmission for all readers.

use super::{Carrier, Framing, Transport, specifier};

/// After the header the initiator names the group; there is no reply.
pub(super) static MCAST: Carrier = Carrier {
    name: "mcast",
    magic: super::magic(1),
    recognises: |magic| matches!(specifier(magic), Some(s) if s % 16 == 1),
    framing: Framing::Indexed,
    transport: Transport::Group,
    acknowledges: false,
    connectionless: true,
    push: true,
};
