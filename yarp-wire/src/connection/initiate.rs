//! The side that connected.

use std::collections::VecDeque;
use std::net::SocketAddrV4;

use bytes::{Buf, BufMut, Bytes, BytesMut};

use super::line::LineReader;
use super::outgoing::{ACKNOWLEDGEMENT_LINE, ACKNOWLEDGEMENT_WORD};
use super::{ProtocolError, put_head};
use crate::bottle::{Balance, DecodeError, Scan, Scanner};
use crate::carrier::{Carrier, Framing, Sender, Transport};
use crate::dialect::Dialect;
use crate::limits::Limits;
use crate::message::{Command, Form, Payload};
use crate::number;
use crate::websocket::{FrameReader, WebSocketError};

/// What an initiator has learned.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// The acceptor has answered the header: messages may be sent.
    Ready,
    /// The reply to the oldest message that waits for one.
    Reply(Payload),
    /// The lines that answer a command on a text connection.
    Lines(Vec<String>),
    /// The oldest message is done with: acknowledged, or replied to where there are no
    /// acknowledgements.
    Done,
}

/// The side of a connection that connected.
#[derive(Debug)]
pub struct Initiator {
    carrier: &'static Carrier,
    dialect: Dialect,
    limits: Limits,
    ready: bool,
    header_number: i32,
    welcomed: bool,
    waiting: VecDeque<Waiting>,
    scanner: Option<Scanner>,
    line: LineReader,
    text: BytesMut,
    balance: Balance,
    lines: Vec<String>,
    /// An acknowledgement came where a reply was due: the acceptor had none to give.
    acknowledged_early: bool,
    /// Where messages stand in frames.
    frames: Option<FrameReader>,
    said: BytesMut,
}

/// Appends the group that a connection goes on with, behind the header of a carrier of groups.
pub fn put_group(group: SocketAddrV4, output: &mut BytesMut) {
    output.put_slice(&group.ip().octets());
    output.put_u16(group.port());
}

/// What the oldest unanswered messages still wait for.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Waiting {
    Reply,
    Lines,
    Acknowledgement,
}

impl Initiator {
    /// Starts a connection: appends magic and sender to `output`.
    ///
    /// `dialect` is the generation of the acceptor: what messages to it are written in.
    pub fn new(
        carrier: &'static Carrier,
        sender: &Sender,
        dialect: Dialect,
        limits: Limits,
        output: &mut BytesMut,
    ) -> Self {
        output.put_slice(&carrier.magic);
        let name = sender.to_string();
        match carrier.framing {
            Framing::Indexed | Framing::Bare => {
                output.put_i32_le(name.len() as i32 + 1);
                output.put_slice(name.as_bytes());
                output.put_u8(0);
            }
            Framing::Lines => {
                output.put_slice(name.as_bytes());
                output.put_slice(b"\r\n");
            }
            Framing::NameService => output.put_slice(b"VER "),
            Framing::Http | Framing::Pictures => {}
        }
        Self {
            carrier,
            dialect,
            limits,
            ready: false,
            header_number: 0,
            welcomed: false,
            waiting: VecDeque::new(),
            scanner: None,
            line: LineReader::new(limits.line),
            text: BytesMut::new(),
            balance: Balance::default(),
            lines: Vec::new(),
            acknowledged_early: false,
            frames: None,
            said: BytesMut::new(),
        }
    }

    /// The writing side of a connection whose header is done with: one that was reversed.
    pub fn established(carrier: &'static Carrier, dialect: Dialect, limits: Limits) -> Self {
        let mut nowhere = BytesMut::new();
        let mut initiator = Self::new(carrier, &Sender::plain(""), dialect, limits, &mut nowhere);
        initiator.ready = true;
        initiator.welcomed = true;
        initiator
    }

    /// The same on a connection whose messages stand in frames.
    pub(super) fn with_frames(mut self, frames: Option<FrameReader>) -> Self {
        self.frames = frames;
        self
    }

    /// What the protocol answered by itself while bytes were taken: to be sent like messages.
    pub fn said(&mut self) -> BytesMut {
        self.said.split()
    }

    /// The carrier.
    pub fn carrier(&self) -> &'static Carrier {
        self.carrier
    }

    /// The number in the acceptor's header reply: for a carrier of datagrams, where they go.
    pub fn header_number(&self) -> i32 {
        self.header_number
    }

    /// The generation the acceptor is taken to be of.
    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// Appends the head of a message whose payload of `length` bytes the driver appends next.
    pub fn send(&mut self, command: &Command, length: usize, output: &mut impl BufMut) {
        put_head(output, self.carrier, command, length);
        match command {
            Command::Admin | Command::Data { reply: true, .. } => {
                self.waiting.push_back(Waiting::Reply);
            }
            Command::Data { .. } | Command::Quit | Command::Reverse => {}
            _ if self.carrier.framing == Framing::Lines && self.carrier.acknowledges => {
                self.waiting.push_back(Waiting::Lines);
                return;
            }
            _ => {}
        }
        if self.carrier.acknowledges {
            self.waiting.push_back(Waiting::Acknowledgement);
        }
    }

    /// Whether every message sent is done with.
    pub fn is_idle(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Takes the next event from `input`, or `None` while bytes are missing.
    pub fn poll(&mut self, input: &mut BytesMut) -> Result<Option<Progress>, ProtocolError> {
        if !self.ready {
            return self.poll_header(input);
        }
        if let Some(frames) = self.frames.take() {
            return self.poll_frames(frames, input);
        }
        match self.carrier.framing {
            Framing::Indexed | Framing::Bare => self.poll_binary(input),
            Framing::Lines | Framing::NameService | Framing::Http => self.poll_text(input),
            // Who watches pictures has nothing more to say.
            Framing::Pictures => {
                input.clear();
                Ok(None)
            }
        }
    }

    fn poll_frames(
        &mut self,
        mut frames: FrameReader,
        input: &mut BytesMut,
    ) -> Result<Option<Progress>, ProtocolError> {
        loop {
            let progress = self.poll_binary(&mut frames.stream)?;
            if progress.is_none() && frames.is_closed() {
                return Err(WebSocketError::Closed.into());
            }
            if progress.is_some() || !frames.step(input, &mut self.said)? {
                self.frames = Some(frames);
                return Ok(progress);
            }
        }
    }

    fn poll_header(&mut self, input: &mut BytesMut) -> Result<Option<Progress>, ProtocolError> {
        match self.carrier.framing {
            // There is no reply to the name of a group.
            Framing::Indexed if self.carrier.transport == Transport::Group => {}
            // The connection goes on over another socket at once.
            Framing::Bare => {}
            Framing::Indexed => {
                let Some(reply) = input.first_chunk::<{ number::LENGTH }>() else {
                    return Ok(None);
                };
                self.header_number =
                    number::decode(reply).ok_or(ProtocolError::HeaderReply { got: *reply })?;
                input.advance(number::LENGTH);
            }
            Framing::Lines if self.carrier.acknowledges => {
                if self.line.read(input)?.is_none() {
                    return Ok(None);
                }
                self.welcomed = true;
            }
            // A text initiator sends without waiting for the welcome.
            Framing::Lines => {}
            Framing::NameService | Framing::Http | Framing::Pictures => self.welcomed = true,
        }
        self.ready = true;
        Ok(Some(Progress::Ready))
    }

    fn poll_binary(&mut self, input: &mut BytesMut) -> Result<Option<Progress>, ProtocolError> {
        match self.waiting.front() {
            None => match input.len() {
                0 => Ok(None),
                // An acceptor that closes while it waits for a message sends one more
                // acknowledgement first.
                count if self.carrier.acknowledges && count <= number::LENGTH => Ok(None),
                count => Err(ProtocolError::Unexpected { count }),
            },
            Some(Waiting::Acknowledgement) if self.carrier.framing == Framing::Bare => {
                let Some(word) = input.first_chunk::<4>() else {
                    return Ok(None);
                };
                if word != ACKNOWLEDGEMENT_WORD {
                    return Err(ProtocolError::Acknowledgement { got: word.to_vec() });
                }
                input.advance(word.len());
                self.waiting.pop_front();
                Ok(Some(Progress::Done))
            }
            Some(Waiting::Acknowledgement) => {
                let Some(head) = input.first_chunk::<{ number::LENGTH }>() else {
                    return Ok(None);
                };
                let discard = number::decode(head)
                    .and_then(|n| usize::try_from(n).ok())
                    .filter(|n| *n <= self.limits.line)
                    .ok_or_else(|| ProtocolError::Acknowledgement { got: head.to_vec() })?;
                if input.len() < number::LENGTH + discard {
                    return Ok(None);
                }
                input.advance(number::LENGTH + discard);
                self.waiting.pop_front();
                Ok(Some(Progress::Done))
            }
            Some(Waiting::Reply | Waiting::Lines) => self.poll_reply(input),
        }
    }

    /// A reply has no length in front: its own structure tells where it ends.
    fn poll_reply(&mut self, input: &mut BytesMut) -> Result<Option<Progress>, ProtocolError> {
        if self.carrier.acknowledges {
            // Stock acceptors whose owner gives no reply only acknowledge. No bottle starts so.
            match input.first_chunk::<{ number::LENGTH }>() {
                Some(head) if number::decode(head).is_some() => {
                    self.waiting.pop_front();
                    let nothing = Payload::new(Bytes::new(), Form::Text);
                    return Ok(Some(Progress::Reply(nothing)));
                }
                None if input.first().is_none_or(|byte| *byte == b'Y') => return Ok(None),
                _ => {}
            }
        }
        if is_version_struct(input) {
            if input.len() < VERSION_STRUCT {
                return Ok(None);
            }
            self.scanner = None;
            self.waiting.pop_front();
            let bytes = input.split_to(VERSION_STRUCT).freeze();
            let payload = Payload::new(bytes, Form::Binary(self.dialect));
            return Ok(Some(Progress::Reply(payload)));
        }
        let scanner = self
            .scanner
            .get_or_insert_with(|| Scanner::new(self.dialect, self.limits));
        let scan = match scanner.scan(input) {
            Ok(scan) => scan,
            Err(error @ DecodeError::UnknownCode { dialect, .. }) if dialect == self.dialect => {
                // Perhaps the acceptor is of the other generation after all.
                let mut other = Scanner::new(dialect.other(), self.limits);
                let Ok(scan) = other.scan(input) else {
                    return Err(error.into());
                };
                self.dialect = dialect.other();
                self.scanner = Some(other);
                scan
            }
            Err(error) => return Err(error.into()),
        };
        let Scan::Complete { length } = scan else {
            return Ok(None);
        };
        self.scanner = None;
        self.waiting.pop_front();
        let bytes = input.split_to(length).freeze();
        let payload = Payload::new(bytes, Form::Binary(self.dialect));
        Ok(Some(Progress::Reply(payload)))
    }

    fn poll_text(&mut self, input: &mut BytesMut) -> Result<Option<Progress>, ProtocolError> {
        if std::mem::take(&mut self.acknowledged_early) {
            self.waiting.pop_front();
            return Ok(Some(Progress::Done));
        }
        while let Some(line) = self.line.read(input)? {
            if !self.welcomed {
                self.welcomed = true;
                continue;
            }
            match self.waiting.front() {
                // Stock text initiators ignore what they did not ask for.
                None => {}
                Some(Waiting::Acknowledgement) => {
                    self.waiting.pop_front();
                    return Ok(Some(Progress::Done));
                }
                Some(Waiting::Lines) if line == ACKNOWLEDGEMENT_LINE => {
                    self.waiting.pop_front();
                    return Ok(Some(Progress::Lines(std::mem::take(&mut self.lines))));
                }
                Some(Waiting::Lines) => {
                    let held: usize = self.lines.iter().map(String::len).sum();
                    if held + line.len() > self.limits.line {
                        let limit = self.limits.line;
                        return Err(ProtocolError::LineTooLong { limit });
                    }
                    self.lines.push(String::from_utf8_lossy(&line).into_owned());
                }
                Some(Waiting::Reply)
                    if self.carrier.acknowledges
                        && self.text.is_empty()
                        && line == ACKNOWLEDGEMENT_LINE =>
                {
                    self.waiting.pop_front();
                    self.acknowledged_early = true;
                    let nothing = Payload::new(Bytes::new(), Form::Text);
                    return Ok(Some(Progress::Reply(nothing)));
                }
                Some(Waiting::Reply) => {
                    if let Some(text) = self.text_reply(line)? {
                        self.waiting.pop_front();
                        let payload = Payload::new(text, Form::Text);
                        return Ok(Some(Progress::Reply(payload)));
                    }
                }
            }
        }
        Ok(None)
    }

    /// A reply goes on over further lines while a bracket or quote is open.
    fn text_reply(&mut self, line: Bytes) -> Result<Option<Bytes>, ProtocolError> {
        if self.text.len() + line.len() > self.limits.line {
            let limit = self.limits.line;
            return Err(ProtocolError::LineTooLong { limit });
        }
        if self.text.is_empty() {
            self.balance.extend(&line);
            self.text = line.into();
        } else {
            self.text.extend_from_slice(b"\n");
            self.text.extend_from_slice(&line);
            self.balance.extend(b"\n");
            self.balance.extend(&line);
        }
        if !self.balance.is_even() {
            return Ok(None);
        }
        self.balance = Balance::default();
        Ok(Some(self.text.split().freeze()))
    }
}

/// The bytes of the answer to `getRemoteProtocolVersion`: a list head and four bare int16.
const VERSION_STRUCT: usize = 16;

/// Whether a reply begins as the version of a 4.0 service does, the one reply that is no bottle.
///
/// After the head of a list of one come protocol and major version, where a bottle has a code below 1024.
/// Source: bytes written by 4.0.0.
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

    /// A call to a stock port that only reads ended the connection: its acknowledgement, where a
    /// reply was due, was taken for a broken bottle.
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

    #[test]
    fn an_acknowledgement_instead_of_a_reply_is_an_empty_reply() {
        let tcp = Carrier::by_name("tcp").unwrap();
        let mut initiator = Initiator::established(tcp, Dialect::V3, Limits::DEFAULT);
        let mut output = BytesMut::new();
        initiator.send(&Command::data(true), 0, &mut output);
        let mut input = BytesMut::new();
        for byte in &number::encode(0)[..7] {
            input.put_u8(*byte);
            assert_eq!(initiator.poll(&mut input), Ok(None));
        }
        input.put_u8(b'P');
        let nothing = Payload::new(Bytes::new(), Form::Text);
        assert_eq!(
            initiator.poll(&mut input),
            Ok(Some(Progress::Reply(nothing)))
        );
        assert_eq!(initiator.poll(&mut input), Ok(Some(Progress::Done)));
        assert!(initiator.is_idle() && input.is_empty());
    }
}
