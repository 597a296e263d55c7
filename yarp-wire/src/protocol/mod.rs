//! What the two ends of a connection say to each other, from the header on.
//!
//! Each carrier names its [`Protocol`]. Those that several carriers share are here:
//!
//! * [`INDEXED`]: an index, a command block and a binary payload;
//! * [`UNINDEXED`]: the same without the index;
//! * [`TEXT_LINES`]: lines of text.
//!
//! A carrier that speaks otherwise has its protocol in its own file: requests of browsers, pictures,
//! frames, groups. What of it can be shared it takes from here.

mod binary_common;
mod indexed;
mod line_reader;
mod stream_protocol_error;
mod text_lines;
mod unindexed;

use std::collections::VecDeque;
use std::fmt;
use std::net::SocketAddrV4;

use bytes::BytesMut;

use crate::carrier::{Carrier, Sender};
use crate::http::Request;
use crate::limits::Limits;
use crate::message::{Command, Payload, WireObject};
use crate::wire_version::WireVersion;

pub use indexed::{INDEXED, header_reply};
pub use stream_protocol_error::ProtocolError;
pub use text_lines::{ACKNOWLEDGEMENT_LINE, TEXT_LINES};
pub use unindexed::UNINDEXED;

pub(crate) use binary_common::BinaryHandshakeDecoder;
pub(crate) use indexed::{IndexedMessageDecoder, answers as indexed_answers};
pub(crate) use line_reader::LineReader;
pub(crate) use text_lines::TextReplyDecoder;
pub(crate) use unindexed::UnindexedMessageDecoder;

/// How two ends understand each other. It holds nothing itself: what has been said so far is in
/// what it makes for each connection.
pub trait Protocol: fmt::Debug + Sync {
    /// What messages hold.
    fn payload_kind(&self) -> PayloadKind;

    /// Appends what an initiator says first.
    fn put_header(&self, carrier: &Carrier, sender: &Sender, output: &mut BytesMut);

    /// What takes the rest of that at the other end. The magic is whole and at the beginning of
    /// `input`, and may be passed over here.
    fn handshake_decoder(
        &self,
        carrier: &'static Carrier,
        input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder>;

    /// What takes messages once the header is complete.
    fn message_decoder(&self, wire_version: WireVersion, limits: Limits)
    -> Box<dyn MessageDecoder>;

    /// What takes answers where messages are sent.
    fn reply_decoder(&self, limits: Limits) -> Box<dyn ReplyDecoder>;

    /// Appends all of a message that comes before a payload of `length` bytes.
    fn put_head(&self, command: &Command, length: usize, output: &mut BytesMut);

    /// Appends the payload of a message: the object alone.
    fn put_object(
        &self,
        object: &dyn WireObject,
        wire_version: WireVersion,
        output: &mut BytesMut,
    ) {
        match self.payload_kind() {
            PayloadKind::Binary | PayloadKind::Jpeg => object.write_binary(output, wire_version),
            PayloadKind::Text | PayloadKind::Page => object.write_text(output),
        }
    }

    /// Appends a reply.
    fn put_reply(&self, object: &dyn WireObject, wire_version: WireVersion, output: &mut BytesMut) {
        self.put_object(object, wire_version, output);
    }

    /// Appends an acknowledgement, on a carrier that has them.
    fn put_acknowledgement(&self, _output: &mut BytesMut) {}

    /// Whether commands that are no messages are answered with lines.
    fn replies_to_commands(&self) -> bool {
        false
    }

    /// Appends such lines.
    fn put_lines(&self, _lines: &str, _output: &mut BytesMut) {}

    /// Whether a goodbye is answered with another.
    fn replies_to_close(&self) -> bool {
        false
    }

    /// Appends what is told to an initiator that is refused, where it does not notice otherwise.
    fn put_refusal(&self, _carrier: &Carrier, _reason: &dyn fmt::Display, _output: &mut BytesMut) {}
}

/// What the messages of a protocol hold.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum PayloadKind {
    /// Objects in the binary form.
    Binary,
    /// Objects as text.
    Text,
    /// Text of a page.
    Page,
    /// Pictures ([`mjpeg`](crate::mjpeg)), each with its own head.
    Jpeg,
}

impl PayloadKind {
    /// Whether they are in the binary form.
    pub const fn are_binary(self) -> bool {
        matches!(self, Self::Binary)
    }
}

/// An acceptor before the header is complete.
pub trait HandshakeDecoder: fmt::Debug + Send + Sync {
    /// Takes the header from `input`, or `None` while bytes are missing; what is answered to it
    /// goes to `output`. `port` is where the acceptor listens.
    fn read(
        &mut self,
        port: u16,
        limits: Limits,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Result<Option<Handshake>, ProtocolError>;
}

/// What a header says.
#[derive(Debug)]
pub struct Handshake {
    /// Who it is and what it asks for.
    pub sender: Sender,
    /// Where messages come, on a carrier of groups.
    pub group: Option<SocketAddrV4>,
}

impl Handshake {
    /// A peer that has no more to say.
    pub(crate) fn by(sender: Sender) -> Self {
        let group = None;
        Self { sender, group }
    }
}

/// The opening of those who do not say who they are: this name stands for them.
#[derive(Debug)]
pub(crate) struct AnonymousHandshake(pub(crate) &'static str);

impl HandshakeDecoder for AnonymousHandshake {
    fn read(
        &mut self,
        _port: u16,
        _limits: Limits,
        _input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Result<Option<Handshake>, ProtocolError> {
        Ok(Some(Handshake::by(Sender::plain(self.0))))
    }
}

/// An acceptor behind the header.
pub trait MessageDecoder: fmt::Debug + Send + Sync {
    /// Takes what comes next from `input`, or `None` while bytes are missing; what the protocol
    /// answers by itself goes to `output`.
    fn read(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Result<Option<Incoming>, ProtocolError>;

    /// Bytes that the message in progress still needs, as far as it has said and they are taken
    /// from `input`.
    fn missing(&self, _input: &BytesMut) -> usize {
        0
    }

    /// Takes payloads to be of a generation.
    fn set_wire_version(&mut self, _wire_version: WireVersion) {}

    /// What goes on with the same peer as the one that is written to, where that is not what
    /// [`Protocol::answers`] makes.
    fn into_reply_decoder(self: Box<Self>, _limits: Limits) -> Option<Box<dyn ReplyDecoder>> {
        None
    }
}

/// What an acceptor takes.
#[derive(Debug, PartialEq)]
pub enum Incoming {
    /// A message.
    Message(Message),
    /// What a browser asks for.
    Request(Request),
}

/// One message of a connection.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// What it asks for.
    pub command: Command,
    /// The content of a data or admin message; empty for other commands.
    pub payload: Payload,
}

/// An initiator, as far as it listens.
pub trait ReplyDecoder: fmt::Debug + Send + Sync {
    /// Takes the answer to the header, where there is one: the number in it, 0 where it has none.
    /// `None` while bytes are missing.
    fn read_header(
        &mut self,
        _asked: &InitiatorState,
        _input: &mut BytesMut,
    ) -> Result<Option<i32>, ProtocolError> {
        Ok(Some(0))
    }

    /// There was a header, and it is done with.
    fn skip_header(&mut self) {}

    /// Takes the next answer from `input`, or `None` while bytes are missing.
    fn read(
        &mut self,
        initiator_state: &mut InitiatorState,
        input: &mut BytesMut,
    ) -> Result<Option<Progress>, ProtocolError>;

    /// What the protocol answered by itself.
    fn take_output(&mut self) -> BytesMut {
        BytesMut::new()
    }
}

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

/// What an initiator asked for, and how it is spoken with.
#[derive(Debug)]
pub struct InitiatorState {
    /// The carrier.
    pub carrier: &'static Carrier,
    /// The generation that the acceptor is taken to be of.
    pub wire_version: WireVersion,
    /// What is taken at most.
    pub limits: Limits,
    /// What the oldest messages still wait for.
    pub waiting: VecDeque<PendingReply>,
}

/// What a message waits for.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum PendingReply {
    /// A reply.
    Reply,
    /// Lines.
    Lines,
    /// An acknowledgement.
    Acknowledgement,
}
