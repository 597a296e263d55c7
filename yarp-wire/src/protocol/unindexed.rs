//! Messages without an index: a command block and a binary payload, whose own structure tells where
//! it ends.

use bytes::{Buf, BufMut, Bytes, BytesMut};

use super::binary_common::{BinaryHandshakeDecoder, BinaryReplyDecoder, put_binary_header};
use super::{
    HandshakeDecoder, Incoming, Message, MessageDecoder, PayloadKind, Protocol, ProtocolError,
    ReplyDecoder,
};
use crate::bottle::{Scan, Scanner};
use crate::carrier::{Carrier, Sender};
use crate::message::{Command, Form, Payload};
use crate::message_limits::Limits;
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// Messages without an index.
pub static UNINDEXED: Unindexed = Unindexed;

/// See [`UNINDEXED`].
#[derive(Debug)]
pub struct Unindexed;

/// The acknowledgement.
const ACKNOWLEDGEMENT: &[u8; 4] = b"ACK\0";

impl Protocol for Unindexed {
    fn payload_kind(&self) -> PayloadKind {
        PayloadKind::Binary
    }

    fn put_header(&self, carrier: &Carrier, sender: &Sender, output: &mut BytesMut) {
        put_binary_header(carrier, sender, output);
    }

    fn handshake_decoder(
        &self,
        _carrier: &'static Carrier,
        input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder> {
        Box::new(BinaryHandshakeDecoder::new(input, |_, _| ()))
    }

    fn message_decoder(
        &self,
        wire_version: WireVersion,
        limits: Limits,
    ) -> Box<dyn MessageDecoder> {
        Box::new(UnindexedMessageDecoder::new(wire_version, limits))
    }

    fn reply_decoder(&self, _limits: Limits) -> Box<dyn ReplyDecoder> {
        Box::new(answers())
    }

    fn put_head(&self, command: &Command, _length: usize, output: &mut BytesMut) {
        command.put_block(output);
    }

    fn put_acknowledgement(&self, output: &mut BytesMut) {
        output.put_slice(ACKNOWLEDGEMENT);
    }
}

/// Creates the reply decoder. The header has no reply: the connection continues over another socket
/// at once.
pub(crate) fn answers() -> BinaryReplyDecoder {
    BinaryReplyDecoder::new(|_| Ok(Some(0)), |input, _| take_acknowledgement(input))
}

fn take_acknowledgement(input: &mut BytesMut) -> Ready<(), ProtocolError> {
    let Some(word) = input.first_chunk::<{ ACKNOWLEDGEMENT.len() }>() else {
        return Ok(None);
    };
    if word != ACKNOWLEDGEMENT {
        return Err(ProtocolError::Acknowledgement { got: word.to_vec() });
    }
    input.advance(word.len());
    Ok(Some(()))
}

/// Takes messages without an index.
#[derive(Debug)]
pub(crate) struct UnindexedMessageDecoder {
    wire_version: WireVersion,
    limits: Limits,
    /// Position up to which the end of a spelled command was searched.
    searched: usize,
    /// The message in progress, of which the command block has been read.
    begun: Option<Begun>,
}

#[derive(Debug)]
struct Begun {
    command: Command,
    scanner: Scanner,
    /// Bytes that the payload takes at the least.
    needs: usize,
}

impl UnindexedMessageDecoder {
    pub(crate) fn new(wire_version: WireVersion, limits: Limits) -> Self {
        Self {
            wire_version,
            limits,
            searched: 0,
            begun: None,
        }
    }

    /// Takes the next message from `input`, or `None` while bytes are missing.
    pub(crate) fn take(&mut self, input: &mut BytesMut) -> Ready<Message, ProtocolError> {
        let mut begun = match self.begun.take() {
            Some(begun) => begun,
            None => {
                let Some((command, block)) = Command::read_prefix(input, &mut self.searched)?
                else {
                    return Ok(None);
                };
                input.advance(block);
                if !command.has_payload() {
                    let payload = Payload::new(Bytes::new(), Form::Binary(self.wire_version));
                    return Ok(Some(Message { command, payload }));
                }
                Begun {
                    command,
                    scanner: Scanner::new(self.wire_version, self.limits),
                    needs: 0,
                }
            }
        };
        let scan = match begun.scanner.scan(input) {
            Ok(scan) => scan,
            Err(error) => {
                // Perhaps the writer is of the other wire version.
                let other = self.wire_version.other();
                let mut again = Scanner::new(other, self.limits);
                let scan = again.scan(input).map_err(|_| error)?;
                self.wire_version = other;
                begun.scanner = again;
                scan
            }
        };
        match scan {
            Scan::Complete { length } => {
                let bytes = input.split_to(length).freeze();
                let payload = Payload::new(bytes, Form::Binary(self.wire_version));
                let command = begun.command;
                Ok(Some(Message { command, payload }))
            }
            Scan::Needs { at_least } => {
                begun.needs = at_least;
                self.begun = Some(begun);
                Ok(None)
            }
        }
    }
}

impl MessageDecoder for UnindexedMessageDecoder {
    fn read(
        &mut self,
        input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Ready<Incoming, ProtocolError> {
        Ok(self.take(input)?.map(Incoming::Message))
    }

    fn missing(&self, input: &BytesMut) -> usize {
        let needs = self.begun.as_ref().map_or(0, |begun| begun.needs);
        needs.saturating_sub(input.len())
    }

    fn set_wire_version(&mut self, wire_version: WireVersion) {
        self.wire_version = wire_version;
    }
}
