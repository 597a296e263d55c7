//! `name_ser`: bare lines for the name server, each starting `NAME_SERVER `.

use super::{Carrier, Framing, Transport};

/// The first eight letters of `NAME_SERVER` select it.
pub(super) static NAME_SER: Carrier = Carrier {
    name: "name_ser",
    magic: *b"NAME_SER",
    recognises: |magic| magic == b"NAME_SER",
    framing: Framing::NameService,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: true,
};
