//! Lines of text: a command line, then lines with a value.

use bytes::{Buf, BufMut, Bytes, BytesMut};

use super::binary_common::MAX_SENDER_LEN;
use super::{
    Handshake, HandshakeDecoder, Incoming, InitiatorState, LineReader, Message, MessageDecoder,
    PayloadKind, PendingReply, Progress, Protocol, ProtocolError, ReplyDecoder,
};
use crate::bottle::BracketBalance;
use crate::carrier::{Carrier, MAGIC, Sender};
use crate::message::{Command, Form, Payload};
use crate::message_limits::Limits;
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// Lines of text.
pub static TEXT_LINES: TextLines = TextLines;

/// See [`TEXT_LINES`].
#[derive(Debug)]
pub struct TextLines;

/// The acknowledgement of a text connection.
pub const ACKNOWLEDGEMENT_LINE: &str = "<ACK>";

impl Protocol for TextLines {
    fn payload_kind(&self) -> PayloadKind {
        PayloadKind::Text
    }

    fn put_header(&self, carrier: &Carrier, sender: &Sender, output: &mut BytesMut) {
        output.put_slice(&carrier.magic);
        output.put_slice(sender.to_string().as_bytes());
        output.put_slice(b"\r\n");
    }

    fn handshake_decoder(
        &self,
        _carrier: &'static Carrier,
        input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder> {
        input.advance(MAGIC);
        Box::new(TextHandshakeDecoder(LineReader::new(MAX_SENDER_LEN)))
    }

    fn message_decoder(
        &self,
        _wire_version: WireVersion,
        limits: Limits,
    ) -> Box<dyn MessageDecoder> {
        Box::new(TextMessageDecoder {
            line: LineReader::new(limits.line),
            begun: None,
            limit: limits.line,
        })
    }

    fn reply_decoder(&self, limits: Limits) -> Box<dyn ReplyDecoder> {
        Box::new(TextReplyDecoder::new(limits))
    }

    fn put_head(&self, command: &Command, _length: usize, output: &mut BytesMut) {
        command.put_line(output);
    }

    fn put_acknowledgement(&self, output: &mut BytesMut) {
        output.put_slice(ACKNOWLEDGEMENT_LINE.as_bytes());
        output.put_slice(b"\r\n");
    }

    fn replies_to_commands(&self) -> bool {
        true
    }

    fn put_lines(&self, lines: &str, output: &mut BytesMut) {
        output.put_slice(lines.as_bytes());
    }

    /// An initiator that expects acknowledgements notices the missing welcome.
    fn put_refusal(
        &self,
        carrier: &Carrier,
        reason: &dyn std::fmt::Display,
        output: &mut BytesMut,
    ) {
        if !carrier.acknowledges {
            let words = format!("* Error. {reason}\r\n* Goodbye.\r\n");
            output.put_slice(words.as_bytes());
        }
    }
}

#[derive(Debug)]
struct TextHandshakeDecoder(LineReader);

impl HandshakeDecoder for TextHandshakeDecoder {
    fn read(
        &mut self,
        _port: u16,
        _limits: Limits,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Handshake, ProtocolError> {
        let Some(name) = self.0.read(input)? else {
            return Ok(None);
        };
        let sender = Sender::parse(&name);
        output.put_slice(format!("Welcome {}\r\n", sender.name).as_bytes());
        Ok(Some(Handshake::by(sender)))
    }
}

/// A value that continues over further lines while a bracket or quote is open.
#[derive(Debug, Default)]
struct Text {
    bytes: BytesMut,
    balance: BracketBalance,
}

impl Text {
    /// Takes a line; gives the value that it completes.
    fn take(&mut self, line: Bytes, limit: usize) -> Ready<Bytes, ProtocolError> {
        if self.bytes.len() + line.len() > limit {
            return Err(ProtocolError::LineTooLong { limit });
        }
        if self.bytes.is_empty() {
            self.balance.extend(&line);
            // Most values are one line: it is no copy.
            if self.balance.is_balanced() {
                self.balance = BracketBalance::default();
                return Ok(Some(line));
            }
            self.bytes = line.into();
        } else {
            self.bytes.extend_from_slice(b"\n");
            self.bytes.extend_from_slice(&line);
            self.balance.extend(b"\n");
            self.balance.extend(&line);
        }
        if !self.balance.is_balanced() {
            return Ok(None);
        }
        self.balance = BracketBalance::default();
        Ok(Some(self.bytes.split().freeze()))
    }
}

/// Takes messages of lines.
#[derive(Debug)]
struct TextMessageDecoder {
    line: LineReader,
    /// The command line has been read; the lines of its text follow.
    begun: Option<(Command, Text)>,
    limit: usize,
}

impl TextMessageDecoder {
    fn take(&mut self, input: &mut BytesMut) -> Ready<Message, ProtocolError> {
        while let Some(line) = self.line.read(input)? {
            match self.begun.take() {
                Some((command, mut text)) => match text.take(line, self.limit)? {
                    Some(text) => return Ok(Some(message(command, text))),
                    None => self.begun = Some((command, text)),
                },
                None => {
                    let command = Command::parse(&line);
                    if !command.has_payload() {
                        return Ok(Some(message(command, Bytes::new())));
                    }
                    self.begun = Some((command, Text::default()));
                }
            }
        }
        Ok(None)
    }
}

impl MessageDecoder for TextMessageDecoder {
    fn read(
        &mut self,
        input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Ready<Incoming, ProtocolError> {
        Ok(self.take(input)?.map(Incoming::Message))
    }
}

fn message(command: Command, text: Bytes) -> Message {
    let payload = Payload::new(text, Form::Text);
    Message { command, payload }
}

/// Takes answers of lines.
#[derive(Debug)]
pub(crate) struct TextReplyDecoder {
    line: LineReader,
    welcomed: bool,
    text: Text,
    lines: Vec<String>,
    /// Bytes held by these lines.
    held: usize,
    /// An acknowledgement arrived in place of a reply: the acceptor had no reply.
    acknowledged_early: bool,
}

impl TextReplyDecoder {
    pub(crate) fn new(limits: Limits) -> Self {
        Self {
            line: LineReader::new(limits.line),
            welcomed: false,
            text: Text::default(),
            lines: Vec::new(),
            held: 0,
            acknowledged_early: false,
        }
    }

    /// Creates a decoder for an acceptor without welcome line.
    pub(crate) fn without_welcome(limits: Limits) -> Self {
        let welcomed = true;
        Self {
            welcomed,
            ..Self::new(limits)
        }
    }

    /// Keeps a line of many.
    fn keep(&mut self, line: &Bytes, limit: usize) -> Result<(), ProtocolError> {
        self.held += size_of::<String>() + line.len();
        if self.held > limit {
            return Err(ProtocolError::LineTooLong { limit });
        }
        self.lines.push(String::from_utf8_lossy(line).into_owned());
        Ok(())
    }

    /// Processes a line for the given pending reply.
    fn take(
        &mut self,
        waiting: PendingReply,
        acknowledges: bool,
        limit: usize,
        line: Bytes,
    ) -> Ready<Progress, ProtocolError> {
        Ok(match waiting {
            PendingReply::Acknowledgement => Some(Progress::Done),
            PendingReply::Lines if line == ACKNOWLEDGEMENT_LINE => {
                self.held = 0;
                Some(Progress::Lines(std::mem::take(&mut self.lines)))
            }
            PendingReply::Lines => {
                self.keep(&line, limit)?;
                None
            }
            PendingReply::Reply
                if acknowledges && self.text.bytes.is_empty() && line == ACKNOWLEDGEMENT_LINE =>
            {
                self.acknowledged_early = true;
                let nothing = Payload::new(Bytes::new(), Form::Text);
                Some(Progress::Reply(nothing))
            }
            PendingReply::Reply => {
                let text = self.text.take(line, limit)?;
                text.map(|text| Progress::Reply(Payload::new(text, Form::Text)))
            }
        })
    }
}

impl ReplyDecoder for TextReplyDecoder {
    /// Only an initiator that expects acknowledgements waits for the welcome.
    fn read_header(
        &mut self,
        initiator_state: &InitiatorState,
        input: &mut BytesMut,
    ) -> Ready<i32, ProtocolError> {
        if initiator_state.carrier.acknowledges && !self.welcomed {
            if self.line.read(input)?.is_none() {
                return Ok(None);
            }
            self.welcomed = true;
        }
        Ok(Some(0))
    }

    fn skip_header(&mut self) {
        self.welcomed = true;
    }

    fn read(
        &mut self,
        initiator_state: &mut InitiatorState,
        input: &mut BytesMut,
    ) -> Ready<Progress, ProtocolError> {
        if std::mem::take(&mut self.acknowledged_early) {
            initiator_state.waiting.pop_front();
            return Ok(Some(Progress::Done));
        }
        while let Some(line) = self.line.read(input)? {
            if !self.welcomed {
                self.welcomed = true;
                continue;
            }
            // Stock text initiators ignore unrequested lines.
            let Some(waiting) = initiator_state.waiting.front() else {
                continue;
            };
            let (acknowledges, limit) = (
                initiator_state.carrier.acknowledges,
                initiator_state.limits.line,
            );
            if let Some(progress) = self.take(*waiting, acknowledges, limit, line)? {
                initiator_state.waiting.pop_front();
                return Ok(Some(progress));
            }
        }
        Ok(None)
    }
}
