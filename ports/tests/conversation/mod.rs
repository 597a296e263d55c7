//! Scripted connections to ports, byte for byte, that can end at any byte of any step.

#![allow(dead_code, reason = "each test uses a part of it")]

use std::path::PathBuf;
use std::time::Duration;

use bytes::BytesMut;
use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};
use yarp_wire::auth::{Key, KeyHandshake, STEP_LEN};
use yarp_wire::carrier::{Carrier, Sender, Transport, put_group};
use yarp_wire::connection::{Initiator, put_acknowledgement, put_message};
use yarp_wire::message::Command;
use yarp_wire::mjpeg::{RESPONSE, put_part, request};
use yarp_wire::protocol::{PayloadKind, header_reply};
use yarp_wire::{Bottle, Limits, WireVersion, framed_number, shmem};

use super::common::{bottle, within};

/// The name of whoever dies.
pub(crate) const NAME: &str = "/bad";

/// One step, as the peer of a port sees it.
#[derive(Clone, Debug)]
enum Step {
    Give(Vec<u8>),
    Take(usize),
    /// From here on over a socket of the file system.
    ConnectUnix,
    AcceptUnix,
    /// From here on over a connection to the TCP port that was taken last.
    ConnectNumber,
    /// Tells of another TCP port, the bytes of [`Step::Give`].
    GiveNumber,
    /// From here on over a connection to that port.
    AcceptNumber,
    /// From here on over the next connection to the listener.
    AcceptAgain,
    /// The handshake of keys, as the side that connects or that listens.
    Key(Side),
}

/// The side that begins.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Side {
    Connects,
    Listens,
}

impl Step {
    /// Places at which it can be broken off, its beginning included.
    fn length(&self) -> usize {
        match self {
            Self::Give(bytes) => bytes.len(),
            Self::Take(count) => *count,
            Self::GiveNumber => 8,
            Self::Key(_) => 3 * STEP_LEN,
            Self::ConnectUnix
            | Self::AcceptUnix
            | Self::ConnectNumber
            | Self::AcceptNumber
            | Self::AcceptAgain => 1,
        }
    }
}

/// The way in which a peer ends.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Death {
    /// Sent bytes still arrive.
    Closes,
    /// The connection is reset.
    Resets,
}

/// A whole conversation.
#[derive(Debug)]
pub(crate) struct Conversation {
    pub(crate) carrier: &'static Carrier,
    /// The carrier as it stands in a contact.
    pub(crate) spelled: &'static str,
    steps: Vec<(&'static str, Step)>,
    /// Between two bytes that are given.
    pause: Option<Duration>,
}

impl Conversation {
    fn on(spelled: &'static str) -> Self {
        let carrier = Carrier::of(&spelled.parse().unwrap()).unwrap();
        Self {
            carrier,
            spelled,
            steps: Vec::new(),
            pause: None,
        }
    }

    fn give(&mut self, phase: &'static str, bytes: &[u8]) {
        self.steps.push((phase, Step::Give(bytes.to_vec())));
    }

    fn take(&mut self, phase: &'static str, count: usize) {
        self.steps.push((phase, Step::Take(count)));
    }

    /// Returns the offsets at which the connection ends during `phase`; `"rest"` is after its last
    /// phase.
    pub(crate) fn cuts(&self, phase: &str) -> Vec<usize> {
        let mut cuts = Vec::new();
        let mut begin = 0;
        for (name, step) in &self.steps {
            let end = begin + step.length();
            if *name == phase {
                cuts.extend(begin..end);
            }
            begin = end;
        }
        if phase == "rest" {
            cuts.push(begin);
        }
        cuts
    }

    /// Returns whether it goes on until the other side leaves.
    pub(crate) fn says_goodbye(&self) -> bool {
        self.steps.iter().any(|(name, _)| *name == "goodbye")
    }

    /// Holds it until `cut`; what is left is the connection.
    pub(crate) async fn hold(&self, stream: TcpStream, cut: usize) -> Peer {
        self.hold_at(None, stream, cut).await
    }

    /// Returns the same where `listener` may be connected to again.
    pub(crate) async fn hold_at(
        &self,
        listener: Option<&TcpListener>,
        stream: TcpStream,
        cut: usize,
    ) -> Peer {
        let own = stream.local_addr().unwrap().port();
        let other = stream.peer_addr().unwrap().port();
        // Each step leaves at once.
        stream.set_nodelay(true).unwrap();
        let mut peer = Peer::Tcp(stream);
        let mut taken = Vec::new();
        let mut other_listener = None;
        // Connections that go on until the death.
        let mut held = Vec::new();
        let mut left = cut;
        for (_, step) in &self.steps {
            let part = left.min(step.length());
            left -= part;
            match step {
                Step::Give(bytes) => match self.pause {
                    None => within(peer.give(&bytes[..part])).await,
                    Some(pause) => {
                        for byte in &bytes[..part] {
                            within(peer.give(&[*byte])).await;
                            tokio::time::sleep(pause).await;
                        }
                    }
                },
                Step::Take(_) => taken = within(peer.take(part)).await,
                Step::Key(side) => within(peer.shake_hands(*side, part)).await,
                Step::GiveNumber => {
                    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
                    let number = listener.local_addr().unwrap().port();
                    within(peer.give(&framed_number::encode(number.into())[..part])).await;
                    other_listener = Some(listener);
                }
                Step::ConnectNumber if part == 1 => {
                    let number = framed_number::decode(&taken[..].try_into().unwrap()).unwrap();
                    let address = ("127.0.0.1", number as u16);
                    let stream = within(TcpStream::connect(address)).await.unwrap();
                    held.push(std::mem::replace(&mut peer, Peer::Tcp(stream)));
                }
                Step::AcceptNumber if part == 1 => {
                    let listener = other_listener.as_ref().unwrap();
                    let (stream, _) = within(listener.accept()).await.unwrap();
                    held.push(std::mem::replace(&mut peer, Peer::Tcp(stream)));
                }
                Step::AcceptAgain if part == 1 => {
                    let (stream, _) = within(listener.unwrap().accept()).await.unwrap();
                    held.push(std::mem::replace(&mut peer, Peer::Tcp(stream)));
                }
                Step::ConnectUnix if part == 1 => {
                    peer = within(connect_unix(other, own)).await;
                }
                Step::AcceptUnix if part == 1 => {
                    peer = within(accept_unix(own, other)).await;
                }
                Step::ConnectUnix
                | Step::AcceptUnix
                | Step::ConnectNumber
                | Step::AcceptNumber
                | Step::AcceptAgain => {}
            }
            if left == 0 {
                break;
            }
        }
        assert_eq!(left, 0, "the conversation is longer");
        peer
    }

    /// The same with a pause behind each byte.
    pub(crate) fn slowly(mut self, pause: Duration) -> Self {
        self.pause = Some(pause);
        self
    }

    /// The same where both sides show a key first.
    pub(crate) fn behind_a_key(mut self, side: Side) -> Self {
        self.steps.insert(0, ("key", Step::Key(side)));
        self
    }

    // ---- What they are made of ----------------------------------------------------------------

    /// The header, as the side that connects.
    fn opened_by_peer(mut self) -> Self {
        let carrier = self.carrier;
        let mut header = BytesMut::new();
        let sender = Sender::plain(NAME);
        Initiator::new(
            carrier,
            &sender,
            WireVersion::V3,
            Limits::DEFAULT,
            &mut header,
        );
        self.give("magic", &header.split_to(8));
        if carrier.protocol.payload_kind() != PayloadKind::Text {
            self.give("length of the name", &header.split_to(4));
        }
        self.give("name", &header);
        if carrier.transport == Transport::Group {
            // A number that nobody has now, so that nothing else arrives.
            let free = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
            let number = free.local_addr().unwrap().port();
            let mut group = BytesMut::new();
            put_group(
                format!("239.255.77.1:{number}").parse().unwrap(),
                &mut group,
            );
            self.give("group", &group);
        }
        match carrier.transport {
            Transport::UnixSocket => self.steps.push(("other socket", Step::ConnectUnix)),
            Transport::Group => {}
            _ => self.take("header reply", welcome(carrier, NAME).len()),
        }
        self
    }

    /// Adds the header, on the listening side; `writer` is the connecting port.
    fn opened_by_port(mut self, writer: &str) -> Self {
        let carrier = self.carrier;
        let mut header = BytesMut::new();
        let sender = Sender::plain(writer);
        Initiator::new(
            carrier,
            &sender,
            WireVersion::V3,
            Limits::DEFAULT,
            &mut header,
        );
        self.take("magic", 8);
        self.take("name", header.len() - 8);
        match carrier.transport {
            Transport::UnixSocket => self.steps.push(("other socket", Step::AcceptUnix)),
            Transport::Group => self.take("group", 6),
            Transport::SharedMemory => self.steps.push(("header reply", Step::GiveNumber)),
            _ => self.give("header reply", &welcome(carrier, writer)),
        }
        self
    }

    /// The handshake of shared memory, as the side that connects; it has none.
    fn connected_for_memory(mut self) -> Self {
        self.steps.push(("memory", Step::ConnectNumber));
        self.give("memory", &shmem::connect_packet(7));
        self
    }

    /// The handshake of shared memory, as the side that listens; it has none.
    fn listened_for_memory(mut self) -> Self {
        self.steps.push(("memory", Step::AcceptNumber));
        self.take("memory", shmem::PACKET);
        self.give("memory", &shmem::accept_packet(None));
        self
    }

    /// Adds a phase: the bytes so far lead up to `phase`, to which only `say` adds.
    fn then(mut self, phase: &'static str, say: impl FnOnce(&mut Self)) -> Self {
        let begun = self.steps.len();
        say(&mut self);
        for (at, (name, _)) in self.steps.iter_mut().enumerate() {
            *name = if at < begun { "begun" } else { phase };
        }
        self
    }

    fn give_command(&mut self, command: &Command) {
        for (phase, bytes) in parts(self.carrier, command, &Bottle::new()) {
            self.give(phase, &bytes);
        }
    }

    fn give_message(&mut self, command: &Command, content: &Bottle) {
        let carrier = self.carrier;
        if carrier.name == "websocket" {
            let block = [0, 0, 0, 0, b'~', letter(command), 0, 1];
            let content = content.encode(WireVersion::V3);
            let length = block.len() + content.len();
            // Under a mask that changes nothing.
            self.give("index", &[0x82, 0x80 | length as u8, 0, 0, 0, 0]);
            self.give("command", &block);
            self.give("payload", &content);
            return;
        }
        for (phase, bytes) in parts(carrier, command, content) {
            self.give(phase, &bytes);
        }
    }

    fn take_message(&mut self, command: &Command, content: &Bottle) {
        for (phase, bytes) in parts(self.carrier, command, content) {
            self.take(phase, bytes.len());
        }
    }

    fn acknowledgement(&self) -> BytesMut {
        let mut bytes = BytesMut::new();
        put_acknowledgement(&mut bytes, self.carrier);
        bytes
    }

    fn reply(&self, content: &Bottle) -> BytesMut {
        let mut bytes = BytesMut::new();
        let protocol = self.carrier.protocol;
        protocol.put_object(content, WireVersion::V3, &mut bytes);
        bytes
    }

    fn give_acknowledgement(&mut self) {
        let bytes = self.acknowledgement();
        self.give("acknowledgement", &bytes);
    }

    fn take_acknowledgement(&mut self) {
        let count = self.acknowledgement().len();
        self.take("acknowledgement", count);
    }

    /// The request of a browser, and the beginning of the answer.
    fn browsing(mut self, request: &str, answer: usize) -> Self {
        self.give("magic", &request.as_bytes()[..8]);
        self.give("request", &request.as_bytes()[8..]);
        self.take("header reply", answer);
        self
    }
}

/// Returns the scripts of writers to a port: `content` on every carrier.
pub(crate) fn writers(content: &Bottle) -> Vec<Conversation> {
    let mut all: Vec<_> = STREAMS
        .into_iter()
        .map(|spelled| {
            let mut conversation = Conversation::on(spelled).opened_by_peer();
            conversation.give_message(&Command::data(false), content);
            conversation.take_acknowledgement();
            conversation
        })
        .collect();
    let mut page = upgraded();
    page.give_message(&Command::data(false), content);
    all.push(page);
    // Their messages do not come over the connection that ends.
    all.extend(DATAGRAMS.map(|spelled| Conversation::on(spelled).opened_by_peer()));
    all.push(
        Conversation::on("shmem")
            .opened_by_peer()
            .connected_for_memory(),
    );
    let mut lines = Conversation::on("name_ser");
    lines.give("magic", b"NAME_SER");
    lines.give("index", b"VER ");
    lines.give("payload", format!("{content}\n").as_bytes());
    all.push(lines);
    all.extend(STREAMS.map(|spelled| {
        let conversation = Conversation::on(spelled).opened_by_peer();
        conversation.then("goodbye", |conversation| {
            conversation.give_command(&Command::Quit);
            conversation.take_acknowledgement();
        })
    }));
    all.push(upgraded().then("goodbye", |page| {
        // The frame that closes, under a mask that changes nothing.
        page.give("command", &[0x88, 0x80, 0, 0, 0, 0]);
    }));
    all.extend(["text", "text_ack"].map(|spelled| {
        let conversation = Conversation::on(spelled).opened_by_peer();
        conversation.then("goodbye", |conversation| {
            conversation.give_command(&Command::RemoveInput("/nobody".to_owned()));
            conversation.take("reply", 10);
        })
    }));
    all.push(Conversation::on("http").browsing("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", 12));
    all
}

/// Returns the scripts of callers, with the expected replies.
pub(crate) fn callers(question: &Bottle, answer: &Bottle) -> Vec<Conversation> {
    let mut all: Vec<_> = STREAMS
        .into_iter()
        .map(|spelled| {
            let mut conversation = Conversation::on(spelled).opened_by_peer();
            conversation.give_message(&Command::data(true), question);
            conversation.take("reply", conversation.reply(answer).len());
            conversation.take_acknowledgement();
            conversation
        })
        .collect();
    let mut page = upgraded();
    page.give_message(&Command::data(true), question);
    page.take("reply", 2 + answer.encode(WireVersion::V3).len());
    all.push(page);
    let version = bottle("[ver] 1 2 3");
    all.extend(STREAMS.map(|spelled| {
        let conversation = Conversation::on(spelled).opened_by_peer();
        conversation.then("administration", |conversation| {
            conversation.give_message(&Command::Admin, &bottle("[ver]"));
            conversation.take("reply", conversation.reply(&version).len());
            conversation.take_acknowledgement();
        })
    }));
    all.push(upgraded().then("administration", |page| {
        page.give_message(&Command::Admin, &bottle("[ver]"));
        page.take("reply", 2 + version.encode(WireVersion::V3).len());
    }));
    let mut lines = Conversation::on("name_ser");
    lines.give("magic", b"NAME_SER");
    lines.give("index", b"VER ");
    lines.give("payload", format!("{question}\n").as_bytes());
    lines.take("reply", lines.reply(answer).len());
    all.push(lines);
    let mut browser = Conversation::on("http").browsing("GET /?req=x HTTP/1.1\r\n\r\n", 0);
    browser.take("reply", 12);
    all.push(browser);
    all
}

/// Returns the scripts of readers that connect themselves, with the expected bytes: `content`, over
/// `mjpeg` an image.
pub(crate) fn viewers(content: &Bottle) -> Vec<Conversation> {
    let mut all: Vec<_> = STREAMS
        .into_iter()
        .filter(|spelled| !spelled.starts_with("unix_stream"))
        .map(|spelled| {
            let mut conversation = Conversation::on(spelled).opened_by_peer();
            let turn = parts(conversation.carrier, &Command::Reverse, &Bottle::new());
            for (_, bytes) in turn {
                conversation.give("turn", &bytes);
            }
            let acknowledged = conversation.acknowledgement().len();
            conversation.take("turn", acknowledged);
            conversation.take_message(&Command::data(false), content);
            conversation.give_acknowledgement();
            conversation
        })
        .collect();
    let mut page = upgraded();
    page.give(
        "turn",
        &[0x82, 0x88, 0, 0, 0, 0, 0, 0, 0, 0, b'~', b'r', 0, 1],
    );
    page.take_message(&Command::data(false), content);
    all.push(page);
    let mut browser = Conversation::on("http").browsing("GET /r HTTP/1.1\r\n\r\n", 12);
    browser.take("payload", 20);
    all.push(browser);
    let request = "GET /?action=stream HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let mut viewer = Conversation::on("mjpeg").browsing(request, RESPONSE.len());
    viewer.take("payload", 100);
    all.push(viewer);
    all
}

/// Returns the scripts of readers to which the port `writer` connects.
pub(crate) fn readers(writer: &str, content: &Bottle) -> Vec<Conversation> {
    let mut all: Vec<_> = STREAMS
        .into_iter()
        .map(|spelled| {
            let mut conversation = Conversation::on(spelled).opened_by_port(writer);
            conversation.take_message(&Command::data(false), content);
            conversation.give_acknowledgement();
            conversation
        })
        .collect();
    all.extend(DATAGRAMS.map(|spelled| Conversation::on(spelled).opened_by_port(writer)));
    all.push(
        Conversation::on("shmem")
            .opened_by_port(writer)
            .listened_for_memory(),
    );
    let leaving = STREAMS.into_iter().chain(DATAGRAMS).map(|spelled| {
        let conversation = Conversation::on(spelled).opened_by_port(writer);
        conversation.then("goodbye", |conversation| {
            if conversation.carrier.connectionless {
                // Its writer sends it over another connection.
                conversation.steps.push(("goodbye", Step::AcceptAgain));
                conversation.take("name", "CONNACK admin\r\n".len());
                conversation.give("header reply", b"Welcome admin\r\n");
                conversation.take("command", format!("~{writer}\r\n").len());
                conversation.give("reply", b"Removing connection\r\n");
                conversation.give("acknowledgement", b"<ACK>\r\n");
                return;
            }
            for (phase, bytes) in parts(conversation.carrier, &Command::Quit, &Bottle::new()) {
                conversation.take(phase, bytes.len());
            }
            conversation.give_acknowledgement();
        })
    });
    all.extend(leaving);
    all
}

/// Returns the scripts of servers to which the port `client` connects.
pub(crate) fn servers(client: &str, question: &Bottle, answer: &Bottle) -> Vec<Conversation> {
    STREAMS
        .into_iter()
        .map(|spelled| {
            let mut conversation = Conversation::on(spelled).opened_by_port(client);
            conversation.take_message(&Command::data(true), question);
            let reply = conversation.reply(answer);
            conversation.give("reply", &reply);
            conversation.give_acknowledgement();
            conversation
        })
        .collect()
}

/// Returns the script of a camera at TCP port `number`, which sends `picture` once.
pub(crate) fn camera(number: u16, picture: &[u8]) -> Conversation {
    let mut camera = Conversation::on("mjpeg");
    let asked = request(None, &format!("127.0.0.1:{number}"));
    camera.take("request", asked.len());
    camera.give("header reply", RESPONSE.as_bytes());
    let mut part = BytesMut::new();
    put_part(&mut part, picture);
    camera.give("payload", &part);
    camera
}

/// Those whose messages come over the connection.
const STREAMS: [&str; 6] = [
    "tcp",
    "fast_tcp",
    "text",
    "text_ack",
    "unix_stream",
    "unix_stream+ack",
];
const DATAGRAMS: [&str; 2] = ["udp", "mcast"];

/// Returns a page that has turned its request into a connection.
fn upgraded() -> Conversation {
    let request = "GET /?ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n\
        Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
        Sec-WebSocket-Version: 13\r\n\r\n";
    Conversation::on("websocket").browsing(request, 129)
}

/// Returns the key that those share who have one.
pub(crate) fn key() -> Key {
    Key::new(b"my_secret_key").unwrap()
}

/// Returns the answer to a header.
fn welcome(carrier: &Carrier, name: &str) -> BytesMut {
    let mut bytes = BytesMut::new();
    match carrier.protocol.payload_kind() {
        PayloadKind::Text => bytes.extend_from_slice(format!("Welcome {name}\r\n").as_bytes()),
        _ => header_reply(9, &mut bytes),
    }
    bytes
}

fn letter(command: &Command) -> u8 {
    match command {
        Command::Data { reply: true, .. } => b'd',
        Command::Admin => b'a',
        _ => b'D',
    }
}

/// Returns the parts of a message as a port sends them.
fn parts(carrier: &Carrier, command: &Command, content: &Bottle) -> Vec<(&'static str, BytesMut)> {
    let mut bytes = BytesMut::new();
    let has_payload = command.has_payload();
    let content = has_payload.then_some(content as _);
    put_message(&mut bytes, carrier, command, content, WireVersion::V3);
    let mut parts = Vec::new();
    match carrier.name {
        "text" | "text_ack" => {
            let line = bytes.iter().position(|byte| *byte == b'\n').unwrap() + 1;
            parts.push(("command", bytes.split_to(line)));
        }
        "tcp" | "fast_tcp" | "udp" | "mcast" | "shmem" => {
            let command_begins = bytes.windows(1).rposition(|byte| byte == b"~").unwrap() - 4;
            parts.push(("index", bytes.split_to(command_begins)));
            parts.push(("command", bytes.split_to(command.block_len())));
        }
        "websocket" => {
            // Two frames with short heads.
            parts.push(("index", bytes.split_to(2)));
            parts.push(("command", bytes.split_to(command.block_len())));
        }
        _ => parts.push(("command", bytes.split_to(command.block_len()))),
    }
    if has_payload {
        parts.push(("payload", bytes));
    }
    parts
}

/// The connection of somebody who is about to die.
#[derive(Debug)]
pub(crate) enum Peer {
    Tcp(TcpStream),
    Unix(UnixStream),
}

impl Peer {
    fn stream(&mut self) -> &mut (dyn Both + Unpin + Send) {
        match self {
            Self::Tcp(stream) => stream,
            Self::Unix(stream) => stream,
        }
    }

    async fn give(&mut self, bytes: &[u8]) {
        self.stream().write_all(bytes).await.unwrap();
    }

    async fn take(&mut self, count: usize) -> Vec<u8> {
        let mut bytes = vec![0; count];
        self.stream().read_exact(&mut bytes).await.unwrap();
        bytes
    }

    /// The first `left` bytes of the handshake of keys.
    async fn shake_hands(&mut self, side: Side, mut left: usize) {
        let (mut input, mut output) = (BytesMut::new(), BytesMut::new());
        let mut handshake = match side {
            Side::Connects => KeyHandshake::initiate(key(), [2; 8]),
            Side::Listens => KeyHandshake::accept(key(), [[1; 8], [3; 8]], &mut output),
        };
        while left > 0 {
            let given = output.split_to(left.min(output.len()));
            self.give(&given).await;
            left -= given.len();
            let missing = left.min(handshake.missing(&input));
            input.extend_from_slice(&self.take(missing).await);
            left -= missing;
            handshake.poll(&mut input, &mut output).unwrap();
        }
    }

    /// Ends the connection.
    pub(crate) fn die(self, death: Death) {
        if let (Self::Tcp(stream), Death::Resets) = (&self, death) {
            let now = Some(std::time::Duration::ZERO);
            SockRef::from(stream).set_linger(now).unwrap();
        }
    }
}

trait Both: AsyncRead + AsyncWrite {}

impl<T: AsyncRead + AsyncWrite> Both for T {}

/// Returns the path of the socket of a connection over `unix_stream`; see
/// `ports/src/unix_socket.rs`.
fn unix_path(acceptor: u16, initiator: u16) -> PathBuf {
    let variable = |name| std::env::var(name).ok().filter(|value| !value.is_empty());
    let folder = match (variable("YARP_RUNTIME_DIR"), variable("XDG_RUNTIME_DIR")) {
        (Some(folder), _) => PathBuf::from(folder),
        (None, Some(folder)) => PathBuf::from(folder).join("yarp"),
        (None, None) => {
            let user = variable("USER").unwrap_or_default();
            PathBuf::from(format!("/tmp/runtime-{user}/yarp"))
        }
    };
    folder.join(format!("{acceptor}_{initiator}.sock"))
}

async fn connect_unix(acceptor: u16, initiator: u16) -> Peer {
    loop {
        if let Ok(stream) = UnixStream::connect(unix_path(acceptor, initiator)).await {
            return Peer::Unix(stream);
        }
        tokio::time::sleep(std::time::Duration::from_millis(1)).await;
    }
}

async fn accept_unix(acceptor: u16, initiator: u16) -> Peer {
    let path = unix_path(acceptor, initiator);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let listener = UnixListener::bind(&path).unwrap();
    let (stream, _) = listener.accept().await.unwrap();
    let _ = std::fs::remove_file(&path);
    Peer::Unix(stream)
}
