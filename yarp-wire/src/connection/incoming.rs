//! Messages out of a stream.

use bytes::{Buf, Bytes, BytesMut};

use super::ProtocolError;
use super::line::LineReader;
use crate::bottle::{Balance, Scan, Scanner};
use crate::carrier::Framing;
use crate::dialect::Dialect;
use crate::limits::Limits;
use crate::message::{Command, Form, Index, Payload};

/// One message of a connection.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// What it asks for.
    pub command: Command,
    /// The content of a data or admin message; empty for other commands.
    pub payload: Payload,
}

/// Takes messages from a stream of one framing.
#[derive(Debug)]
pub struct MessageReader {
    framing: Framing,
    dialect: Dialect,
    limits: Limits,
    state: State,
    line: LineReader,
}

#[derive(Debug)]
enum State {
    /// Before a message.
    Start,
    /// Index read; that many bytes of message follow.
    Indexed { total: usize },
    /// Command block read; the payload follows.
    Bare {
        command: Command,
        scanner: Scanner,
        /// Bytes that the payload takes at the least.
        needs: usize,
    },
    /// Command line read; the lines of its text follow.
    Text {
        command: Command,
        text: BytesMut,
        balance: Balance,
    },
    /// That many bytes to pass over before a line.
    Skip { left: usize },
}

/// `NAME_SERVER `, of which the magic was the first eight letters.
const NAME_SERVER: usize = "NAME_SERVER ".len();

impl MessageReader {
    /// A reader that stands before the first message.
    pub fn new(framing: Framing, dialect: Dialect, limits: Limits) -> Self {
        let state = match framing {
            Framing::NameService => State::Skip {
                left: NAME_SERVER - crate::carrier::MAGIC,
            },
            _ => State::Start,
        };
        Self {
            framing,
            dialect,
            limits,
            state,
            line: LineReader::new(limits.line),
        }
    }

    /// The generation that payloads are taken to be of.
    pub fn set_dialect(&mut self, dialect: Dialect) {
        self.dialect = dialect;
    }

    /// Takes the next message from `input`, or `None` while bytes are missing.
    pub fn read(&mut self, input: &mut BytesMut) -> Result<Option<Message>, ProtocolError> {
        match self.framing {
            Framing::Indexed => self.read_indexed(input),
            Framing::Bare => self.read_bare(input),
            Framing::Lines => self.read_lines(input),
            Framing::NameService => self.read_name_service(input),
            // Browsers send requests, which an acceptor reads itself.
            Framing::Http | Framing::Pictures => Ok(None),
        }
    }

    /// Bytes that the message in progress still needs, as far as it has said.
    pub fn missing(&self, input: &BytesMut) -> usize {
        match self.state {
            State::Indexed { total: needs } | State::Bare { needs, .. } => {
                needs.saturating_sub(input.len())
            }
            _ => 0,
        }
    }

    fn read_indexed(&mut self, input: &mut BytesMut) -> Result<Option<Message>, ProtocolError> {
        let total = match self.state {
            State::Indexed { total } => total,
            _ => match Index::read(input, self.limits.message)? {
                Some((index, length)) => {
                    input.advance(length);
                    index.total
                }
                None => return Ok(None),
            },
        };
        let is_whole = input.len() >= total;
        // Most messages are there as a whole when their index is read: they leave no trace.
        if !is_whole || matches!(self.state, State::Indexed { .. }) {
            self.state = match is_whole {
                true => State::Start,
                false => State::Indexed { total },
            };
        }
        if !is_whole {
            return Ok(None);
        }
        let mut bytes = input.split_to(total).freeze();
        let (command, block) = Command::read(&bytes)?;
        bytes.advance(block);
        if !command.has_payload() {
            bytes.clear();
        }
        let payload = Payload::new(bytes, Form::Binary(self.dialect));
        Ok(Some(Message { command, payload }))
    }

    fn read_bare(&mut self, input: &mut BytesMut) -> Result<Option<Message>, ProtocolError> {
        if matches!(self.state, State::Start) {
            let Some((command, block)) = Command::read_prefix(input, self.limits.line)? else {
                return Ok(None);
            };
            input.advance(block);
            if !command.has_payload() {
                let payload = Payload::new(Bytes::new(), Form::Binary(self.dialect));
                return Ok(Some(Message { command, payload }));
            }
            let scanner = Scanner::new(self.dialect, self.limits);
            self.state = State::Bare {
                command,
                scanner,
                needs: 0,
            };
        }
        let State::Bare { scanner, needs, .. } = &mut self.state else {
            return Ok(None);
        };
        let scan = match scanner.scan(input) {
            Ok(scan) => scan,
            Err(error) => {
                // Perhaps the writer is of the other generation.
                let other = self.dialect.other();
                let mut again = Scanner::new(other, self.limits);
                let scan = again.scan(input).map_err(|_| error)?;
                self.dialect = other;
                *scanner = again;
                scan
            }
        };
        let length = match scan {
            Scan::Complete { length } => length,
            Scan::Needs { at_least } => {
                *needs = at_least;
                return Ok(None);
            }
        };
        let State::Bare { command, .. } = std::mem::replace(&mut self.state, State::Start) else {
            return Ok(None);
        };
        let bytes = input.split_to(length).freeze();
        let payload = Payload::new(bytes, Form::Binary(self.dialect));
        Ok(Some(Message { command, payload }))
    }

    fn read_lines(&mut self, input: &mut BytesMut) -> Result<Option<Message>, ProtocolError> {
        while let Some(line) = self.line.read(input)? {
            match std::mem::replace(&mut self.state, State::Start) {
                State::Text {
                    command,
                    mut text,
                    mut balance,
                } => {
                    if text.len() + line.len() > self.limits.line {
                        let limit = self.limits.line;
                        return Err(ProtocolError::LineTooLong { limit });
                    }
                    if text.is_empty() {
                        balance.extend(&line);
                        // Most texts are one line: it is no copy.
                        if balance.is_even() {
                            return Ok(Some(message(command, line)));
                        }
                        text = line.into();
                    } else {
                        text.extend_from_slice(b"\n");
                        text.extend_from_slice(&line);
                        balance.extend(b"\n");
                        balance.extend(&line);
                    }
                    if balance.is_even() {
                        return Ok(Some(message(command, text.freeze())));
                    }
                    self.state = State::Text {
                        command,
                        text,
                        balance,
                    };
                }
                _ => {
                    let command = Command::parse(&line);
                    if !command.has_payload() {
                        return Ok(Some(message(command, Bytes::new())));
                    }
                    self.state = State::Text {
                        command,
                        text: BytesMut::new(),
                        balance: Balance::default(),
                    };
                }
            }
        }
        Ok(None)
    }

    fn read_name_service(
        &mut self,
        input: &mut BytesMut,
    ) -> Result<Option<Message>, ProtocolError> {
        if let State::Skip { left } = &mut self.state {
            let skipped = input.len().min(*left);
            input.advance(skipped);
            *left -= skipped;
            if *left > 0 {
                return Ok(None);
            }
        }
        self.state = State::Start;
        let Some(line) = self.line.read(input)? else {
            return Ok(None);
        };
        self.state = State::Skip { left: NAME_SERVER };
        Ok(Some(message(Command::data(true), line)))
    }
}

fn message(command: Command, text: Bytes) -> Message {
    let payload = Payload::new(text, Form::Text);
    Message { command, payload }
}
