//! MessageDecoder, replies and acknowledgements into a stream.

use bytes::BytesMut;

use crate::carrier::Carrier;
use crate::message::{Command, WireObject};
use crate::wire_version::WireVersion;

/// Appends a message: its head and, if it has one, its content.
pub fn put_message(
    out: &mut BytesMut,
    carrier: &Carrier,
    command: &Command,
    content: Option<&dyn WireObject>,
    wire_version: WireVersion,
) {
    let mut payload = BytesMut::new();
    if let Some(content) = content {
        carrier
            .protocol
            .put_object(content, wire_version, &mut payload);
    }
    carrier.protocol.put_head(command, payload.len(), out);
    out.extend_from_slice(&payload);
}

/// Appends an acknowledgement, if the carrier has them.
pub fn put_acknowledgement(out: &mut BytesMut, carrier: &Carrier) {
    if carrier.acknowledges {
        carrier.protocol.put_acknowledgement(out);
    }
}
