//! `local`: within a process. The header exists so that a peer in another process can be recognised
//! and refused; no messages travel.

use bytes::BytesMut;

use super::{Carrier, Sender, Transport};
use crate::message::Command;
use crate::message_limits::Limits;
use crate::protocol::{
    Handshake, HandshakeDecoder, MessageDecoder, PayloadKind, Protocol, ProtocolError,
    ReplyDecoder, UNINDEXED,
};
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// Without acknowledgements, as in stock; a reader of the same process reports completion directly.
pub(super) static LOCAL: Carrier = Carrier {
    name: "local",
    magic: *b"LOCALITY",
    recognises: |magic| magic == b"LOCALITY",
    protocol: &Local,
    transport: Transport::Local,
    acknowledges: false,
    connectionless: false,
    push: true,
    initiates: true,
};

/// The protocol that `local` would have; no bytes are sent.
#[derive(Debug)]
struct Local;

impl Protocol for Local {
    fn payload_kind(&self) -> PayloadKind {
        UNINDEXED.payload_kind()
    }

    fn put_header(&self, carrier: &Carrier, sender: &Sender, output: &mut BytesMut) {
        UNINDEXED.put_header(carrier, sender, output);
    }

    fn handshake_decoder(
        &self,
        _carrier: &'static Carrier,
        _input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder> {
        Box::new(OtherProcessRejector)
    }

    fn message_decoder(
        &self,
        wire_version: WireVersion,
        limits: Limits,
    ) -> Box<dyn MessageDecoder> {
        UNINDEXED.message_decoder(wire_version, limits)
    }

    fn reply_decoder(&self, limits: Limits) -> Box<dyn ReplyDecoder> {
        UNINDEXED.reply_decoder(limits)
    }

    fn put_head(&self, command: &Command, length: usize, output: &mut BytesMut) {
        UNINDEXED.put_head(command, length, output);
    }
}

/// Refuses a peer in another process: only such a peer sends a header.
#[derive(Debug)]
struct OtherProcessRejector;

impl HandshakeDecoder for OtherProcessRejector {
    fn read(
        &mut self,
        _port: u16,
        _limits: Limits,
        _input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Ready<Handshake, ProtocolError> {
        Err(ProtocolError::OtherProcess)
    }
}
