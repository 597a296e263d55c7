//! The server's side: what runs beside the hand.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tracing::{debug, info, warn};

use super::super::gcl_connection::GclConnection;
use super::super::gcl_connection::check_characters;
use super::super::serial_line::is_pause;
use super::node_protocol::{NodeReply, Request, RequestReader};
use super::remote_hand::words;
use crate::DeviceError;

/// Interval between attempts to connect to a driver.
const RECONNECT_INTERVAL: Duration = Duration::from_secs(1);
/// Timeout of one read on the connection.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Timeout of writing a reply to the driver.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Maximum number of requests behind the one being executed. A driver sends one at a time.
const MAX_QUEUED_REQUESTS: usize = 2;

/// The hand server: connects to a driver and carries out its requests, one after the other.
///
/// * Without a driver it tries to connect to one each second; when one disconnects, it stops a motion in progress.
/// * Something that is no request is answered `q`, and the connection is closed.
/// * Dedicated threads do all of it; dropping the server stops a motion in progress and joins them.
#[derive(Debug)]
pub struct HandNode {
    ending: Arc<AtomicBool>,
    connected: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl HandNode {
    /// Starts to look for a driver at `driver`.
    ///
    /// Errors: [`DeviceError::Start`] when the machine has no thread left.
    pub fn start(hand: Arc<dyn GclConnection>, driver: SocketAddr) -> Result<Self, DeviceError> {
        let ending = Arc::new(AtomicBool::new(false));
        let connected = Arc::new(AtomicBool::new(false));
        let node = Node {
            hand,
            driver,
            ending: Arc::clone(&ending),
            connected: Arc::clone(&connected),
        };
        let thread = thread::Builder::new()
            .name("hand-node".into())
            .spawn(move || node.run())
            .map_err(|source| DeviceError::Start {
                what: "the thread of the hand server",
                source,
            })?;
        Ok(Self {
            ending,
            connected,
            thread: Some(thread),
        })
    }

    /// Returns whether a driver is connected.
    pub fn is_connected(&self) -> bool {
        self.connected.load(Ordering::Acquire)
    }
}

impl Drop for HandNode {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            if thread.join().is_err() {
                tracing::error!("the thread of the hand server had panicked");
            }
        }
    }
}

struct Node {
    hand: Arc<dyn GclConnection>,
    driver: SocketAddr,
    ending: Arc<AtomicBool>,
    connected: Arc<AtomicBool>,
}

impl Node {
    fn is_ending(&self) -> bool {
        self.ending.load(Ordering::Acquire)
    }

    fn run(&self) {
        while !self.is_ending() {
            let next = Instant::now() + RECONNECT_INTERVAL;
            match TcpStream::connect_timeout(&self.driver, RECONNECT_INTERVAL) {
                Ok(stream) => {
                    info!(driver = %self.driver, "connected to the driver of the hand");
                    self.connected.store(true, Ordering::Release);
                    if let Err(error) = self.serve(stream) {
                        warn!(driver = %self.driver, %error, "the driver of the hand is gone");
                    }
                    self.connected.store(false, Ordering::Release);
                }
                Err(error) => debug!(driver = %self.driver, %error, "no driver yet"),
            }
            while !self.is_ending() && Instant::now() < next {
                thread::park_timeout(next - Instant::now());
            }
        }
    }

    /// One connection, until it ends or makes no sense.
    fn serve(&self, mut stream: TcpStream) -> std::io::Result<()> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(POLL_INTERVAL))?;
        stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
        let answers = stream.try_clone()?;
        let at_work = AtomicBool::new(false);
        let (requests, waiting) = sync_channel(MAX_QUEUED_REQUESTS);
        thread::scope(|scope| {
            let worker = scope.spawn(|| self.work(waiting, answers, &at_work));
            let outcome = self.listen(&mut stream, |request| {
                if request == Request::Abort {
                    self.stop_all(&at_work);
                }
                at_work.store(true, Ordering::Release);
                requests.try_send(request).is_ok()
            });
            drop(requests);
            // The client of a motion is gone: it ends.
            while !worker.is_finished() {
                self.stop_all(&at_work);
                thread::sleep(POLL_INTERVAL);
            }
            outcome
        })
    }

    /// Reads requests; stops the hand as soon as an abort arrives.
    fn listen(
        &self,
        stream: &mut TcpStream,
        mut pass_on: impl FnMut(Request) -> bool,
    ) -> std::io::Result<()> {
        let mut reader = RequestReader::new();
        let mut buffer = [0; 512];
        while !self.is_ending() {
            match stream.read(&mut buffer) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => reader.push(&buffer[..count]),
                Err(error) if is_pause(&error) => continue,
                Err(error) => return Err(error),
            }
            loop {
                match reader.next_request() {
                    Ok(None) => break,
                    Ok(Some(request)) => {
                        if !pass_on(request) {
                            return Err(std::io::Error::other("too many requests at once"));
                        }
                    }
                    Err(error) => {
                        stream.write_all(b"q")?;
                        return Err(std::io::Error::new(ErrorKind::InvalidData, error));
                    }
                }
            }
        }
        Ok(())
    }

    /// Stops the hand until nothing is carried out any more, also what was about to begin.
    fn stop_all(&self, at_work: &AtomicBool) {
        while at_work.load(Ordering::Acquire) {
            if let Err(error) = self.hand.abort() {
                warn!(hand = self.hand.peer(), %error, "the hand could not be stopped");
            }
            thread::sleep(POLL_INTERVAL);
        }
    }

    /// Executes requests and replies, in their order, until there are no more or replies cannot be sent.
    fn work(&self, requests: Receiver<Request>, mut answers: TcpStream, at_work: &AtomicBool) {
        while let Ok(request) = requests.recv() {
            at_work.store(true, Ordering::Release);
            let reply = self.carry_out(&request);
            at_work.store(false, Ordering::Release);
            if answers.write_all(&reply.to_bytes()).is_err() {
                return;
            }
        }
    }

    fn carry_out(&self, request: &Request) -> NodeReply {
        let lines = request.lines();
        let outcome = match request {
            Request::Command(line) => check_characters(line).and_then(|()| self.hand.run(&lines)),
            // The motion had ended when this arrived; another program may still use the hand.
            Request::Abort => self.hand.abort().map(|()| Vec::new()),
            _ => self.hand.run(&lines),
        };
        let (done, text) = match outcome {
            Ok(mut replies) => (true, replies.pop().unwrap_or_default().text),
            Err(error) => {
                warn!(request = lines.join(", "), %error, "the hand did not do it");
                let text = error.status().map_or_else(|| error.to_string(), words);
                (false, text)
            }
        };
        NodeReply {
            done,
            text: request.has_text().then_some(text),
        }
    }
}
