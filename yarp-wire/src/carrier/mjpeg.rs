//! `mjpeg`: JPEG images as cameras send them to browsers; the reader connects and pulls.

use bytes::{BufMut, BytesMut};

use super::{Carrier, Sender, Transport};
use crate::http::{RequestReader, Service};
use crate::message::Command;
use crate::message_limits::Limits;
use crate::mjpeg;
use crate::protocol::{
    Handshake, HandshakeDecoder, Incoming, InitiatorState, MessageDecoder, PayloadKind, Progress,
    Protocol, ProtocolError, ReplyDecoder,
};
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// `GET /?action=stream`, of which the magic is the beginning.
pub(super) static MJPEG: Carrier = Carrier {
    name: "mjpeg",
    magic: *b"GET /?ac",
    recognises: |magic| magic == b"GET /?ac",
    protocol: &Mjpeg,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: false,
    initiates: true,
};

/// One request, then images to the peer that connected.
#[derive(Debug)]
struct Mjpeg;

impl Protocol for Mjpeg {
    fn payload_kind(&self) -> PayloadKind {
        PayloadKind::Jpeg
    }

    fn service(&self) -> Option<Service> {
        Some(Service::Pictures)
    }

    fn put_header(&self, carrier: &Carrier, _sender: &Sender, output: &mut BytesMut) {
        output.put_slice(&carrier.magic);
    }

    /// Leaves the magic in `input`: it is the beginning of the request.
    fn handshake_decoder(
        &self,
        _carrier: &'static Carrier,
        _input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder> {
        Box::new(MjpegHandshakeDecoder(RequestReader::default()))
    }

    fn message_decoder(
        &self,
        _wire_version: WireVersion,
        _limits: Limits,
    ) -> Box<dyn MessageDecoder> {
        Box::new(NoMessages)
    }

    fn reply_decoder(&self, _limits: Limits) -> Box<dyn ReplyDecoder> {
        Box::new(NoMessages)
    }

    /// Each image has its own head.
    fn put_head(&self, _command: &Command, _length: usize, _output: &mut BytesMut) {}
}

/// Reads the request of a viewer.
#[derive(Debug)]
struct MjpegHandshakeDecoder(RequestReader);

impl HandshakeDecoder for MjpegHandshakeDecoder {
    fn read(
        &mut self,
        _port: u16,
        limits: Limits,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Handshake, ProtocolError> {
        if self.0.read(input, limits)?.is_none() {
            return Ok(None);
        }
        output.put_slice(mjpeg::RESPONSE.as_bytes());
        Ok(Some(Handshake::by(Sender::plain(mjpeg::VIEWER))))
    }
}

/// Accepts no messages: a viewer sends nothing after its request.
#[derive(Debug)]
struct NoMessages;

impl MessageDecoder for NoMessages {
    fn read(
        &mut self,
        _input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Ready<Incoming, ProtocolError> {
        Ok(None)
    }
}

impl ReplyDecoder for NoMessages {
    fn read(
        &mut self,
        _asked: &mut InitiatorState,
        input: &mut BytesMut,
    ) -> Ready<Progress, ProtocolError> {
        input.clear();
        Ok(None)
    }
}
