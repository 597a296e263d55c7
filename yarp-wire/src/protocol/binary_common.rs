//! Common parts of protocols with binary payloads: header, replies, acknowledgements.

use bytes::{Buf, BufMut, Bytes, BytesMut};

use super::{
    Handshake, HandshakeDecoder, InitiatorState, PendingReply, Progress, ProtocolError,
    ReplyDecoder,
};
use crate::bottle::{DecodeError, Scan, Scanner};
use crate::carrier::{Carrier, MAGIC, Sender};
use crate::framed_number;
use crate::message::{Form, Payload};
use crate::message_limits::Limits;
use crate::ready::Ready;

/// Longest sender name, modifiers included. Stock reads 1000.
pub(super) const MAX_SENDER_LEN: usize = 4096;

/// Appends magic, length of the sender's name, and name.
pub(crate) fn put_binary_header(carrier: &Carrier, sender: &Sender, output: &mut BytesMut) {
    output.put_slice(&carrier.magic);
    let name = sender.to_string();
    output.put_i32_le(name.len() as i32 + 1);
    output.put_slice(name.as_bytes());
    output.put_u8(0);
}

/// Takes what [`put_binary_header`] appends.
#[derive(Debug)]
pub(crate) struct BinaryHandshakeDecoder {
    /// Appends the header reply, if there is one.
    answer: fn(port: u16, output: &mut BytesMut),
}

impl BinaryHandshakeDecoder {
    /// Passes the magic over.
    pub(super) fn new(input: &mut BytesMut, answer: fn(u16, &mut BytesMut)) -> Self {
        input.advance(MAGIC);
        Self { answer }
    }

    /// Takes the sender; `None` while bytes are missing.
    pub(crate) fn sender(input: &mut BytesMut) -> Ready<Sender, ProtocolError> {
        let Some(length) = input.first_chunk::<4>() else {
            return Ok(None);
        };
        let length = i32::from_le_bytes(*length);
        let bytes = usize::try_from(length)
            .ok()
            .filter(|bytes| (1..=MAX_SENDER_LEN).contains(bytes))
            .ok_or(ProtocolError::SenderLength {
                length,
                limit: MAX_SENDER_LEN,
            })?;
        if input.len() < 4 + bytes {
            return Ok(None);
        }
        input.advance(4);
        let name = input.split_to(bytes);
        let end = name.iter().position(|b| *b == 0).unwrap_or(name.len());
        Ok(Some(Sender::parse(&name[..end])))
    }
}

impl HandshakeDecoder for BinaryHandshakeDecoder {
    fn read(
        &mut self,
        port: u16,
        _limits: Limits,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Handshake, ProtocolError> {
        let Some(sender) = Self::sender(input)? else {
            return Ok(None);
        };
        (self.answer)(port, output);
        Ok(Some(Handshake::by(sender)))
    }
}

/// Takes the answer to a header.
type ReadHeader = fn(&mut BytesMut) -> Ready<i32, ProtocolError>;
/// Takes an acknowledgement.
type ReadAcknowledgement = fn(&mut BytesMut, Limits) -> Ready<(), ProtocolError>;

/// Decodes binary replies; the header reply and acknowledgements depend on the protocol.
#[derive(Debug)]
pub(crate) struct BinaryReplyDecoder {
    header: ReadHeader,
    acknowledgement: ReadAcknowledgement,
    scanner: Option<Scanner>,
}

impl BinaryReplyDecoder {
    pub(crate) fn new(header: ReadHeader, acknowledgement: ReadAcknowledgement) -> Self {
        Self {
            header,
            acknowledgement,
            scanner: None,
        }
    }

    /// Decodes a reply. It has no length prefix: its own structure determines its end.
    fn reply(
        &mut self,
        initiator_state: &mut InitiatorState,
        input: &mut BytesMut,
    ) -> Ready<Payload, ProtocolError> {
        if initiator_state.carrier.acknowledges {
            // Stock acceptors whose owner gives no reply only acknowledge. No bottle starts so.
            match input.first_chunk::<{ framed_number::LEN }>() {
                Some(head) if framed_number::decode(head).is_some() => {
                    return Ok(Some(Payload::new(Bytes::new(), Form::Text)));
                }
                None if input.first().is_none_or(|byte| *byte == b'Y') => return Ok(None),
                _ => {}
            }
        }
        let length = match is_version_struct(input) {
            true if input.len() < VERSION_STRUCT => return Ok(None),
            true => VERSION_STRUCT,
            false => match self.scan(initiator_state, input)? {
                Some(length) => length,
                None => return Ok(None),
            },
        };
        self.scanner = None;
        let bytes = input.split_to(length).freeze();
        Ok(Some(Payload::new(
            bytes,
            Form::Binary(initiator_state.wire_version),
        )))
    }

    /// The length of the reply, once it is whole.
    fn scan(
        &mut self,
        initiator_state: &mut InitiatorState,
        input: &BytesMut,
    ) -> Ready<usize, ProtocolError> {
        let scanner = self.scanner.get_or_insert_with(|| {
            Scanner::new(initiator_state.wire_version, initiator_state.limits)
        });
        let scan = match scanner.scan(input) {
            Ok(scan) => scan,
            Err(error @ DecodeError::UnknownCode { wire_version, .. })
                if wire_version == initiator_state.wire_version =>
            {
                // Perhaps the acceptor is of the other wire version after all.
                let mut other = Scanner::new(wire_version.other(), initiator_state.limits);
                let Ok(scan) = other.scan(input) else {
                    return Err(error.into());
                };
                initiator_state.wire_version = wire_version.other();
                self.scanner = Some(other);
                scan
            }
            Err(error) => return Err(error.into()),
        };
        Ok(match scan {
            Scan::Complete { length } => Some(length),
            Scan::Needs { .. } => None,
        })
    }
}

impl ReplyDecoder for BinaryReplyDecoder {
    fn read_header(
        &mut self,
        _asked: &InitiatorState,
        input: &mut BytesMut,
    ) -> Ready<i32, ProtocolError> {
        (self.header)(input)
    }

    fn read(
        &mut self,
        initiator_state: &mut InitiatorState,
        input: &mut BytesMut,
    ) -> Ready<Progress, ProtocolError> {
        let progress = match initiator_state.waiting.front() {
            None => match input.len() {
                0 => return Ok(None),
                // An acceptor that closes while it waits for a message sends one more
                // acknowledgement first.
                count if initiator_state.carrier.acknowledges && count <= framed_number::LEN => {
                    return Ok(None);
                }
                count => return Err(ProtocolError::Unexpected { count }),
            },
            Some(PendingReply::Acknowledgement) => {
                (self.acknowledgement)(input, initiator_state.limits)?.map(|()| Progress::Done)
            }
            Some(PendingReply::Reply | PendingReply::Lines) => {
                self.reply(initiator_state, input)?.map(Progress::Reply)
            }
        };
        if progress.is_some() {
            initiator_state.waiting.pop_front();
        }
        Ok(progress)
    }
}

/// The bytes of the answer to `getRemoteProtocolVersion`: a list head and four bare int16.
const VERSION_STRUCT: usize = 16;

/// Returns whether a reply begins like the version of a 4.0 service, the only reply that is not a
/// bottle.
///
/// The head of a list of one is followed by protocol and major version, instead of a code below
/// 1024. Source: bytes written by 4.0.0.
fn is_version_struct(input: &[u8]) -> bool {
    let Some((head, [_, _, major @ ..])) = input.first_chunk::<12>().map(|head| head.split_at(8))
    else {
        return false;
    };
    head == [0, 1, 0, 0, 1, 0, 0, 0] && *major != [0, 0]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Regression: a call to a stock port that only reads closed the connection, because its
    /// acknowledgement, in place of a reply, was read as an invalid bottle.
    #[test]
    fn the_version_of_a_service_is_a_reply() {
        // Recorded from a 4.0.0 control board, with the acknowledgement behind it.
        let recorded =
            b"\x00\x01\x00\x00\x01\x00\x00\x00\x00\x00\x04\x00\x00\x00\x00\x00YA\0\0\0\0RP";
        assert!((0..12).all(|end| !is_version_struct(&recorded[..end])));
        assert!(is_version_struct(recorded));
        // A list of one integer, and one of a nested list.
        assert!(!is_version_struct(
            b"\x00\x01\x00\x00\x01\x00\x00\x00\x01\x00\x00\x00\x07\x00\x00\x00"
        ));
        assert!(!is_version_struct(
            b"\x00\x01\x00\x00\x01\x00\x00\x00\x00\x01\x00\x00\x00\x00\x00\x00"
        ));
    }
}
