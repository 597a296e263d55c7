//! The byte protocols between the two ends of a connection, from the header on.
//!
//! Each carrier names its [`Protocol`]. The protocols shared by several carriers are here:
//!
//! * [`INDEXED`]: an index, a command block and a binary payload;
//! * [`UNINDEXED`]: the same without the index;
//! * [`TEXT_LINES`]: lines of text.
//!
//! Other protocols are in the files of their carriers (HTTP, MJPEG, WebSocket, multicast groups)
//! and reuse the decoders of this module.

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
use crate::http::{Request, Service};
use crate::message::{Command, Payload, WireObject};
use crate::message_limits::Limits;
use crate::ready::Ready;
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

/// The protocol of a carrier. It is stateless: the decoders that it creates hold the state of each
/// connection.
pub trait Protocol: fmt::Debug + Sync {
    /// Returns the kind of payload of the messages.
    fn payload_kind(&self) -> PayloadKind;

    /// Returns what a browser gets that speaks this protocol; `None` if none can. Its requests pass a
    /// [gate](crate::http::Gate) before anything else is done with them.
    fn service(&self) -> Option<Service> {
        None
    }

    /// Appends the header of an initiator.
    fn put_header(&self, carrier: &Carrier, sender: &Sender, output: &mut BytesMut);

    /// Creates the decoder for the rest of the header. The magic is complete at the beginning of
    /// `input`, and may be consumed here.
    fn handshake_decoder(
        &self,
        carrier: &'static Carrier,
        input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder>;

    /// Creates the decoder for messages after the header.
    fn message_decoder(&self, wire_version: WireVersion, limits: Limits)
    -> Box<dyn MessageDecoder>;

    /// Creates the decoder for replies, on the sending side.
    fn reply_decoder(&self, limits: Limits) -> Box<dyn ReplyDecoder>;

    /// Appends the part of a message that precedes a payload of `length` bytes.
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

    /// Returns whether a reply is more than the object alone.
    fn frames_replies(&self) -> bool {
        false
    }

    /// Appends an acknowledgement, on a carrier that has them.
    fn put_acknowledgement(&self, _output: &mut BytesMut) {}

    /// Returns whether commands that are no messages are answered with lines.
    fn replies_to_commands(&self) -> bool {
        false
    }

    /// Appends such lines.
    fn put_lines(&self, _lines: &str, _output: &mut BytesMut) {}

    /// Returns whether a close command is answered.
    fn replies_to_close(&self) -> bool {
        false
    }

    /// Appends a refusal for an initiator that would not notice the closed connection otherwise.
    fn put_refusal(&self, _carrier: &Carrier, _reason: &dyn fmt::Display, _output: &mut BytesMut) {}
}

/// The payload kinds of protocols.
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
    /// Returns whether they are in the binary form.
    pub const fn are_binary(self) -> bool {
        matches!(self, Self::Binary)
    }
}

/// An acceptor before the header is complete.
pub trait HandshakeDecoder: fmt::Debug + Send + Sync {
    /// Decodes the header from `input`, or returns `None` while bytes are missing; the header reply
    /// goes to `output`. `port` is the acceptor's TCP port.
    fn read(
        &mut self,
        port: u16,
        limits: Limits,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Handshake, ProtocolError>;
}

/// The content of a header.
#[derive(Debug)]
pub struct Handshake {
    /// The sender's name and modifiers.
    pub sender: Sender,
    /// The multicast group that messages arrive on, for a carrier of groups.
    pub group: Option<SocketAddrV4>,
}

impl Handshake {
    /// Creates a peer that has no more to say.
    pub(crate) fn by(sender: Sender) -> Self {
        let group = None;
        Self { sender, group }
    }
}

/// The handshake of a peer that does not name itself: this name replaces the sender's.
#[derive(Debug)]
pub(crate) struct AnonymousHandshake(pub(crate) &'static str);

impl HandshakeDecoder for AnonymousHandshake {
    fn read(
        &mut self,
        _port: u16,
        _limits: Limits,
        _input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Ready<Handshake, ProtocolError> {
        Ok(Some(Handshake::by(Sender::plain(self.0))))
    }
}

/// An acceptor behind the header.
pub trait MessageDecoder: fmt::Debug + Send + Sync {
    /// Decodes the next message from `input`, or returns `None` while bytes are missing; automatic
    /// answers of the protocol go to `output`.
    fn read(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Incoming, ProtocolError>;

    /// Returns the number of bytes that the current message still needs, as far as announced and
    /// not yet consumed from `input`.
    fn missing(&self, _input: &BytesMut) -> usize {
        0
    }

    /// Takes payloads to be of a wire version.
    fn set_wire_version(&mut self, _wire_version: WireVersion) {}

    /// Returns the decoder for the replies of the same peer when the direction reverses, if it
    /// differs from that of [`Protocol::reply_decoder`].
    fn into_reply_decoder(self: Box<Self>, _limits: Limits) -> Option<Box<dyn ReplyDecoder>> {
        None
    }
}

/// An item decoded by an acceptor.
#[derive(Debug, PartialEq)]
pub enum Incoming {
    /// A message.
    Message(Message),
    /// An HTTP request. Boxed: it is larger than a message, and each event is moved several times.
    Request(Box<Request>),
}

/// One message of a connection.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// The command.
    pub command: Command,
    /// The content of a data or admin message; empty for other commands.
    pub payload: Payload,
}

/// An initiator, as far as it listens.
pub trait ReplyDecoder: fmt::Debug + Send + Sync {
    /// Decodes the header reply, if the protocol has one: its number, or 0 if it has none. `None`
    /// while bytes are missing.
    fn read_header(
        &mut self,
        _asked: &InitiatorState,
        _input: &mut BytesMut,
    ) -> Ready<i32, ProtocolError> {
        Ok(Some(0))
    }

    /// There was a header, and it is done with.
    fn skip_header(&mut self) {}

    /// Takes the next answer from `input`, or `None` while bytes are missing.
    fn read(
        &mut self,
        initiator_state: &mut InitiatorState,
        input: &mut BytesMut,
    ) -> Ready<Progress, ProtocolError>;

    /// Returns the automatic answers of the protocol.
    fn take_output(&mut self) -> BytesMut {
        BytesMut::new()
    }
}

/// An event of an initiator.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// The acceptor has answered the header: messages may be sent.
    Ready,
    /// The reply to the oldest message that waits for one.
    Reply(Payload),
    /// The lines that answer a command on a text connection.
    Lines(Vec<String>),
    /// The oldest message is complete: acknowledged, or replied to if there are no
    /// acknowledgements.
    Done,
}

/// The state of an initiator: its pending replies and the parameters of the connection.
#[derive(Debug)]
pub struct InitiatorState {
    /// The carrier.
    pub carrier: &'static Carrier,
    /// The wire version that the acceptor is taken to be of.
    pub wire_version: WireVersion,
    /// The bounds on received bytes.
    pub limits: Limits,
    /// The pending replies, oldest message first.
    pub waiting: VecDeque<PendingReply>,
}

/// The kind of answer that a message waits for.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum PendingReply {
    /// A reply.
    Reply,
    /// Lines.
    Lines,
    /// An acknowledgement.
    Acknowledgement,
}
