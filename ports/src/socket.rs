//! Sockets of connections.

use std::future::Future;
use std::io::{self, IoSlice, Read};
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::Arc;
use std::time::Duration;

use bytes::{Buf, BufMut, BytesMut};
use socket2::{SockRef, TcpKeepalive};
use tokio::net::{TcpStream, UdpSocket};

use crate::error::PortError;
use crate::latency::{Optimisation, Tcp};
use crate::shmem::ShmemStream;
use crate::tls::TlsStream;
use crate::unix_socket::Unix;

/// The socket of a connection, by transport.
#[derive(Debug)]
pub(crate) enum Socket {
    Tcp(Tcp),
    Unix(Unix),
    Shmem(Box<ShmemStream>),
    /// Nothing: messages come as datagrams on this socket, and the stream of the header is closed.
    Datagrams(Arc<UdpSocket>),
    Tls(Box<TlsStream>),
}

macro_rules! either {
    ($socket:expr, $stream:ident => $call:expr) => {
        match $socket {
            Socket::Tcp($stream) => $call,
            Socket::Unix($stream) => $call,
            Socket::Shmem($stream) => $call,
            Socket::Datagrams(_) => Err(io::ErrorKind::NotConnected.into()),
            Socket::Tls($stream) => $call,
        }
    };
}

impl Socket {
    pub(crate) async fn readable(&self) -> io::Result<()> {
        self.readable_by(1).await
    }

    /// Waits like [`Socket::readable`], but for `missing` bytes where the socket supports a
    /// low-water mark.
    async fn readable_by(&self, missing: usize) -> io::Result<()> {
        match self {
            Self::Tcp(stream) => stream.readable_by(missing).await,
            Self::Unix(stream) => stream.readable().await,
            Self::Shmem(stream) => stream.readable().await,
            Self::Datagrams(_) => Err(io::ErrorKind::NotConnected.into()),
            // What is missing of a message is not what is missing on the wire.
            Self::Tls(stream) => stream.readable().await,
        }
    }

    pub(crate) async fn writable(&self) -> io::Result<()> {
        either!(self, stream => stream.writable().await)
    }

    fn try_read_buf(&self, buffer: &mut impl BufMut) -> io::Result<usize> {
        either!(self, stream => stream.try_read_buf(buffer))
    }

    /// Suppresses wake-ups for few bytes, where supported, until the next wait in
    /// [`Socket::readable`].
    pub(crate) fn suppress_wakeups(&self) {
        if !Optimisation::SuppressWakeups.is_enabled() {
            return;
        }
        match self {
            Self::Tcp(stream) => stream.suppress_wakeups(),
            Self::Unix(stream) => stream.suppress_wakeups(),
            Self::Shmem(_) | Self::Datagrams(_) => {}
            Self::Tls(stream) => stream.tcp().suppress_wakeups(),
        }
    }

    /// Reads the available bytes without consulting the runtime's readiness.
    pub(crate) fn peek_now(&self, mut bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Shmem(stream) => {
                let most = bytes.len();
                stream.try_read(&mut bytes, most)
            }
            Self::Datagrams(_) => Err(io::ErrorKind::NotConnected.into()),
            Self::Tls(stream) => stream.peek_now(bytes),
            Self::Tcp(_) | Self::Unix(_) => (&*self.raw()).read(bytes),
        }
    }

    fn try_write(&self, bytes: &[u8]) -> io::Result<usize> {
        self.try_write_vectored(&[IoSlice::new(bytes)])
    }

    pub(crate) fn try_write_vectored(&self, chunks: &[IoSlice<'_>]) -> io::Result<usize> {
        either!(self, stream => stream.try_write_vectored(chunks))
    }

    /// Returns the socket itself, for what tokio does not offer.
    fn raw(&self) -> SockRef<'_> {
        match self {
            Self::Tcp(stream) => SockRef::from(&**stream),
            Self::Unix(stream) => SockRef::from(stream),
            Self::Shmem(stream) => SockRef::from(stream.tcp()),
            Self::Datagrams(socket) => SockRef::from(&**socket),
            Self::Tls(stream) => SockRef::from(&**stream.tcp()),
        }
    }

    /// The TCP stream, where it is one.
    pub(crate) fn tcp(&self) -> Option<&TcpStream> {
        match self {
            Self::Tcp(stream) => Some(stream),
            Self::Unix(_) | Self::Shmem(_) | Self::Datagrams(_) | Self::Tls(_) => None,
        }
    }

    /// Returns whether what is said is encrypted.
    pub(crate) fn is_encrypted(&self) -> bool {
        matches!(self, Self::Tls(_))
    }
}

impl Socket {
    /// The same socket, waited for by the runtime that this is called in. Where that cannot be had it
    /// is waited for as before; shared memory and encrypted streams always are.
    pub(crate) fn renewed(self: &Arc<Self>) -> Arc<Self> {
        let copied = || self.as_fd().try_clone_to_owned();
        let renewed = match &**self {
            Self::Tcp(stream) => {
                // The copy begins anew.
                stream.set_low_water_mark(1);
                copied()
                    .and_then(|copy| TcpStream::from_std(copy.into()))
                    .map(|stream| Self::Tcp(Tcp::new(stream)))
            }
            Self::Unix(_) => copied().and_then(Unix::try_from).map(Self::Unix),
            Self::Shmem(_) | Self::Datagrams(_) | Self::Tls(_) => return self.clone(),
        };
        renewed.map_or_else(|_| self.clone(), Arc::new)
    }
}

impl AsFd for Socket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Tcp(stream) => stream.as_fd(),
            Self::Unix(stream) => stream.as_fd(),
            Self::Shmem(stream) => stream.tcp().as_fd(),
            Self::Datagrams(socket) => socket.as_fd(),
            Self::Tls(stream) => stream.as_fd(),
        }
    }
}

/// Idle time before the first keepalive probe; probes repeat after each [`KEEPALIVE_INTERVAL`], and
/// after [`KEEPALIVE_PROBES`] unanswered ones the connection is closed. The system answers probes
/// for a busy or stopped program.
const KEEPALIVE_IDLE: Duration = Duration::from_secs(60);
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(15);
const KEEPALIVE_PROBES: u32 = 4;

/// Small messages go out at once, and a host that vanished is noticed.
pub(crate) fn prepare(stream: &TcpStream) -> io::Result<()> {
    let socket = SockRef::from(stream);
    socket.set_tcp_nodelay(Optimisation::NoDelay.is_enabled())?;
    let asking = TcpKeepalive::new()
        .with_time(KEEPALIVE_IDLE)
        .with_interval(KEEPALIVE_INTERVAL)
        .with_retries(KEEPALIVE_PROBES);
    socket.set_tcp_keepalive(&asking)
}

/// Bytes a buffer starts with; idle connections hold none.
const INITIAL_BUFFER_LEN: usize = 4 * 1024;
/// Largest read while nothing is known to be missing.
const MAX_READ_LEN: usize = 64 * 1024;

/// Bytes read from a stream and not consumed yet.
///
/// The buffer grows with the received bytes: the claim of a large message alone allocates nothing,
/// until the peer has once sent a message of that size.
#[derive(Debug, Default)]
pub(crate) struct ReadBuffer {
    /// The bytes.
    pub(crate) bytes: BytesMut,
    /// Takes turns with `bytes`.
    spare: BytesMut,
    /// Room offered to the next read.
    chunk: usize,
    /// The most that has been waiting here at once.
    proven: usize,
}

impl ReadBuffer {
    /// Waits for bytes and reads the available ones. `Ok(0)` is the end of the stream.
    ///
    /// `missing` is the number of bytes that the current message still needs.
    pub(crate) async fn read(&mut self, stream: &Socket, missing: usize) -> io::Result<usize> {
        loop {
            stream.readable_by(missing).await?;
            match self.try_read(stream, missing) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                other => return other,
            }
        }
    }

    /// Makes room for this many more bytes. Two buffers alternate, so that a small message that is
    /// still in use does not require a new one.
    pub(crate) fn reserve(&mut self, room: usize) {
        if self.bytes.is_empty()
            && room <= MAX_READ_LEN
            && Optimisation::BufferReuse.is_enabled()
            && !self.bytes.try_reclaim(room)
        {
            std::mem::swap(&mut self.bytes, &mut self.spare);
        }
        self.bytes.reserve(room);
    }

    /// Reads like [`ReadBuffer::read`] without waiting.
    pub(crate) fn try_read(&mut self, stream: &Socket, missing: usize) -> io::Result<usize> {
        let held = self.bytes.len();
        self.proven = self.proven.max(held);
        let trusted = held.max(self.proven).max(MAX_READ_LEN);
        let room = missing.min(trusted).max(self.chunk).max(INITIAL_BUFFER_LEN);
        self.reserve(room);
        // A large message ends its buffer, so that the next one begins with a buffer of its own
        // and what has been read of it need not be moved.
        let most = match missing >= MAX_READ_LEN {
            true => missing,
            false => usize::MAX,
        };
        let read = stream.try_read_buf(&mut (&mut self.bytes).limit(most))?;
        // A read that fills its room is followed by larger ones, others by smaller ones.
        self.chunk = if read >= room {
            (2 * room).min(MAX_READ_LEN)
        } else {
            (self.chunk / 2).max(2 * read).min(MAX_READ_LEN)
        };
        Ok(read)
    }
}

/// Reads `count` bytes and not one more.
pub(crate) async fn read_exactly(
    stream: &Socket,
    bytes: &mut BytesMut,
    count: usize,
) -> io::Result<()> {
    let end = bytes.len() + count;
    while bytes.len() < end {
        stream.readable().await?;
        let mut room = bytes.limit(end - bytes.len());
        match either!(stream, stream => stream.try_read_buf(&mut room)) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Writes what the system takes without waiting.
pub(crate) fn write_now(stream: &Socket, output: &mut impl Buf) -> io::Result<()> {
    while output.has_remaining() {
        match stream.try_write(output.chunk()) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(written) => output.advance(written),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Writes what the system takes without waiting, and releases the memory of that: the rest takes no more than its length.
pub(crate) fn write_part(stream: &Socket, output: &mut BytesMut) -> io::Result<()> {
    write_now(stream, output)?;
    // The buffer alone would keep all of its memory until it is empty.
    *output = BytesMut::from(&output[..]);
    Ok(())
}

/// Bytes of a large output that are written before other tasks run. Many peers that are sent much at a time would otherwise keep
/// those waiting who are sent little: the system takes megabytes at once.
const WRITE_SHARE: usize = 64 * 1024;

/// Writes what the system takes without waiting, in shares between which other tasks run.
pub(crate) async fn write_in_shares(stream: &Socket, output: &mut impl Buf) -> io::Result<()> {
    while output.has_remaining() {
        let share = output.remaining().min(WRITE_SHARE);
        let mut share = output.take(share);
        write_now(stream, &mut share)?;
        if share.has_remaining() {
            break;
        }
        tokio::task::yield_now().await;
    }
    Ok(())
}

/// Writes all of `output` and empties it.
pub(crate) async fn write_all(stream: &Socket, output: &mut impl Buf) -> io::Result<()> {
    write_now(stream, output)?;
    while output.has_remaining() {
        stream.writable().await?;
        write_now(stream, output)?;
    }
    Ok(())
}

/// Waits for `future` at most until `deadline`.
pub(crate) async fn within<T>(
    deadline: Duration,
    peer: &str,
    step: &'static str,
    future: impl Future<Output = Result<T, PortError>>,
) -> Result<T, PortError> {
    match tokio::time::timeout(deadline, future).await {
        Ok(result) => result,
        Err(_) => Err(PortError::Timeout {
            peer: peer.to_owned(),
            step,
            seconds: deadline.as_secs_f64(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use bytes::Bytes;

    use super::*;

    /// A hundred peers who were sent megabytes kept others waiting for a tenth of a second.
    #[tokio::test]
    async fn other_tasks_run_between_the_shares_of_a_large_output() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (accepted, connected) = tokio::join!(listener.accept(), TcpStream::connect(address));
        let (stream, _peer) = (
            Socket::Tcp(Tcp::new(accepted.unwrap().0)),
            connected.unwrap(),
        );
        let turns = Arc::new(AtomicUsize::new(0));
        let counted = turns.clone();
        let other = tokio::spawn(async move {
            loop {
                counted.fetch_add(1, Ordering::Relaxed);
                tokio::task::yield_now().await;
            }
        });
        let mut output = Bytes::from(vec![0; 64 << 20]);
        write_in_shares(&stream, &mut output).await.unwrap();
        let sent = (64 << 20) - output.len();
        let shares = sent / (64 << 10);
        assert!(sent > 0 && !output.is_empty(), "{sent}");
        assert!(turns.load(Ordering::Relaxed) >= shares, "{shares} shares");
        other.abort();
    }

    #[tokio::test]
    async fn a_prepared_connection_sends_at_once_and_probes_an_idle_peer() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (accepted, connected) = tokio::join!(listener.accept(), TcpStream::connect(address));
        let (accepted, _) = accepted.unwrap();
        prepare(&accepted).unwrap();
        let socket = SockRef::from(&accepted);
        assert!(socket.tcp_nodelay().unwrap() && socket.keepalive().unwrap());
        #[cfg(target_os = "linux")]
        {
            assert_eq!(socket.tcp_keepalive_time().unwrap(), KEEPALIVE_IDLE);
            assert_eq!(socket.tcp_keepalive_interval().unwrap(), KEEPALIVE_INTERVAL);
            assert_eq!(socket.tcp_keepalive_retries().unwrap(), KEEPALIVE_PROBES);
        }
        drop(connected.unwrap());
    }

    /// A hundred peers that read nothing kept the memory of whole lists, most of which the system had taken.
    #[tokio::test]
    async fn what_was_sent_of_a_large_output_takes_no_memory() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (accepted, connected) = tokio::join!(listener.accept(), TcpStream::connect(address));
        let stream = Socket::Tcp(Tcp::new(accepted.unwrap().0));
        let mut output = BytesMut::from(&vec![7; 24 << 20][..]);
        stream.writable().await.unwrap();
        write_part(&stream, &mut output).unwrap();
        let sent = (24 << 20) - output.len();
        assert!(sent > 0 && !output.is_empty(), "{sent} bytes");
        assert!(output.iter().all(|byte| *byte == 7));
        // The memory of the part that was sent would be there to reclaim.
        assert!(!output.try_reclaim(sent));
        drop(connected.unwrap());
    }
}
