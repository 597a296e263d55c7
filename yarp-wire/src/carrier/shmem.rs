//! `shmem`: as `tcp`, through shared memory; a plugin in stock ([`shmem`](crate::shmem)).

use super::{Carrier, Transport, specifier};
use crate::protocol::INDEXED;

/// Only for peers on the same machine.
pub(super) static SHMEM: Carrier = Carrier {
    name: "shmem",
    magic: super::magic(14),
    recognises: |magic| matches!(specifier(magic), Some(s) if s % 16 == 14),
    protocol: &INDEXED,
    transport: Transport::SharedMemory,
    acknowledges: true,
    connectionless: false,
    push: true,
    initiates: true,
};
