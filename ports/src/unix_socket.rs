//! Unix sockets for connections within one machine.
//!
//! Such a stream reports readiness for every few bytes, at the expense of its writer; so the
//! runtime waits for it only while a task sleeps on it, and not while the task polls
//! ([`BusyPoll`](crate::busy_poll::BusyPoll)). RegisterRequest and deregistering takes system calls and
//! memory; so after a task did sleep, the stream stays registered for a while.
//!
//! Both ends know the TCP ports of the header's connection and derive the path from them:
//! `DIR/<acceptor's TCP port>_<initiator's TCP port>.sock`. The acceptor creates the socket.

use std::io::{self, IoSlice, Write};
use std::mem;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::net;
use std::path::PathBuf;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::BufMut;
use socket2::SockRef;
use tokio::net::{TcpStream, UnixListener, UnixStream};

/// Timeout of the initiator's connection.
const ACCEPT_TIMEOUT: Duration = Duration::from_secs(5);
/// Interval and maximum number of the initiator's attempts; stock has 5.
const RETRY_INTERVAL: Duration = Duration::from_millis(20);
const MAX_TRIES: usize = 50;
/// Tries that are left once the header's connection has ended: most likely the acceptor has died.
const MAX_TRIES_AFTER_CLOSE: usize = 5;

/// Size of the send buffer in bytes. The system reports room to a writer once no more than a
/// quarter of it is used; with a smaller buffer the reader would have read that quarter before more
/// arrives.
const SEND_BUFFER_LEN: usize = 300_000;

/// Number of suppressions to skip after a task slept on the stream.
const SUPPRESSIONS_SKIPPED: u32 = 2;

/// A stream that the runtime waits for only while a task sleeps on it.
#[derive(Debug)]
pub(crate) struct Unix {
    stream: net::UnixStream,
    copy: Mutex<RuntimeCopy>,
    /// Number of suppressions still to skip.
    suppressions_to_skip: AtomicU32,
}

/// A duplicate of the descriptor, created once: an existing connection continues where descriptors
/// are scarce.
#[derive(Debug)]
enum RuntimeCopy {
    /// The runtime waits for it.
    Registered(Arc<UnixStream>),
    Unregistered(net::UnixStream),
    /// The system would not have it changed from one to the other.
    Lost,
}

impl Unix {
    /// Returns the stream needs to be non-blocking.
    fn new(stream: net::UnixStream) -> io::Result<Self> {
        let copy = Mutex::new(RuntimeCopy::Unregistered(stream.try_clone()?));
        let suppressions_to_skip = AtomicU32::new(0);
        Ok(Self {
            stream,
            copy,
            suppressions_to_skip,
        })
    }

    fn with_room(stream: UnixStream) -> io::Result<Self> {
        // Less room only makes large messages slower.
        let _ = SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER_LEN);
        Self::new(stream.into_std()?)
    }

    fn copy(&self) -> MutexGuard<'_, RuntimeCopy> {
        self.copy.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn registered(&self) -> io::Result<Arc<UnixStream>> {
        let mut copy = self.copy();
        let stream = match mem::replace(&mut *copy, RuntimeCopy::Lost) {
            RuntimeCopy::Registered(stream) => stream,
            RuntimeCopy::Unregistered(stream) => {
                self.suppressions_to_skip
                    .store(SUPPRESSIONS_SKIPPED, Relaxed);
                Arc::new(UnixStream::from_std(stream)?)
            }
            RuntimeCopy::Lost => return Err(io::ErrorKind::NotConnected.into()),
        };
        *copy = RuntimeCopy::Registered(stream.clone());
        Ok(stream)
    }

    /// Suppresses all wake-ups until a task waits; skipped if a task slept recently.
    pub(crate) fn suppress_wakeups(&self) {
        let still = |suppressions_to_skip: u32| suppressions_to_skip.checked_sub(1);
        if self
            .suppressions_to_skip
            .fetch_update(Relaxed, Relaxed, still)
            .is_ok()
        {
            return;
        }
        let mut copy = self.copy();
        *copy = match mem::replace(&mut *copy, RuntimeCopy::Lost) {
            RuntimeCopy::Registered(stream) => match Arc::try_unwrap(stream) {
                Ok(stream) => stream
                    .into_std()
                    .map_or(RuntimeCopy::Lost, RuntimeCopy::Unregistered),
                // A task waits on it.
                Err(stream) => RuntimeCopy::Registered(stream),
            },
            other => other,
        };
    }

    pub(crate) async fn readable(&self) -> io::Result<()> {
        self.registered()?.readable().await
    }

    pub(crate) async fn writable(&self) -> io::Result<()> {
        self.registered()?.writable().await
    }

    /// Reads available bytes, according to the runtime, into the spare capacity of `buffer`.
    pub(crate) fn try_read_buf(&self, buffer: &mut impl BufMut) -> io::Result<usize> {
        self.registered()?.try_read_buf(buffer)
    }

    /// Writes what fits.
    pub(crate) fn try_write_vectored(&self, chunks: &[IoSlice<'_>]) -> io::Result<usize> {
        match &*self.copy() {
            RuntimeCopy::Registered(stream) => stream.try_write_vectored(chunks),
            RuntimeCopy::Unregistered(_) | RuntimeCopy::Lost => {
                (&self.stream).write_vectored(chunks)
            }
        }
    }
}

impl TryFrom<OwnedFd> for Unix {
    type Error = io::Error;

    fn try_from(stream: OwnedFd) -> io::Result<Self> {
        Self::new(stream.into())
    }
}

impl AsFd for Unix {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }
}

/// Goes on as acceptor of the connection that `header` began.
pub(crate) async fn accept(header: &TcpStream) -> io::Result<Unix> {
    let own = header.local_addr()?;
    let peer = header.peer_addr()?;
    if own.ip() != peer.ip() {
        let message = format!("{} is another machine", peer.ip());
        return Err(io::Error::other(message));
    }
    let path = path(own.port(), peer.port())?;
    // Left behind by a process that had the same ports and was killed.
    let _ = std::fs::remove_file(&path);
    let listener = UnixListener::bind(&path)?;
    let accepted = tokio::time::timeout(ACCEPT_TIMEOUT, listener.accept()).await;
    // No other peer may connect; the connection itself stays.
    let _ = std::fs::remove_file(&path);
    let (stream, _) = accepted.map_err(|_| io::ErrorKind::TimedOut)??;
    Unix::with_room(stream)
}

/// Continues as initiator of the connection that `header` began; `answer` receives the bytes that
/// the acceptor sends on that connection instead.
pub(crate) async fn connect(header: &TcpStream, answer: &mut [u8; 8]) -> io::Result<Unix> {
    let path = path(header.peer_addr()?.port(), header.local_addr()?.port())?;
    let mut tries = MAX_TRIES;
    let mut said = 0;
    loop {
        match UnixStream::connect(&path).await {
            Ok(stream) => return Unix::with_room(stream),
            Err(error) if tries == 0 => {
                let message = format!("no socket at {}: {error}", path.display());
                return Err(io::Error::new(error.kind(), message));
            }
            Err(_) => tries -= 1,
        }
        tokio::time::sleep(RETRY_INTERVAL).await;
        match header.try_read(&mut answer[said..]) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            read => {
                said += read.unwrap_or(0);
                tries = tries.min(MAX_TRIES_AFTER_CLOSE);
            }
        }
    }
}

/// Returns the path of the socket between two TCP ports; creates the folder.
fn path(acceptor: u16, initiator: u16) -> io::Result<PathBuf> {
    let variable = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let folder = if let Some(folder) = variable("YARP_RUNTIME_DIR") {
        PathBuf::from(folder)
    } else if let Some(folder) = variable("XDG_RUNTIME_DIR") {
        PathBuf::from(folder).join("yarp")
    } else {
        let user = variable("USER").unwrap_or_default();
        let user = user.to_string_lossy();
        PathBuf::from(format!("/tmp/runtime-{user}")).join("yarp")
    };
    std::fs::create_dir_all(&folder)?;
    Ok(folder.join(format!("{acceptor}_{initiator}.sock")))
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use tokio::time::timeout;

    use super::*;

    #[tokio::test]
    async fn bytes_received_while_suppressed_wake_a_later_sleeper() {
        let (own, mut peer) = net::UnixStream::pair().unwrap();
        own.set_nonblocking(true).unwrap();
        let quiet = Unix::new(own).unwrap();
        let be_quiet = || (0..=SUPPRESSIONS_SKIPPED).for_each(|_| quiet.suppress_wakeups());
        for text in ["first", "second"] {
            be_quiet();
            assert!(
                matches!(*quiet.copy(), RuntimeCopy::Unregistered(_)),
                "nothing wakes the runtime"
            );
            peer.write_all(text.as_bytes()).unwrap();
            let mut bytes = Vec::new();
            let told = timeout(Duration::from_secs(60), quiet.readable()).await;
            told.expect("bytes are there").unwrap();
            assert_eq!(quiet.try_read_buf(&mut bytes).unwrap(), text.len());
            assert_eq!(bytes, text.as_bytes());
            let again = quiet.try_read_buf(&mut bytes).unwrap_err();
            assert_eq!(again.kind(), io::ErrorKind::WouldBlock);
        }
        // Nor is the end kept quiet.
        be_quiet();
        drop(peer);
        let told = timeout(Duration::from_secs(60), quiet.readable()).await;
        told.expect("the end is told").unwrap();
        assert_eq!(quiet.try_read_buf(&mut Vec::new()).unwrap(), 0);
    }

    #[tokio::test]
    async fn room_wakes_a_writer_while_suppressed() {
        let (own, mut peer) = net::UnixStream::pair().unwrap();
        own.set_nonblocking(true).unwrap();
        let quiet = Unix::new(own).unwrap();
        let much = vec![7; 1 << 16];
        let mut written = 0;
        while let Ok(count) = quiet.try_write_vectored(&[IoSlice::new(&much)]) {
            written += count;
        }
        let reading = std::thread::spawn(move || {
            let mut bytes = vec![0; written];
            std::io::Read::read_exact(&mut peer, &mut bytes).map(|()| peer)
        });
        let mut more = 0;
        while more == 0 {
            let told = timeout(Duration::from_secs(60), quiet.writable()).await;
            told.expect("there is room").unwrap();
            more = quiet
                .try_write_vectored(&[IoSlice::new(&much)])
                .unwrap_or(0);
        }
        reading.join().unwrap().unwrap();
    }
}
