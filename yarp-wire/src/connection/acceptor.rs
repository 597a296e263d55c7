//! The accepting side of a connection.

use std::net::SocketAddrV4;
use std::sync::Arc;

use bytes::{Bytes, BytesMut};

use super::{Initiator, put_acknowledgement};
use crate::bottle::detect;
use crate::carrier::{Carrier, MAGIC, Sender};
use crate::http::{Admission, Gate, Head, HeadSearch, Request, Response, Service};
use crate::message::{Command, Form, WireObject};
use crate::message_limits::Limits;
use crate::protocol::{
    Handshake, HandshakeDecoder, Incoming, Message, MessageDecoder, PayloadKind, ProtocolError,
};
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// An event of an acceptor.
#[derive(Debug)]
pub enum Event {
    /// The header is complete: the peer is this sender on this carrier. On a carrier that does not
    /// push, the peer is a reader, and the port writes to this connection.
    Opened {
        /// The carrier.
        carrier: &'static Carrier,
        /// The sender's name and modifiers.
        sender: Sender,
        /// The multicast group that messages arrive on, for a carrier of groups.
        group: Option<SocketAddrV4>,
    },
    /// A message. Answer it with [`Acceptor::reply`] and [`Acceptor::acknowledge`] as required.
    Message(Message),
    /// An HTTP request; the driver answers it completely, and the connection closes.
    HttpRequest(Box<Request>),
}

/// The side of a connection that listened.
#[derive(Debug)]
pub struct Acceptor {
    port: u16,
    wire_version: WireVersion,
    version_detected: bool,
    limits: Limits,
    gate: Arc<Gate>,
    /// Rights that the gate gives the request.
    admission: Admission,
    state: State,
}

#[derive(Debug)]
enum State {
    Magic,
    /// A request on its way to the gate, which looks at its head and takes nothing.
    Gate(&'static Carrier, Service, HeadSearch),
    Header(&'static Carrier, Box<dyn HandshakeDecoder>),
    Open(&'static Carrier, Box<dyn MessageDecoder>),
}

impl Acceptor {
    /// Creates an acceptor on TCP port `port`, for a peer of unknown wire version.
    ///
    /// Replies are written in `wire_version` until the peer's own messages reveal another.
    pub fn new(port: u16, wire_version: WireVersion, limits: Limits) -> Self {
        Self {
            port,
            wire_version,
            version_detected: false,
            limits,
            gate: Arc::default(),
            admission: Admission::default(),
            state: State::Magic,
        }
    }

    /// The same acceptor with another gate in front of what browsers can reach.
    pub fn with_gate(mut self, gate: Arc<Gate>) -> Self {
        self.gate = gate;
        self
    }

    /// Returns the carrier, once it is known.
    pub fn carrier(&self) -> Option<&'static Carrier> {
        match &self.state {
            State::Magic => None,
            State::Gate(carrier, ..) | State::Header(carrier, _) | State::Open(carrier, _) => {
                Some(carrier)
            }
        }
    }

    /// Returns the wire version the peer is taken to be of.
    pub fn wire_version(&self) -> WireVersion {
        self.wire_version
    }

    /// Sets the wire version of the peer, until its own messages reveal another.
    pub fn set_wire_version(&mut self, wire_version: WireVersion) {
        self.wire_version = wire_version;
        if let State::Open(_, messages) = &mut self.state {
            messages.set_wire_version(wire_version);
        }
    }

    /// Takes the next event from `input`; automatic answers of the protocol go to `output`.
    ///
    /// `None` while bytes are missing.
    pub fn poll(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Event, ProtocolError> {
        loop {
            match &mut self.state {
                State::Magic => {
                    let Some(magic) = input.first_chunk::<MAGIC>() else {
                        return Ok(None);
                    };
                    let carrier = Carrier::detect(magic)
                        .ok_or(ProtocolError::UnknownCarrier { magic: *magic })?;
                    self.state = match carrier.protocol.service() {
                        Some(service) => State::Gate(carrier, service, HeadSearch::default()),
                        None => State::Header(
                            carrier,
                            carrier.protocol.handshake_decoder(carrier, input),
                        ),
                    };
                }
                State::Gate(carrier, service, search) => {
                    let (carrier, service) = (*carrier, *service);
                    let end = search
                        .end(input)
                        .map_err(|error| unreadable(error, output))?;
                    let Some(end) = end else {
                        return Ok(None);
                    };
                    let head = Head::parse(&input[..end]);
                    self.admission = self.gate.admit(service, &head).map_err(|refusal| {
                        let answer = Response::refused(&refusal).to_text(&Admission::default());
                        output.extend_from_slice(answer.as_bytes());
                        ProtocolError::Browser(refusal)
                    })?;
                    self.state =
                        State::Header(carrier, carrier.protocol.handshake_decoder(carrier, input));
                }
                State::Header(carrier, handshake_decoder) => {
                    let carrier = *carrier;
                    let opened = handshake_decoder
                        .read(self.port, self.limits, input, output)
                        .map_err(|error| match carrier.protocol.service() {
                            Some(_) => unreadable(error, output),
                            None => error,
                        })?;
                    let Some(Handshake { sender, group }) = opened else {
                        return Ok(None);
                    };
                    let messages = carrier
                        .protocol
                        .message_decoder(self.wire_version, self.limits);
                    self.state = State::Open(carrier, messages);
                    return Ok(Some(Event::Opened {
                        carrier,
                        sender,
                        group,
                    }));
                }
                State::Open(_, messages) => {
                    let mut incoming = messages.read(input, output)?;
                    match &mut incoming {
                        Some(Incoming::Message(message)) => self.detect_wire_version(message),
                        Some(Incoming::Request(request)) => {
                            request.admission = self.admission.clone();
                        }
                        None => {}
                    }
                    return Ok(incoming.map(Event::from));
                }
            }
        }
    }

    /// Returns the number of bytes that the current message still needs, as far as announced.
    pub fn missing(&self, input: &BytesMut) -> usize {
        match &self.state {
            State::Open(_, messages) => messages.missing(input),
            _ => 0,
        }
    }

    /// Appends the reply to the message at hand.
    pub fn reply(&self, object: &dyn WireObject, output: &mut BytesMut) {
        if let State::Open(carrier, _) = &self.state {
            carrier
                .protocol
                .put_reply(object, self.wire_version, output);
        }
    }

    /// Returns the reply of [`reply`](Self::reply) as bytes that are not copied, if it has
    /// [shared bytes](WireObject::shared_bytes) and no frame is around it.
    pub fn shared_reply(&self, object: &dyn WireObject) -> Option<Bytes> {
        let State::Open(carrier, _) = &self.state else {
            return None;
        };
        if carrier.protocol.frames_replies() {
            return None;
        }
        let form = match carrier.protocol.payload_kind() {
            PayloadKind::Binary | PayloadKind::Jpeg => Form::Binary(self.wire_version),
            PayloadKind::Text | PayloadKind::Page => Form::Text,
        };
        object.shared_bytes(form).cloned()
    }

    /// Returns the writing side of the same connection, once the peer has become its reader; `None` before
    /// the header is complete.
    pub fn into_initiator(self) -> Option<Initiator> {
        let State::Open(carrier, messages) = self.state else {
            return None;
        };
        let initiator = Initiator::established(carrier, self.wire_version, self.limits);
        Some(match messages.into_reply_decoder(self.limits) {
            None => initiator,
            Some(answers) => initiator.with(answers),
        })
    }

    /// Appends lines in answer to a command; only text connections have them.
    pub fn answer_lines(&self, lines: &str, output: &mut BytesMut) {
        if let State::Open(carrier, _) = &self.state {
            carrier.protocol.put_lines(lines, output);
        }
    }

    /// Appends the acknowledgement of the message at hand, if the carrier has them.
    pub fn acknowledge(&self, output: &mut BytesMut) {
        if let State::Open(carrier, _) = &self.state {
            put_acknowledgement(output, carrier);
        }
    }

    /// Settles the wire version of the peer as soon as a message that wants a reply reveals it.
    fn detect_wire_version(&mut self, message: &Message) {
        let wants_reply = matches!(
            message.command,
            Command::Admin | Command::Data { reply: true, .. }
        );
        if self.version_detected || !wants_reply || message.payload.form() == Form::Text {
            return;
        }
        if let Some(wire_version) = detect(&message.payload.bytes(), self.limits) {
            self.set_wire_version(wire_version);
            self.version_detected = true;
        }
    }
}

impl From<Incoming> for Event {
    fn from(incoming: Incoming) -> Self {
        match incoming {
            Incoming::Message(message) => Self::Message(message),
            Incoming::Request(request) => Self::HttpRequest(request),
        }
    }
}

/// Tells a client that what it sent is no request.
pub(crate) fn unreadable(error: ProtocolError, output: &mut BytesMut) -> ProtocolError {
    let answer = Response::bad_request(&error).to_text(&Admission::default());
    output.extend_from_slice(answer.as_bytes());
    error
}

/// The text that stock sends to a peer whose first bytes select no carrier.
pub const REFUSAL: &str = "\
* Error. Protocol not found.\r\n\
* Hello. You appear to be trying to communicate with a YARP Port.\r\n\
* The first 8 bytes sent to a YARP Port are critical for identifying the\r\n\
* protocol you wish to speak.\r\n\
* The first 8 bytes you sent were not associated with any particular protocol.\r\n\
* If you are a human, try typing \"CONNECT foo\" followed by a <RETURN>.\r\n\
* The 8 bytes \"CONNECT \" correspond to a simple text-mode protocol.\r\n\
* Goodbye.\r\n";
