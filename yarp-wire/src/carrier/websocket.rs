//! `websocket`: binary messages without an index, in the frames of RFC 6455; for pages.

use bytes::{BufMut, Bytes, BytesMut};

use super::{Carrier, Sender, Transport};
use crate::dialect::Dialect;
use crate::http::RequestReader;
use crate::limits::Limits;
use crate::message::{Command, Form, Payload, WireObject};
use crate::protocol::{
    Answers, Asked, BARE, BareMessages, Incoming, Message, Messages, Opened, Opening, Payloads,
    Progress, Protocol, ProtocolError,
};
use crate::websocket::{self, FrameReader, WebSocketError, put_close, put_frame_head};

/// `GET /?ws` and whatever follows; only browsers begin such a connection.
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
    fn payloads(&self) -> Payloads {
        BARE.payloads()
    }

    fn put_header(&self, carrier: &Carrier, _sender: &Sender, output: &mut BytesMut) {
        output.put_slice(&carrier.magic);
    }

    /// The magic is the beginning of the request.
    fn opening(&self, _carrier: &'static Carrier, _input: &mut BytesMut) -> Box<dyn Opening> {
        Box::new(Upgrade(RequestReader::default()))
    }

    fn messages(&self, dialect: Dialect, limits: Limits) -> Box<dyn Messages> {
        Box::new(FramedMessages {
            frames: FrameReader::new(limits.message),
            messages: BareMessages::new(dialect, limits),
            over: false,
        })
    }

    fn answers(&self, limits: Limits) -> Box<dyn Answers> {
        Box::new(FramedAnswers::new(FrameReader::new(limits.message), limits))
    }

    /// As stock: the block is a frame, the payload another.
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

    fn put_reply(&self, object: &dyn WireObject, dialect: Dialect, output: &mut BytesMut) {
        let mut reply = BytesMut::new();
        self.put_object(object, dialect, &mut reply);
        put_frame_head(output, reply.len());
        output.put_slice(&reply);
    }

    fn answers_goodbye(&self) -> bool {
        true
    }
}

/// A request that asks to go on in frames.
#[derive(Debug)]
struct Upgrade(RequestReader);

impl Opening for Upgrade {
    fn read(
        &mut self,
        _port: u16,
        limits: Limits,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Result<Option<Opened>, ProtocolError> {
        let Some(request) = self.0.read(input, limits)? else {
            return Ok(None);
        };
        output.put_slice(websocket::response(&request)?.as_bytes());
        Ok(Some(Opened::by(Sender::plain("web"))))
    }
}

/// Takes messages in frames. Bytes that are missing are not told of: those of a message are no
/// longer in the input, and a ping between two of its frames is answered at once.
#[derive(Debug)]
struct FramedMessages {
    frames: FrameReader,
    messages: BareMessages,
    /// The page has said goodbye.
    over: bool,
}

impl FramedMessages {
    /// The next message. A close frame is the command to quit, and answers it.
    fn take(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Result<Option<Message>, ProtocolError> {
        loop {
            // What came before is used before what is behind it: it may be broken.
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
            if !self.frames.step(input, output)? {
                return Ok(None);
            }
        }
    }
}

impl Messages for FramedMessages {
    fn read(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Result<Option<Incoming>, ProtocolError> {
        if self.over {
            return Ok(None);
        }
        let message = self.take(input, output)?;
        let quits = |message: &Message| message.command == Command::Quit;
        self.over = message.as_ref().is_some_and(quits);
        Ok(message.map(Incoming::Message))
    }

    fn set_dialect(&mut self, dialect: Dialect) {
        self.messages.set_dialect(dialect);
    }

    /// Frames that have begun go on.
    fn reversed(self: Box<Self>, limits: Limits) -> Option<Box<dyn Answers>> {
        Some(Box::new(FramedAnswers::new(self.frames, limits)))
    }
}

/// Takes answers in frames.
#[derive(Debug)]
struct FramedAnswers {
    frames: FrameReader,
    answers: Box<dyn Answers>,
    said: BytesMut,
}

impl FramedAnswers {
    fn new(frames: FrameReader, limits: Limits) -> Self {
        Self {
            frames,
            answers: BARE.answers(limits),
            said: BytesMut::new(),
        }
    }
}

impl Answers for FramedAnswers {
    fn read(
        &mut self,
        asked: &mut Asked,
        input: &mut BytesMut,
    ) -> Result<Option<Progress>, ProtocolError> {
        loop {
            let progress = self.answers.read(asked, &mut self.frames.stream)?;
            if progress.is_none() && self.frames.is_closed() {
                return Err(WebSocketError::Closed.into());
            }
            if progress.is_some() || !self.frames.step(input, &mut self.said)? {
                return Ok(progress);
            }
        }
    }

    fn said(&mut self) -> BytesMut {
        self.said.split()
    }
}
