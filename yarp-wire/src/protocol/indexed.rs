//! Messages with an index: it, a command block, and a binary payload.

use bytes::{Buf, BytesMut};

use super::binary_common::{BinaryHandshakeDecoder, BinaryReplyDecoder, put_binary_header};
use super::{
    HandshakeDecoder, Incoming, Message, MessageDecoder, PayloadKind, Protocol, ProtocolError,
    ReplyDecoder,
};
use crate::carrier::{Carrier, Sender, Transport};
use crate::framed_number;
use crate::message::{Command, Form, Index, Payload};
use crate::message_limits::Limits;
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// Messages with an index.
pub static INDEXED: Indexed = Indexed;

/// See [`INDEXED`].
#[derive(Debug)]
pub struct Indexed;

impl Protocol for Indexed {
    fn payload_kind(&self) -> PayloadKind {
        PayloadKind::Binary
    }

    fn put_header(&self, carrier: &Carrier, sender: &Sender, output: &mut BytesMut) {
        put_binary_header(carrier, sender, output);
    }

    fn handshake_decoder(
        &self,
        carrier: &'static Carrier,
        input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder> {
        let answer = match carrier.transport {
            Transport::Stream | Transport::Encrypted => header_reply,
            // The driver knows the next transport.
            _ => |_, _: &mut BytesMut| (),
        };
        Box::new(BinaryHandshakeDecoder::new(input, answer))
    }

    fn message_decoder(
        &self,
        wire_version: WireVersion,
        limits: Limits,
    ) -> Box<dyn MessageDecoder> {
        Box::new(IndexedMessageDecoder::new(wire_version, limits))
    }

    fn reply_decoder(&self, _limits: Limits) -> Box<dyn ReplyDecoder> {
        Box::new(answers(take_header_reply))
    }

    fn put_head(&self, command: &Command, length: usize, output: &mut BytesMut) {
        Index::put(output, command.block_len(), length);
        command.put_block(output);
    }

    fn put_acknowledgement(&self, output: &mut BytesMut) {
        framed_number::put(output, 0);
    }
}

/// Appends the header reply of a binary carrier: the port to continue with.
pub fn header_reply(port: u16, output: &mut BytesMut) {
    framed_number::put(output, i32::from(port));
}

fn take_header_reply(input: &mut BytesMut) -> Ready<i32, ProtocolError> {
    let Some(reply) = input.first_chunk::<{ framed_number::LEN }>() else {
        return Ok(None);
    };
    let number = framed_number::decode(reply).ok_or(ProtocolError::HeaderReply { got: *reply })?;
    input.advance(framed_number::LEN);
    Ok(Some(number))
}

/// Answers behind a header that is answered so.
pub(crate) fn answers(
    header: fn(&mut BytesMut) -> Ready<i32, ProtocolError>,
) -> BinaryReplyDecoder {
    BinaryReplyDecoder::new(header, take_acknowledgement)
}

/// Consumes an acknowledgement: a number, and that many bytes without meaning.
fn take_acknowledgement(input: &mut BytesMut, limits: Limits) -> Ready<(), ProtocolError> {
    let Some(head) = input.first_chunk::<{ framed_number::LEN }>() else {
        return Ok(None);
    };
    let discard = framed_number::decode(head)
        .and_then(|n| usize::try_from(n).ok())
        .filter(|n| *n <= limits.line)
        .ok_or_else(|| ProtocolError::Acknowledgement { got: head.to_vec() })?;
    if input.len() < framed_number::LEN + discard {
        return Ok(None);
    }
    input.advance(framed_number::LEN + discard);
    Ok(Some(()))
}

/// Takes messages with an index.
#[derive(Debug)]
pub(crate) struct IndexedMessageDecoder {
    wire_version: WireVersion,
    limits: Limits,
    /// The index has been read; that many bytes of message follow.
    total: Option<usize>,
}

impl IndexedMessageDecoder {
    pub(crate) fn new(wire_version: WireVersion, limits: Limits) -> Self {
        Self {
            wire_version,
            limits,
            total: None,
        }
    }

    /// Takes the next message from `input`, or `None` while bytes are missing.
    pub(crate) fn take(&mut self, input: &mut BytesMut) -> Ready<Message, ProtocolError> {
        let total = match self.total {
            Some(total) => total,
            None => match Index::read(input, self.limits.message)? {
                Some((index, length)) => {
                    input.advance(length);
                    index.total
                }
                None => return Ok(None),
            },
        };
        let is_whole = input.len() >= total;
        self.total = (!is_whole).then_some(total);
        if !is_whole {
            return Ok(None);
        }
        let mut bytes = input.split_to(total).freeze();
        let (command, block) = Command::read(&bytes)?;
        bytes.advance(block);
        if !command.has_payload() {
            bytes.clear();
        }
        let payload = Payload::new(bytes, Form::Binary(self.wire_version));
        Ok(Some(Message { command, payload }))
    }
}

impl MessageDecoder for IndexedMessageDecoder {
    fn read(
        &mut self,
        input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Ready<Incoming, ProtocolError> {
        Ok(self.take(input)?.map(Incoming::Message))
    }

    fn missing(&self, input: &BytesMut) -> usize {
        self.total.unwrap_or(0).saturating_sub(input.len())
    }

    fn set_wire_version(&mut self, wire_version: WireVersion) {
        self.wire_version = wire_version;
    }
}
