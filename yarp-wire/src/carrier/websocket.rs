//! `websocket`: binary messages without an index, in the frames of RFC 6455; for pages.

use bytes::{BufMut, Bytes, BytesMut};

use super::{Carrier, Sender, Transport};
use crate::http::{RequestReader, Service};
use crate::message::{Command, Form, Payload, WireObject};
use crate::message_limits::Limits;
use crate::protocol::{
    Handshake, HandshakeDecoder, Incoming, InitiatorState, Message, MessageDecoder, PayloadKind,
    Progress, Protocol, ProtocolError, ReplyDecoder, UNINDEXED, UnindexedMessageDecoder,
};
use crate::ready::Ready;
use crate::websocket::{self, FrameReader, WebSocketError, put_close, put_frame_head};
use crate::wire_version::WireVersion;

/// A request that begins `GET /?ws`; only browsers initiate such a connection.
pub(super) static WEBSOCKET: Carrier = Carrier {
    name: "websocket",
    magic: *b"GET /?ws",
    recognises: |magic| magic == b"GET /?ws",
    protocol: &Websocket,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: true,
    initiates: false,
};

/// Messages without an index in frames.
#[derive(Debug)]
struct Websocket;

impl Protocol for Websocket {
    fn payload_kind(&self) -> PayloadKind {
        UNINDEXED.payload_kind()
    }

    fn service(&self) -> Option<Service> {
        Some(Service::Frames)
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
        Box::new(UpgradeDecoder(RequestReader::default()))
    }

    fn message_decoder(
        &self,
        wire_version: WireVersion,
        limits: Limits,
    ) -> Box<dyn MessageDecoder> {
        Box::new(FramedMessageDecoder {
            frames: FrameReader::new(limits.message),
            messages: UnindexedMessageDecoder::new(wire_version, limits),
            over: false,
        })
    }

    fn reply_decoder(&self, limits: Limits) -> Box<dyn ReplyDecoder> {
        Box::new(FramedReplyDecoder::new(
            FrameReader::new(limits.message),
            limits,
        ))
    }

    /// Appends the head as stock does: the command block is one frame, the payload another.
    fn put_head(&self, command: &Command, length: usize, output: &mut BytesMut) {
        put_frame_head(output, command.block_len());
        command.put_block(output);
        if length > 0 {
            put_frame_head(output, length);
        }
        if *command == Command::Quit {
            put_close(output);
        }
    }

    fn put_reply(&self, object: &dyn WireObject, wire_version: WireVersion, output: &mut BytesMut) {
        let mut reply = BytesMut::new();
        self.put_object(object, wire_version, &mut reply);
        put_frame_head(output, reply.len());
        output.put_slice(&reply);
    }

    fn frames_replies(&self) -> bool {
        true
    }

    fn replies_to_close(&self) -> bool {
        true
    }
}

/// Decodes the HTTP request for an upgrade to WebSocket.
#[derive(Debug)]
struct UpgradeDecoder(RequestReader);

impl HandshakeDecoder for UpgradeDecoder {
    fn read(
        &mut self,
        _port: u16,
        limits: Limits,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Handshake, ProtocolError> {
        let Some(request) = self.0.read(input, limits)? else {
            return Ok(None);
        };
        output.put_slice(websocket::response(&request)?.as_bytes());
        Ok(Some(Handshake::by(Sender::plain("web"))))
    }
}

/// Decodes messages from frames. Reports no number of missing bytes: the bytes of a message are no
/// longer in the input, and a ping between two of its frames is answered at once.
#[derive(Debug)]
struct FramedMessageDecoder {
    frames: FrameReader,
    messages: UnindexedMessageDecoder,
    /// A close frame was received.
    over: bool,
}

impl FramedMessageDecoder {
    /// The next message. A close frame is the command to quit, and answers it.
    fn take(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Message, ProtocolError> {
        loop {
            // Bytes of earlier frames are used before later frames are parsed, which may be
            // invalid.
            if let Some(message) = self.messages.take(&mut self.frames.stream)? {
                if message.command == Command::Quit && !self.frames.is_closed() {
                    put_close(output);
                }
                return Ok(Some(message));
            }
            if self.frames.is_closed() {
                let payload = Payload::new(Bytes::new(), Form::Text);
                let command = Command::Quit;
                return Ok(Some(Message { command, payload }));
            }
            if self.frames.step(input, output)?.is_none() {
                return Ok(None);
            }
        }
    }
}

impl MessageDecoder for FramedMessageDecoder {
    fn read(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Incoming, ProtocolError> {
        if self.over {
            return Ok(None);
        }
        let message = self.take(input, output)?;
        let quits = |message: &Message| message.command == Command::Quit;
        self.over = message.as_ref().is_some_and(quits);
        Ok(message.map(Incoming::Message))
    }

    fn set_wire_version(&mut self, wire_version: WireVersion) {
        self.messages.set_wire_version(wire_version);
    }

    /// Creates the decoder from frames already begun.
    fn into_reply_decoder(self: Box<Self>, limits: Limits) -> Option<Box<dyn ReplyDecoder>> {
        Some(Box::new(FramedReplyDecoder::new(self.frames, limits)))
    }
}

/// Takes answers in frames.
#[derive(Debug)]
struct FramedReplyDecoder {
    frames: FrameReader,
    answers: Box<dyn ReplyDecoder>,
    said: BytesMut,
}

impl FramedReplyDecoder {
    fn new(frames: FrameReader, limits: Limits) -> Self {
        Self {
            frames,
            answers: UNINDEXED.reply_decoder(limits),
            said: BytesMut::new(),
        }
    }
}

impl ReplyDecoder for FramedReplyDecoder {
    fn read(
        &mut self,
        initiator_state: &mut InitiatorState,
        input: &mut BytesMut,
    ) -> Ready<Progress, ProtocolError> {
        loop {
            let progress = self
                .answers
                .read(initiator_state, &mut self.frames.stream)?;
            if progress.is_none() && self.frames.is_closed() {
                return Err(WebSocketError::Closed.into());
            }
            if progress.is_some() || self.frames.step(input, &mut self.said)?.is_none() {
                return Ok(progress);
            }
        }
    }

    fn take_output(&mut self) -> BytesMut {
        self.said.split()
    }
}
