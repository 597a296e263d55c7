//! TCP streams with a low-water mark for wake-ups.
//!
//! A stream that a task polls ([`BusyPoll`](crate::latency::BusyPoll)) also wakes the runtime's
//! I/O thread for each packet, at the expense of the writer. So does a large message, of which no
//! part is useful without the rest. Therefore the system is asked to report readiness only above a
//! low-water mark (`SO_RCVLOWAT`, see socket(7)), or when the peer cannot send more for now, or at
//! the end. A task that sleeps on the stream sets the mark first.

#![allow(unsafe_code, reason = "this option of sockets has no safe interface")]

use std::io;
use std::ops::Deref;
use std::os::fd::AsRawFd;
use std::sync::atomic::AtomicI32;
use std::sync::atomic::Ordering::Relaxed;

use tokio::net::TcpStream;

use super::Optimisation;

/// Low-water mark while a task polls: far below the amount at which the system would stop the peer.
const SUPPRESSED_LOW_WATER_MARK: usize = 16 * 1024;
/// Maximum low-water mark: so low that the copies of the two ends can overlap.
const MAX_LOW_WATER_MARK: usize = 200_000;

/// A TCP stream, and its low-water mark.
#[derive(Debug)]
pub(crate) struct Tcp {
    stream: TcpStream,
    low_water_mark: AtomicI32,
}

impl Tcp {
    pub(crate) fn new(stream: TcpStream) -> Self {
        Self {
            stream,
            low_water_mark: AtomicI32::new(1),
        }
    }

    /// Waits until this many bytes are readable, at most [`MAX_LOW_WATER_MARK`].
    pub(crate) async fn readable_by(&self, bytes: usize) -> io::Result<()> {
        let bytes = match Optimisation::LowWaterMark.is_enabled() {
            true => bytes.clamp(1, MAX_LOW_WATER_MARK),
            false => 1,
        };
        self.set_low_water_mark(bytes);
        self.stream.readable().await
    }

    /// Suppresses wake-ups for few bytes, until a task waits.
    pub(crate) fn suppress_wakeups(&self) {
        self.set_low_water_mark(SUPPRESSED_LOW_WATER_MARK);
    }

    /// Sets the low-water mark; wakes waiting tasks if it is reached already.
    pub(crate) fn set_low_water_mark(&self, bytes: usize) {
        let bytes = i32::try_from(bytes).unwrap_or(i32::MAX);
        if cfg!(target_os = "linux") && self.low_water_mark.swap(bytes, Relaxed) != bytes {
            self.set_socket_option(bytes);
        }
    }

    fn set_socket_option(&self, bytes: i32) {
        // SAFETY: the value is a number of the length that is given, and lives longer than the call.
        // An open stream takes any number.
        unsafe {
            libc::setsockopt(
                self.stream.as_raw_fd(),
                libc::SOL_SOCKET,
                libc::SO_RCVLOWAT,
                (&raw const bytes).cast(),
                size_of::<i32>() as libc::socklen_t,
            )
        };
    }
}

impl Deref for Tcp {
    type Target = TcpStream;

    fn deref(&self) -> &TcpStream {
        &self.stream
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::time::Duration;

    use tokio::io::AsyncWriteExt;
    use tokio::net::TcpListener;
    use tokio::time::timeout;

    use super::*;

    /// Both ends of a connection.
    async fn pair() -> (Tcp, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (accepted, connected) = tokio::join!(listener.accept(), TcpStream::connect(address));
        (Tcp::new(accepted.unwrap().0), connected.unwrap())
    }

    #[tokio::test]
    async fn bytes_received_while_suppressed_wake_a_later_sleeper() {
        let (quiet, mut peer) = pair().await;
        // A new stream is taken to be readable until it is found not to be.
        quiet.try_read(&mut [0; 16]).unwrap_err();
        quiet.suppress_wakeups();
        peer.write_all(b"hello").await.unwrap();
        // It has arrived, without a wake-up.
        while quiet.available() < 5 {
            tokio::task::yield_now().await;
        }
        let told = timeout(Duration::from_millis(200), quiet.stream.readable()).await;
        assert!(told.is_err(), "five bytes are little");
        let told = timeout(Duration::from_secs(60), quiet.readable_by(1)).await;
        told.expect("bytes are there").unwrap();
        assert_eq!(quiet.try_read(&mut [0; 16]).unwrap(), 5);
        // Nor is the end kept quiet.
        quiet.try_read(&mut [0; 16]).unwrap_err();
        quiet.suppress_wakeups();
        drop(peer);
        let told = timeout(Duration::from_secs(60), quiet.stream.readable()).await;
        told.expect("the end is told").unwrap();
    }

    #[tokio::test]
    async fn a_waiter_for_many_bytes_is_woken_by_them_or_by_the_end() {
        let (stream, mut peer) = pair().await;
        let limit = Duration::from_secs(60);
        // More than the system has room for, and less than was claimed.
        for bytes in [1, 1000, MAX_LOW_WATER_MARK, 20 * MAX_LOW_WATER_MARK] {
            stream.try_read(&mut [0; 16]).unwrap_err();
            let sent = vec![7; bytes];
            let mut left = bytes;
            let reading = async {
                while left > 0 {
                    stream.readable_by(left).await.unwrap();
                    match stream.try_read(&mut vec![0; left]) {
                        Ok(read) => left -= read,
                        Err(error) => assert_eq!(error.kind(), io::ErrorKind::WouldBlock),
                    }
                }
            };
            let both = timeout(limit, async {
                tokio::join!(peer.write_all(&sent), reading)
            });
            both.await.expect("all that was sent is told of").0.unwrap();
        }
        stream.try_read(&mut [0; 16]).unwrap_err();
        peer.write_all(b"less").await.unwrap();
        drop(peer);
        let told = timeout(limit, stream.readable_by(MAX_LOW_WATER_MARK)).await;
        told.expect("the end is told").unwrap();
        assert_eq!(stream.try_read(&mut [0; 16]).unwrap(), 4);
    }

    impl Tcp {
        /// Bytes that are there, as the system says.
        fn available(&self) -> usize {
            let socket = socket2::SockRef::from(&self.stream);
            let mut bytes = [std::mem::MaybeUninit::uninit(); 16];
            socket.peek(&mut bytes).unwrap_or(0)
        }
    }
}
