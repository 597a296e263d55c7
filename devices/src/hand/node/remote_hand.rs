//! The driver's side: waits for the server to connect, and sends it requests.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, TryLockError};
use std::thread;
use std::time::{Duration, Instant};

use tracing::{info, warn};

use super::super::gcl::{Reply, Status};
use super::super::gcl_connection::GclConnection;
use super::super::hand_error::HandError;
use super::super::serial_driver::judge;
use super::super::serial_line::is_pause;
use super::node_protocol::{NodeReply, NodeReplyReader, Request};

/// Timeout of one read on the connection: the maximum delay of an abort.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Options of a hand behind a server.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteHandOptions {
    connect_timeout: Duration,
    motion_timeout: Duration,
}

impl Default for RemoteHandOptions {
    fn default() -> Self {
        Self::new()
    }
}

impl RemoteHandOptions {
    /// 5 s for the server to connect; a minute for a request, which may be several commands of 15 s.
    pub fn new() -> Self {
        Self {
            connect_timeout: Duration::from_secs(5),
            motion_timeout: Duration::from_secs(60),
        }
    }

    /// Sets the time that a call waits for the server to connect, if it is not connected.
    pub fn connect_timeout(mut self, connect_timeout: Duration) -> Self {
        self.connect_timeout = connect_timeout;
        self
    }

    /// Sets the timeout of a request.
    pub fn motion_timeout(mut self, motion_timeout: Duration) -> Self {
        self.motion_timeout = motion_timeout;
        self
    }
}

/// A hand whose server connects to this program.
///
/// It is a [`Hand`](crate::Hand) and a [`Grasp`](crate::Grasp) as [`BarrettHand`](crate::hand::BarrettHand) is, and
/// calls block as long. For commands with a header of their own the server reports only that they failed, not why.
#[derive(Debug)]
pub struct RemoteHand {
    listener: TcpListener,
    place: SocketAddr,
    name: String,
    options: RemoteHandOptions,
    connection: Mutex<Option<TcpStream>>,
    abort: AtomicBool,
    connected: AtomicBool,
}

impl RemoteHand {
    /// Waits on an address from now on; the server may come later.
    ///
    /// Errors: [`HandError::Open`].
    pub fn listen(
        address: impl ToSocketAddrs,
        options: RemoteHandOptions,
    ) -> Result<Self, HandError> {
        let open = || {
            let listener = TcpListener::bind(address)?;
            listener.set_nonblocking(true)?;
            let place = listener.local_addr()?;
            Ok((listener, place))
        };
        let (listener, place) = open().map_err(|source| HandError::Open { source })?;
        Ok(Self {
            listener,
            place,
            name: format!("the hand server at {place}"),
            options,
            connection: Mutex::new(None),
            abort: AtomicBool::new(false),
            connected: AtomicBool::new(false),
        })
    }

    /// Returns the address at which it listens.
    pub fn address(&self) -> SocketAddr {
        self.place
    }

    /// Puts the hand in its home position: fingers to 4000 counts, then all four motors close.
    ///
    /// Errors: [`HandError`].
    pub fn home(&self) -> Result<(), HandError> {
        self.requests(&[Request::Home]).map(drop)
    }

    fn requests(&self, requests: &[Request]) -> Result<Vec<Reply>, HandError> {
        let mut connection = match self.connection.try_lock() {
            Ok(connection) => connection,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                let doing = "another request".to_owned();
                return Err(HandError::Busy { doing });
            }
        };
        let mut replies = Vec::new();
        let mut aborted = false;
        for request in requests {
            let text = request.lines().join(", ");
            if aborted {
                return Err(HandError::Aborted { command: text });
            }
            if connection.is_none() {
                *connection = Some(self.arrive()?);
                self.connected.store(true, Ordering::Release);
            }
            let stream = connection.as_mut().expect("it was just put there");
            match self.request(stream, request, &text, &mut aborted) {
                Ok(reply) => replies.push(judged(&text, reply)?),
                Err(error) => {
                    // What is on its way back belongs to nothing any more.
                    *connection = None;
                    self.connected.store(false, Ordering::Release);
                    warn!(hand = %self.name, %error, "the connection to the hand is given up");
                    return Err(error);
                }
            }
        }
        Ok(replies)
    }

    /// Waits for the server.
    fn arrive(&self) -> Result<TcpStream, HandError> {
        let deadline = Instant::now() + self.options.connect_timeout;
        loop {
            match self.listener.accept() {
                Ok((stream, peer)) => {
                    let prepare = || {
                        stream.set_nonblocking(false)?;
                        stream.set_nodelay(true)?;
                        stream.set_read_timeout(Some(POLL_INTERVAL))?;
                        stream.set_write_timeout(Some(self.options.connect_timeout))?;
                        Ok(())
                    };
                    prepare().map_err(|source| HandError::Open { source })?;
                    info!(hand = %self.name, %peer, "the hand server has connected");
                    return Ok(stream);
                }
                Err(_) if Instant::now() < deadline => thread::sleep(POLL_INTERVAL),
                Err(_) => {
                    let source = io::Error::new(
                        io::ErrorKind::NotConnected,
                        format!("no hand server has connected to {}", self.place),
                    );
                    return Err(HandError::Open { source });
                }
            }
        }
    }

    fn request(
        &self,
        stream: &mut TcpStream,
        request: &Request,
        text: &str,
        aborted: &mut bool,
    ) -> Result<NodeReply, HandError> {
        let lost = |step: &str| {
            let step = format!("{step} `{text}`");
            move |source| HandError::LineLost { step, source }
        };
        let bytes = request.to_bytes();
        stream.write_all(&bytes).map_err(lost("sending"))?;
        let mut answers = vec![NodeReplyReader::new(request)];
        let mut got = Vec::new();
        let deadline = Instant::now() + self.options.motion_timeout;
        while Instant::now() < deadline {
            if self.abort.swap(false, Ordering::AcqRel) {
                *aborted = true;
                let abort = Request::Abort;
                stream
                    .write_all(&abort.to_bytes())
                    .map_err(lost("aborting"))?;
                answers.push(NodeReplyReader::new(&abort));
            }
            let mut byte = [0];
            match stream.read(&mut byte) {
                Ok(0) => {
                    let source = io::ErrorKind::UnexpectedEof.into();
                    return Err(lost("waiting for the answer to")(source));
                }
                Ok(_) => {}
                Err(error) if is_pause(&error) => continue,
                Err(source) => return Err(lost("waiting for the answer to")(source)),
            }
            // The answer to the request first, then those to aborts.
            let expected = answers[got.len()].push(byte[0]);
            let unreadable = |byte: u8| HandError::Unreadable {
                command: text.to_owned(),
                answer: byte.escape_ascii().to_string(),
                expected: "`d` or `q`",
            };
            if let Some(reply) = expected.map_err(unreadable)? {
                got.push(reply);
            }
            if got.len() == answers.len() {
                return Ok(got.swap_remove(0));
            }
        }
        Err(HandError::NoPrompt {
            command: text.to_owned(),
            waited: self.options.motion_timeout,
            got: String::new(),
        })
    }
}

impl GclConnection for RemoteHand {
    fn peer(&self) -> &str {
        &self.name
    }

    fn run(&self, lines: &[String]) -> Result<Vec<Reply>, HandError> {
        let requests: Vec<Request> = lines.iter().map(|line| Request::of_line(line)).collect();
        self.requests(&requests)
    }

    fn abort(&self) -> Result<(), HandError> {
        self.abort.store(true, Ordering::Release);
        let deadline = Instant::now() + self.options.motion_timeout;
        while self.abort.load(Ordering::Acquire) {
            // No reply is awaited: the abort is a request of its own.
            match self.requests(&[]) {
                Ok(_) if self.abort.swap(false, Ordering::AcqRel) => {
                    return self.requests(&[Request::Abort]).map(drop);
                }
                Err(busy) if Instant::now() > deadline => return Err(busy),
                Ok(_) | Err(_) => thread::sleep(Duration::from_millis(1)),
            }
        }
        Ok(())
    }

    fn is_connected(&self) -> bool {
        self.connected.load(Ordering::Acquire)
    }
}

/// The hand's answer, its complaint, or the server's refusal.
fn judged(text: &str, reply: NodeReply) -> Result<Reply, HandError> {
    let done = reply.done;
    let reply = judge(text, reply.into_reply())?;
    match done {
        true => Ok(reply),
        false => Err(HandError::Refused {
            command: text.to_owned(),
            answer: match reply.text.is_empty() {
                true => "q".to_owned(),
                false => reply.text,
            },
        }),
    }
}

/// Returns the server's text of an error: the hand's own words.
pub(super) fn words(status: Status) -> String {
    format!("ERR {}", status.bits())
}
