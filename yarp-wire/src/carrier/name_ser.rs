//! `name_ser`: bare lines for the name server, each starting `NAME_SERVER `.

use bytes::{Buf, BufMut, BytesMut};

use super::{Carrier, MAGIC, Sender, Transport};
use crate::message::{Command, Form, Payload};
use crate::message_limits::Limits;
use crate::protocol::{
    AnonymousHandshake, HandshakeDecoder, Incoming, LineReader, Message, MessageDecoder,
    PayloadKind, Protocol, ProtocolError, ReplyDecoder, TextReplyDecoder,
};
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// The first eight letters of `NAME_SERVER` select it.
pub(super) static NAME_SER: Carrier = Carrier {
    name: "name_ser",
    magic: *b"NAME_SER",
    recognises: |magic| magic == b"NAME_SER",
    protocol: &NameSer,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: true,
    initiates: true,
};

/// The prefix of each line.
const NAME_SERVER: &[u8] = b"NAME_SERVER ";

/// Lines that each are a message.
#[derive(Debug)]
struct NameSer;

impl Protocol for NameSer {
    fn payload_kind(&self) -> PayloadKind {
        PayloadKind::Text
    }

    /// Writes nothing: the magic is the beginning of the first message.
    fn put_header(&self, _carrier: &Carrier, _sender: &Sender, _output: &mut BytesMut) {}

    fn handshake_decoder(
        &self,
        _carrier: &'static Carrier,
        input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder> {
        input.advance(MAGIC);
        Box::new(AnonymousHandshake("anon"))
    }

    fn message_decoder(
        &self,
        _wire_version: WireVersion,
        limits: Limits,
    ) -> Box<dyn MessageDecoder> {
        Box::new(NameSerMessageDecoder {
            skip: NAME_SERVER.len() - MAGIC,
            line: LineReader::new(limits.line),
        })
    }

    fn reply_decoder(&self, limits: Limits) -> Box<dyn ReplyDecoder> {
        Box::new(TextReplyDecoder::without_welcome(limits))
    }

    fn put_head(&self, command: &Command, _length: usize, output: &mut BytesMut) {
        if command.has_payload() {
            output.put_slice(NAME_SERVER);
        }
    }
}

/// Takes messages of a line each.
#[derive(Debug)]
struct NameSerMessageDecoder {
    /// Bytes to pass over before a line.
    skip: usize,
    line: LineReader,
}

impl MessageDecoder for NameSerMessageDecoder {
    fn read(
        &mut self,
        input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Ready<Incoming, ProtocolError> {
        let skipped = input.len().min(self.skip);
        input.advance(skipped);
        self.skip -= skipped;
        if self.skip > 0 {
            return Ok(None);
        }
        let Some(line) = self.line.read(input)? else {
            return Ok(None);
        };
        self.skip = NAME_SERVER.len();
        let (command, payload) = (Command::data(true), Payload::new(line, Form::Text));
        Ok(Some(Incoming::Message(Message { command, payload })))
    }
}
