//! `local`: within a process. The header is there so that a peer that tries it from elsewhere is
//! known by what it wants; nothing ever travels.

use super::{Carrier, Framing, Transport};

/// As in stock, without acknowledgements; the reader of the same process says when it is done.
pub(super) static LOCAL: Carrier = Carrier {
    name: "local",
    magic: *b"LOCALITY",
    recognises: |magic| magic == b"LOCALITY",
    framing: Framing::Bare,
    transport: Transport::Local,
    acknowledges: false,
    connectionless: false,
    push: true,
};
