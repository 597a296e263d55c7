//! Lines of text: a command line, then lines with a value.

use bytes::{Buf, BufMut, Bytes, BytesMut};

use super::binary::LONGEST_SENDER;
use super::{
    Answers, Asked, Incoming, LineReader, Message, Messages, Opened, Opening, Payloads, Progress,
    Protocol, ProtocolError, Waiting,
};
use crate::bottle::Balance;
use crate::carrier::{Carrier, MAGIC, Sender};
use crate::dialect::Dialect;
use crate::limits::Limits;
use crate::message::{Command, Form, Payload};

/// Lines of text.
pub static LINES: Lines = Lines;

/// See [`LINES`].
#[derive(Debug)]
pub struct Lines;

/// The acknowledgement of a text connection.
pub const ACKNOWLEDGEMENT_LINE: &str = "<ACK>";

impl Protocol for Lines {
    fn payloads(&self) -> Payloads {
        Payloads::Text
    }

    fn put_header(&self, carrier: &Carrier, sender: &Sender, output: &mut BytesMut) {
        output.put_slice(&carrier.magic);
        output.put_slice(sender.to_string().as_bytes());
        output.put_slice(b"\r\n");
    }

    fn opening(&self, _carrier: &'static Carrier, input: &mut BytesMut) -> Box<dyn Opening> {
        input.advance(MAGIC);
        Box::new(LineOpening(LineReader::new(LONGEST_SENDER)))
    }

    fn messages(&self, _dialect: Dialect, limits: Limits) -> Box<dyn Messages> {
        Box::new(LineMessages {
            line: LineReader::new(limits.line),
            begun: None,
            limit: limits.line,
        })
    }

    fn answers(&self, limits: Limits) -> Box<dyn Answers> {
        Box::new(LineAnswers::new(limits))
    }

    fn put_head(&self, command: &Command, _length: usize, output: &mut BytesMut) {
        command.put_line(output);
    }

    fn put_acknowledgement(&self, output: &mut BytesMut) {
        output.put_slice(ACKNOWLEDGEMENT_LINE.as_bytes());
        output.put_slice(b"\r\n");
    }

    fn answers_commands(&self) -> bool {
        true
    }

    fn put_lines(&self, lines: &str, output: &mut BytesMut) {
        output.put_slice(lines.as_bytes());
    }

    /// Who waits for acknowledgements notices that there is no welcome.
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
struct LineOpening(LineReader);

impl Opening for LineOpening {
    fn read(
        &mut self,
        _port: u16,
        _limits: Limits,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Result<Option<Opened>, ProtocolError> {
        let Some(name) = self.0.read(input)? else {
            return Ok(None);
        };
        let sender = Sender::parse(&name);
        output.put_slice(format!("Welcome {}\r\n", sender.name).as_bytes());
        Ok(Some(Opened::by(sender)))
    }
}

/// A value that goes on over further lines while a bracket or quote is open.
#[derive(Debug, Default)]
struct Text {
    bytes: BytesMut,
    balance: Balance,
}

impl Text {
    /// Takes a line; gives the value that it completes.
    fn take(&mut self, line: Bytes, limit: usize) -> Result<Option<Bytes>, ProtocolError> {
        if self.bytes.len() + line.len() > limit {
            return Err(ProtocolError::LineTooLong { limit });
        }
        if self.bytes.is_empty() {
            self.balance.extend(&line);
            // Most values are one line: it is no copy.
            if self.balance.is_even() {
                self.balance = Balance::default();
                return Ok(Some(line));
            }
            self.bytes = line.into();
        } else {
            self.bytes.extend_from_slice(b"\n");
            self.bytes.extend_from_slice(&line);
            self.balance.extend(b"\n");
            self.balance.extend(&line);
        }
        if !self.balance.is_even() {
            return Ok(None);
        }
        self.balance = Balance::default();
        Ok(Some(self.bytes.split().freeze()))
    }
}

/// Takes messages of lines.
#[derive(Debug)]
struct LineMessages {
    line: LineReader,
    /// The command line has been read; the lines of its text follow.
    begun: Option<(Command, Text)>,
    limit: usize,
}

impl LineMessages {
    fn take(&mut self, input: &mut BytesMut) -> Result<Option<Message>, ProtocolError> {
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

impl Messages for LineMessages {
    fn read(
        &mut self,
        input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Result<Option<Incoming>, ProtocolError> {
        Ok(self.take(input)?.map(Incoming::Message))
    }
}

fn message(command: Command, text: Bytes) -> Message {
    let payload = Payload::new(text, Form::Text);
    Message { command, payload }
}

/// Takes answers of lines.
#[derive(Debug)]
pub(crate) struct LineAnswers {
    line: LineReader,
    welcomed: bool,
    text: Text,
    lines: Vec<String>,
    /// What these take.
    held: usize,
    /// An acknowledgement came where a reply was due: the acceptor had none to give.
    acknowledged_early: bool,
}

impl LineAnswers {
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

    /// Answers of an acceptor that welcomes nobody.
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

    /// What a line completes for who waits for this.
    fn take(
        &mut self,
        waiting: Waiting,
        acknowledges: bool,
        limit: usize,
        line: Bytes,
    ) -> Result<Option<Progress>, ProtocolError> {
        Ok(match waiting {
            Waiting::Acknowledgement => Some(Progress::Done),
            Waiting::Lines if line == ACKNOWLEDGEMENT_LINE => {
                self.held = 0;
                Some(Progress::Lines(std::mem::take(&mut self.lines)))
            }
            Waiting::Lines => {
                self.keep(&line, limit)?;
                None
            }
            Waiting::Reply
                if acknowledges && self.text.bytes.is_empty() && line == ACKNOWLEDGEMENT_LINE =>
            {
                self.acknowledged_early = true;
                let nothing = Payload::new(Bytes::new(), Form::Text);
                Some(Progress::Reply(nothing))
            }
            Waiting::Reply => {
                let text = self.text.take(line, limit)?;
                text.map(|text| Progress::Reply(Payload::new(text, Form::Text)))
            }
        })
    }
}

impl Answers for LineAnswers {
    /// Only who waits for acknowledgements waits for the welcome.
    fn read_header(
        &mut self,
        asked: &Asked,
        input: &mut BytesMut,
    ) -> Result<Option<i32>, ProtocolError> {
        if asked.carrier.acknowledges && !self.welcomed {
            if self.line.read(input)?.is_none() {
                return Ok(None);
            }
            self.welcomed = true;
        }
        Ok(Some(0))
    }

    fn pass_header(&mut self) {
        self.welcomed = true;
    }

    fn read(
        &mut self,
        asked: &mut Asked,
        input: &mut BytesMut,
    ) -> Result<Option<Progress>, ProtocolError> {
        if std::mem::take(&mut self.acknowledged_early) {
            asked.waiting.pop_front();
            return Ok(Some(Progress::Done));
        }
        while let Some(line) = self.line.read(input)? {
            if !self.welcomed {
                self.welcomed = true;
                continue;
            }
            // Stock text initiators ignore what they did not ask for.
            let Some(waiting) = asked.waiting.front() else {
                continue;
            };
            let (acknowledges, limit) = (asked.carrier.acknowledges, asked.limits.line);
            if let Some(progress) = self.take(*waiting, acknowledges, limit, line)? {
                asked.waiting.pop_front();
                return Ok(Some(progress));
            }
        }
        Ok(None)
    }
}
