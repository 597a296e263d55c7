//! `mcast`: binary messages in datagrams to a group, one transmission for all readers.

use std::net::{Ipv4Addr, SocketAddrV4};

use bytes::{Buf, BufMut, BytesMut};

use super::{Carrier, MAGIC, Sender, Transport, specifier};
use crate::message::Command;
use crate::message_limits::Limits;
use crate::protocol::{
    BinaryHandshakeDecoder, Handshake, HandshakeDecoder, INDEXED, MessageDecoder, PayloadKind,
    Protocol, ProtocolError, ReplyDecoder, indexed_answers,
};
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// After the header the initiator names the group; there is no reply.
pub(super) static MCAST: Carrier = Carrier {
    name: "mcast",
    magic: super::magic(1),
    recognises: |magic| matches!(specifier(magic), Some(s) if s % 16 == 1),
    protocol: &Mcast,
    transport: Transport::Group,
    acknowledges: false,
    connectionless: true,
    push: true,
    initiates: true,
};

/// Bytes of a group: IPv4 address and port, the latter high byte first.
const GROUP: usize = 6;

/// Appends the multicast group of the connection, after the header.
pub fn put_group(group: SocketAddrV4, output: &mut BytesMut) {
    output.put_slice(&group.ip().octets());
    output.put_u16(group.port());
}

/// Messages with an index behind a header with a group.
#[derive(Debug)]
struct Mcast;

impl Protocol for Mcast {
    fn payload_kind(&self) -> PayloadKind {
        INDEXED.payload_kind()
    }

    fn put_header(&self, carrier: &Carrier, sender: &Sender, output: &mut BytesMut) {
        INDEXED.put_header(carrier, sender, output);
    }

    fn handshake_decoder(
        &self,
        _carrier: &'static Carrier,
        input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder> {
        input.advance(MAGIC);
        Box::new(GroupHandshakeDecoder(None))
    }

    fn message_decoder(
        &self,
        wire_version: WireVersion,
        limits: Limits,
    ) -> Box<dyn MessageDecoder> {
        INDEXED.message_decoder(wire_version, limits)
    }

    fn reply_decoder(&self, _limits: Limits) -> Box<dyn ReplyDecoder> {
        Box::new(indexed_answers(|_| Ok(Some(0))))
    }

    fn put_head(&self, command: &Command, length: usize, output: &mut BytesMut) {
        INDEXED.put_head(command, length, output);
    }
}

/// Takes the sender, then the group.
#[derive(Debug)]
struct GroupHandshakeDecoder(Option<Sender>);

impl HandshakeDecoder for GroupHandshakeDecoder {
    fn read(
        &mut self,
        _port: u16,
        _limits: Limits,
        input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Ready<Handshake, ProtocolError> {
        if self.0.is_none() {
            self.0 = BinaryHandshakeDecoder::sender(input)?;
        }
        let (Some(sender), Some(address)) = (&self.0, input.first_chunk::<GROUP>()) else {
            return Ok(None);
        };
        let [a, b, c, d, high, low] = *address;
        let port = u16::from_be_bytes([high, low]);
        let group = Some(SocketAddrV4::new(Ipv4Addr::new(a, b, c, d), port));
        input.advance(GROUP);
        let sender = sender.clone();
        Ok(Some(Handshake { sender, group }))
    }
}
