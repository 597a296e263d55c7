//! Sockets of the file system for connections within one machine.
//!
//! Such a stream tells whoever waits for it of every few bytes, and its writer pays for that; so the runtime waits for it
//! only while a task sleeps on it, and not while one looks for bytes itself ([`BusyPoll`](crate::latency::BusyPoll)). To begin
//! and end that takes system calls and memory; so where the task went to sleep after all it stays begun for a while.
//!
//! Both ends know the TCP ports of the header's connection and derive the path from them:
//! `DIR/<acceptor's TCP port>_<initiator's TCP port>.sock`. The acceptor makes the socket.
//!
//! **Invariant:** both ends belong to the same user, or the other one to root; DIR is this user's, and nobody else's to enter.

use std::fs::{DirBuilder, Metadata, Permissions};
use std::io::{self, IoSlice, Write};
use std::mem;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::os::unix::net;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::BufMut;
use socket2::SockRef;
use tokio::net::{TcpStream, UnixListener, UnixStream};

use crate::latency::Optimisation;

/// Timeout of the initiator's connection.
const ACCEPT_TIMEOUT: Duration = Duration::from_secs(5);
/// Interval and maximum number of the initiator's attempts; stock has 5.
const RETRY_INTERVAL: Duration = Duration::from_millis(20);
const MAX_TRIES: usize = 50;
/// Tries that are left once the header's connection has ended: most likely the acceptor has died.
const MAX_TRIES_AFTER_CLOSE: usize = 5;

/// The mode of sockets and their folder.
const PRIVATE: u32 = 0o700;
/// The bit of a folder in which only owners take their files away.
const STICKY: u32 = 0o1000;
const ROOT: u32 = 0;

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
    /// Wraps a stream, which must be non-blocking.
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
        if Optimisation::UnixSendBuffer.is_enabled() {
            let _ = SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER_LEN);
        }
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
    std::fs::set_permissions(&path, Permissions::from_mode(PRIVATE))?;
    let accepted = tokio::time::timeout(ACCEPT_TIMEOUT, listener.accept()).await;
    // No other peer may connect; the connection itself stays.
    let _ = std::fs::remove_file(&path);
    let (stream, _) = accepted.map_err(|_| io::ErrorKind::TimedOut)??;
    check_peer(&stream)?;
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
            Ok(stream) => {
                check_peer(&stream)?;
                return Unix::with_room(stream);
            }
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
    prepare(&folder)?;
    Ok(folder.join(format!("{acceptor}_{initiator}.sock")))
}

/// Makes the folder of sockets if it is not there, and makes sure that no other user can put sockets into it or take them
/// away.
fn prepare(folder: &Path) -> io::Result<()> {
    let own = rustix::process::geteuid().as_raw();
    DirBuilder::new()
        .recursive(true)
        .mode(PRIVATE)
        .create(folder)?;
    let wrong = |folder: &Path, about: &Metadata, expected: &str| {
        let message = format!(
            "the folder of sockets cannot be trusted: {} belongs to user {} with mode {:03o}, expected {expected}; \
             set YARP_RUNTIME_DIR or XDG_RUNTIME_DIR to a folder of your own",
            folder.display(),
            about.uid(),
            about.mode() & 0o7777,
        );
        io::Error::new(io::ErrorKind::PermissionDenied, message)
    };
    if let Some(above) = folder
        .parent()
        .filter(|above| !above.as_os_str().is_empty())
    {
        let about = std::fs::metadata(above)?;
        let is_shared = about.mode() & 0o022 != 0 && about.mode() & STICKY == 0;
        if ![own, ROOT].contains(&about.uid()) || is_shared {
            let expected = format!("user {own} or root, and nobody else to write there");
            return Err(wrong(above, &about, &expected));
        }
    }
    let about = std::fs::symlink_metadata(folder)?;
    // Stock makes it for others to read; that is harmless, as the sockets in it are this user's alone.
    match about.is_dir() && about.uid() == own && about.mode() & 0o022 == 0 {
        true => Ok(()),
        false => {
            let expected =
                format!("a folder of user {own} where nobody else writes, such as mode 700");
            Err(wrong(folder, &about, &expected))
        }
    }
}

/// Returns whether the program at the other end is one that may be there: of the same user, or of root.
fn check_peer(stream: &UnixStream) -> io::Result<()> {
    let user = stream.peer_cred()?.uid();
    let own = rustix::process::geteuid().as_raw();
    match is_trusted(user, own) {
        true => Ok(()),
        false => {
            let message = format!(
                "a program of user {user} is at the other end, expected user {own} or root"
            );
            Err(io::Error::new(io::ErrorKind::PermissionDenied, message))
        }
    }
}

fn is_trusted(user: u32, own: u32) -> bool {
    user == own || user == ROOT
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use tokio::time::timeout;

    use super::*;

    #[test]
    fn the_folder_is_private() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("a/yarp");
        prepare(&folder).unwrap();
        let mode = |folder: &Path| std::fs::metadata(folder).unwrap().mode() & 0o777;
        assert_eq!(
            (mode(&folder), mode(folder.parent().unwrap())),
            (PRIVATE, PRIVATE)
        );
        // As stock leaves it.
        std::fs::set_permissions(&folder, Permissions::from_mode(0o755)).unwrap();
        prepare(&folder).unwrap();
        for shared in [0o775, 0o757, 0o1777] {
            std::fs::set_permissions(&folder, Permissions::from_mode(shared)).unwrap();
            let error = prepare(&folder).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::PermissionDenied, "{error}");
        }
        std::fs::set_permissions(&folder, Permissions::from_mode(PRIVATE)).unwrap();
        // Others could replace it.
        std::fs::set_permissions(folder.parent().unwrap(), Permissions::from_mode(0o777)).unwrap();
        let error = prepare(&folder).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::PermissionDenied, "{error}");
        std::fs::set_permissions(folder.parent().unwrap(), Permissions::from_mode(0o1777)).unwrap();
        prepare(&folder).unwrap();
        // Somebody was here first. Without root it is a folder of root's that stands for it.
        let others = place.path().join("b");
        DirBuilder::new().create(&others).unwrap();
        let others = match std::os::unix::fs::chown(&others, Some(65534), None) {
            Ok(()) => others,
            Err(_) => PathBuf::from("/proc/sys"),
        };
        let error = prepare(&others).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::PermissionDenied, "{error}");
        let error = prepare(&others.join("yarp")).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::PermissionDenied, "{error}");
        let link = place.path().join("link");
        std::os::unix::fs::symlink(&folder, &link).unwrap();
        assert!(prepare(&link).is_err());
    }

    #[tokio::test]
    async fn the_socket_is_private() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let initiator = TcpStream::connect(listener.local_addr().unwrap());
        let initiator = initiator.await.unwrap();
        let (acceptor, _) = listener.accept().await.unwrap();
        let number = |address: io::Result<std::net::SocketAddr>| address.unwrap().port();
        let place = path(
            number(acceptor.local_addr()),
            number(initiator.local_addr()),
        );
        let place = place.unwrap();
        let accepting = tokio::spawn(async move { accept(&acceptor).await.map(drop) });
        let mode = || std::fs::metadata(&place).map(|found| found.mode() & 0o777);
        let waiting = async {
            while mode().ok() != Some(PRIVATE) {
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
        };
        let patience = Duration::from_secs(4);
        timeout(patience, waiting).await.expect("mode 700");
        connect(&initiator, &mut [0; 8]).await.unwrap();
        accepting.await.unwrap().unwrap();
        assert!(mode().is_err(), "nobody else connects");
    }

    #[tokio::test]
    async fn only_the_same_user_and_root_are_trusted() {
        assert!(is_trusted(1000, 1000) && is_trusted(0, 1000) && is_trusted(0, 0));
        assert!(!is_trusted(1001, 1000) && !is_trusted(1000, 0));
        let (one, _other) = UnixStream::pair().unwrap();
        check_peer(&one).unwrap();
    }

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
