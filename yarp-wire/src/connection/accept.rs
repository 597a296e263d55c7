//! The side that listened.

use std::net::{Ipv4Addr, SocketAddrV4};

use bytes::{Buf, BufMut, Bytes, BytesMut};

use super::line::LineReader;
use super::{Initiator, Message, MessageReader, ProtocolError, put_acknowledgement, put_reply};
use crate::bottle::detect;
use crate::carrier::{Carrier, Framing, MAGIC, Sender, Transport};
use crate::dialect::Dialect;
use crate::http::{Request, RequestReader};
use crate::limits::Limits;
use crate::message::{Command, Form, Payload, WireObject};
use crate::mjpeg;
use crate::number;
use crate::websocket::{self, FrameReader, put_close, put_frame_head};

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
    /// Where messages stand in frames.
    frames: Option<FrameReader>,
    /// A peer that sends frames has said goodbye.
    over: bool,
}

#[derive(Debug)]
enum State {
    Magic,
    Sender(&'static Carrier, LineReader),
    Group(&'static Carrier, Sender),
    Open(&'static Carrier, MessageReader),
    Browser(&'static Carrier, RequestReader),
    /// A request of a browser is being read that turns into a connection.
    Request(&'static Carrier, RequestReader),
}

/// Bytes of a group: IPv4 address and port, the latter high byte first.
const GROUP: usize = 6;
/// Longest sender name, modifiers included. Stock reads 1000.
const LONGEST_SENDER: usize = 4096;

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
            frames: None,
            over: false,
        }
    }

    /// The carrier, once it is known.
    pub fn carrier(&self) -> Option<&'static Carrier> {
        match &self.state {
            State::Magic => None,
            State::Sender(carrier, _)
            | State::Group(carrier, _)
            | State::Open(carrier, _)
            | State::Browser(carrier, _)
            | State::Request(carrier, _) => Some(carrier),
        }
    }

    /// The generation the peer is taken to be of.
    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// Takes the peer to be of a generation, until its own messages betray another.
    pub fn assume(&mut self, dialect: Dialect) {
        self.dialect = dialect;
        if let State::Open(_, reader) = &mut self.state {
            reader.set_dialect(dialect);
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
                    if carrier.transport == Transport::Local {
                        return Err(ProtocolError::OtherProcess);
                    }
                    if carrier.framing == Framing::Http {
                        // What selects the carrier is the beginning of the request.
                        self.state = State::Browser(carrier, RequestReader::default());
                        return Ok(Some(Event::Opened {
                            carrier,
                            sender: Sender::plain("web"),
                            group: None,
                        }));
                    }
                    if carrier.framing == Framing::Pictures
                        || carrier.transport == Transport::WebSocket
                    {
                        self.state = State::Request(carrier, RequestReader::default());
                        continue;
                    }
                    input.advance(MAGIC);
                    self.state = State::Sender(carrier, LineReader::new(LONGEST_SENDER));
                }
                State::Sender(carrier, line) => {
                    let carrier = *carrier;
                    let Some(sender) = read_sender(carrier, line, input)? else {
                        return Ok(None);
                    };
                    if carrier.transport == Transport::Group {
                        self.state = State::Group(carrier, sender);
                        continue;
                    }
                    return Ok(Some(self.open(carrier, sender, None, output)));
                }
                State::Group(carrier, sender) => {
                    let Some(address) = input.first_chunk::<GROUP>() else {
                        return Ok(None);
                    };
                    let [a, b, c, d, high, low] = *address;
                    let port = u16::from_be_bytes([high, low]);
                    let group = SocketAddrV4::new(Ipv4Addr::new(a, b, c, d), port);
                    input.advance(GROUP);
                    let (carrier, sender) = (*carrier, sender.clone());
                    return Ok(Some(self.open(carrier, sender, Some(group), output)));
                }
                State::Browser(_, reader) => {
                    return Ok(reader.read(input, self.limits)?.map(Event::Browser));
                }
                State::Request(carrier, reader) => {
                    let carrier = *carrier;
                    let Some(request) = reader.read(input, self.limits)? else {
                        return Ok(None);
                    };
                    let mut sender = Sender::plain(mjpeg::VIEWER);
                    if carrier.transport == Transport::WebSocket {
                        output.put_slice(websocket::response(&request)?.as_bytes());
                        self.frames = Some(FrameReader::new(self.limits.message));
                        sender = Sender::plain("web");
                    }
                    return Ok(Some(self.open(carrier, sender, None, output)));
                }
                State::Open(_, reader) => {
                    let message = match &mut self.frames {
                        None => reader.read(input)?,
                        Some(_) if self.over => None,
                        Some(frames) => read_frames(frames, reader, input, output)?,
                    };
                    let quits = |message: &Message| message.command == Command::Quit;
                    self.over |= message.as_ref().is_some_and(quits);
                    if let Some(message) = &message {
                        self.learn(message);
                    }
                    return Ok(message.map(Event::Message));
                }
            }
        }
    }

    /// Bytes that the message in progress still needs, as far as it has said; 0 in frames, where
    /// what it has is no longer in `input`, and a ping between two of them is answered at once.
    pub fn missing(&self, input: &BytesMut) -> usize {
        match &self.state {
            State::Open(_, reader) if self.frames.is_none() => reader.missing(input),
            _ => 0,
        }
    }

    /// Appends the reply to the message at hand.
    pub fn reply(&self, object: &dyn WireObject, output: &mut BytesMut) {
        if let State::Open(carrier, _) = &self.state {
            if self.frames.is_none() {
                return put_reply(output, carrier, object, self.dialect);
            }
            let mut reply = BytesMut::new();
            put_reply(&mut reply, carrier, object, self.dialect);
            put_frame_head(output, reply.len());
            output.put_slice(&reply);
        }
    }

    /// The writing side of the same connection, once the peer has become its reader; `None` before
    /// the header is complete.
    pub fn reversed(self) -> Option<Initiator> {
        let carrier = self.carrier()?;
        let initiator = Initiator::established(carrier, self.dialect, self.limits);
        Some(initiator.with_frames(self.frames))
    }

    /// Appends lines in answer to a command; only text connections have them.
    pub fn answer_lines(&self, lines: &str, output: &mut BytesMut) {
        if let State::Open(carrier, _) = &self.state
            && carrier.framing == Framing::Lines
        {
            output.put_slice(lines.as_bytes());
        }
    }

    /// Appends the acknowledgement of the message at hand, if the carrier has them.
    pub fn acknowledge(&self, output: &mut BytesMut) {
        if let State::Open(carrier, _) = &self.state {
            put_acknowledgement(output, carrier);
        }
    }

    fn open(
        &mut self,
        carrier: &'static Carrier,
        sender: Sender,
        group: Option<SocketAddrV4>,
        output: &mut BytesMut,
    ) -> Event {
        match carrier.framing {
            // For datagrams the driver opens a socket and says where (`header_reply`).
            Framing::Indexed if carrier.transport != Transport::Stream => {}
            Framing::Indexed => header_reply(self.port, output),
            Framing::Lines => {
                output.put_slice(format!("Welcome {}\r\n", sender.name).as_bytes());
            }
            Framing::Pictures => output.put_slice(mjpeg::RESPONSE.as_bytes()),
            Framing::Bare | Framing::NameService | Framing::Http => {}
        }
        let reader = MessageReader::new(carrier.framing, self.dialect, self.limits);
        self.state = State::Open(carrier, reader);
        Event::Opened {
            carrier,
            sender,
            group,
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

/// The next message in frames. A close frame is the command to quit, and answers it.
fn read_frames(
    frames: &mut FrameReader,
    reader: &mut MessageReader,
    input: &mut BytesMut,
    output: &mut BytesMut,
) -> Result<Option<Message>, ProtocolError> {
    loop {
        // What came before is used before what is behind it: it may be broken.
        if let Some(message) = reader.read(&mut frames.stream)? {
            if message.command == Command::Quit && !frames.is_closed() {
                put_close(output);
            }
            return Ok(Some(message));
        }
        if frames.is_closed() {
            let payload = Payload::new(Bytes::new(), Form::Text);
            let command = Command::Quit;
            return Ok(Some(Message { command, payload }));
        }
        if !frames.step(input, output)? {
            return Ok(None);
        }
    }
}

/// Appends the header reply of a binary carrier: the port to go on with.
pub fn header_reply(port: u16, output: &mut BytesMut) {
    number::put(output, i32::from(port));
}

fn read_sender(
    carrier: &Carrier,
    line: &mut LineReader,
    input: &mut BytesMut,
) -> Result<Option<Sender>, ProtocolError> {
    match carrier.framing {
        Framing::NameService => Ok(Some(Sender::plain("anon"))),
        Framing::Http | Framing::Pictures => Ok(Some(Sender::plain("web"))),
        Framing::Lines => Ok(line.read(input)?.map(|name| Sender::parse(&name))),
        Framing::Indexed | Framing::Bare => {
            let Some(length) = input.first_chunk::<4>() else {
                return Ok(None);
            };
            let length = i32::from_le_bytes(*length);
            let bytes = usize::try_from(length)
                .ok()
                .filter(|bytes| (1..=LONGEST_SENDER).contains(bytes))
                .ok_or(ProtocolError::SenderLength {
                    length,
                    limit: LONGEST_SENDER,
                })?;
            if input.len() < 4 + bytes {
                return Ok(None);
            }
            input.advance(4);
            let name = input.split_to(bytes);
            let end = name.iter().position(|b| *b == 0).unwrap_or(name.len());
            Ok(Some(Sender::parse(&name[..end])))
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
