//! The side that listened.

use std::net::SocketAddrV4;

use bytes::BytesMut;

use super::{Initiator, put_acknowledgement};
use crate::bottle::detect;
use crate::carrier::{Carrier, MAGIC, Sender};
use crate::dialect::Dialect;
use crate::http::Request;
use crate::limits::Limits;
use crate::message::{Command, Form, WireObject};
use crate::protocol::{Incoming, Message, Messages, Opened, Opening, ProtocolError};

/// What an acceptor has learned.
#[derive(Debug)]
pub enum Event {
    /// The header is complete: the peer is this sender on this carrier. On a carrier that does not
    /// push it is a reader, and the connection goes on as one that the port writes to.
    Opened {
        /// The carrier.
        carrier: &'static Carrier,
        /// Who it is and what it asks for.
        sender: Sender,
        /// Where messages come, on a carrier of groups.
        group: Option<SocketAddrV4>,
    },
    /// A message. Answer it with [`Acceptor::reply`] and [`Acceptor::acknowledge`] as it asks.
    Message(Message),
    /// What a browser asks for; the driver answers it whole, and the connection ends.
    Browser(Request),
}

/// The side of a connection that listened.
#[derive(Debug)]
pub struct Acceptor {
    port: u16,
    dialect: Dialect,
    settled: bool,
    limits: Limits,
    state: State,
}

#[derive(Debug)]
enum State {
    Magic,
    Header(&'static Carrier, Box<dyn Opening>),
    Open(&'static Carrier, Box<dyn Messages>),
}

impl Acceptor {
    /// An acceptor on TCP port `port`, for a peer of unknown generation.
    ///
    /// `dialect` is what replies are written in until the peer's own messages betray another.
    pub fn new(port: u16, dialect: Dialect, limits: Limits) -> Self {
        Self {
            port,
            dialect,
            settled: false,
            limits,
            state: State::Magic,
        }
    }

    /// The carrier, once it is known.
    pub fn carrier(&self) -> Option<&'static Carrier> {
        match &self.state {
            State::Magic => None,
            State::Header(carrier, _) | State::Open(carrier, _) => Some(carrier),
        }
    }

    /// The generation the peer is taken to be of.
    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// Takes the peer to be of a generation, until its own messages betray another.
    pub fn assume(&mut self, dialect: Dialect) {
        self.dialect = dialect;
        if let State::Open(_, messages) = &mut self.state {
            messages.set_dialect(dialect);
        }
    }

    /// Takes the next event from `input`; what the protocol answers by itself goes to `output`.
    ///
    /// `None` while bytes are missing.
    pub fn poll(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Result<Option<Event>, ProtocolError> {
        loop {
            match &mut self.state {
                State::Magic => {
                    let Some(magic) = input.first_chunk::<MAGIC>() else {
                        return Ok(None);
                    };
                    let carrier = Carrier::detect(magic)
                        .ok_or(ProtocolError::UnknownCarrier { magic: *magic })?;
                    self.state = State::Header(carrier, carrier.protocol.opening(carrier, input));
                }
                State::Header(carrier, opening) => {
                    let carrier = *carrier;
                    let opened = opening.read(self.port, self.limits, input, output)?;
                    let Some(Opened { sender, group }) = opened else {
                        return Ok(None);
                    };
                    let messages = carrier.protocol.messages(self.dialect, self.limits);
                    self.state = State::Open(carrier, messages);
                    return Ok(Some(Event::Opened {
                        carrier,
                        sender,
                        group,
                    }));
                }
                State::Open(_, messages) => {
                    let incoming = messages.read(input, output)?;
                    if let Some(Incoming::Message(message)) = &incoming {
                        self.learn(message);
                    }
                    return Ok(incoming.map(Event::from));
                }
            }
        }
    }

    /// Bytes that the message in progress still needs, as far as it has said.
    pub fn missing(&self, input: &BytesMut) -> usize {
        match &self.state {
            State::Open(_, messages) => messages.missing(input),
            _ => 0,
        }
    }

    /// Appends the reply to the message at hand.
    pub fn reply(&self, object: &dyn WireObject, output: &mut BytesMut) {
        if let State::Open(carrier, _) = &self.state {
            carrier.protocol.put_reply(object, self.dialect, output);
        }
    }

    /// The writing side of the same connection, once the peer has become its reader; `None` before
    /// the header is complete.
    pub fn reversed(self) -> Option<Initiator> {
        let State::Open(carrier, messages) = self.state else {
            return None;
        };
        let initiator = Initiator::established(carrier, self.dialect, self.limits);
        Some(match messages.reversed(self.limits) {
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

    /// Settles the generation of the peer as soon as a message that wants a reply betrays it.
    fn learn(&mut self, message: &Message) {
        let wants_reply = matches!(
            message.command,
            Command::Admin | Command::Data { reply: true, .. }
        );
        if self.settled || !wants_reply || message.payload.form() == Form::Text {
            return;
        }
        if let Some(dialect) = detect(&message.payload.bytes(), self.limits) {
            self.assume(dialect);
            self.settled = true;
        }
    }
}

impl From<Incoming> for Event {
    fn from(incoming: Incoming) -> Self {
        match incoming {
            Incoming::Message(message) => Self::Message(message),
            Incoming::Request(request) => Self::Browser(request),
        }
    }
}

/// What stock tells a peer whose first bytes select no carrier.
pub const REFUSAL: &str = "\
* Error. Protocol not found.\r\n\
* Hello. You appear to be trying to communicate with a YARP Port.\r\n\
* The first 8 bytes sent to a YARP Port are critical for identifying the\r\n\
* protocol you wish to speak.\r\n\
* The first 8 bytes you sent were not associated with any particular protocol.\r\n\
* If you are a human, try typing \"CONNECT foo\" followed by a <RETURN>.\r\n\
* The 8 bytes \"CONNECT \" correspond to a simple text-mode protocol.\r\n\
* Goodbye.\r\n";
