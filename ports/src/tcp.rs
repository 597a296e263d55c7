//! TCP streams that can be kept quiet.
//!
//! A stream that somebody waits for awake ([`BusyPoll`](crate::busy::BusyPoll)) wakes the thread that waits for
//! all sockets of the runtime as well, with each packet; and whoever writes pays for it. While it is
//! quiet the system tells of what came only once it is much (`SO_RCVLOWAT`, see socket(7); since
//! Linux 2.6.28 for whoever polls). Whoever goes to sleep on the stream ends the quiet first.

#![allow(unsafe_code, reason = "this option of sockets has no safe interface")]

use std::io;
use std::ops::Deref;
use std::os::fd::AsRawFd;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

use tokio::net::TcpStream;

/// Bytes that are told of in spite of the quiet: far less than the system would hold back the peer
/// for.
const MUCH: i32 = 16 * 1024;

/// A TCP stream, perhaps a quiet one.
#[derive(Debug)]
pub(crate) struct Tcp {
    stream: TcpStream,
    quiet: AtomicBool,
}

impl Tcp {
    pub(crate) fn new(stream: TcpStream) -> Self {
        Self {
            stream,
            quiet: AtomicBool::new(false),
        }
    }

    /// Waits until there is something to read; ends the quiet.
    pub(crate) async fn readable(&self) -> io::Result<()> {
        self.listen();
        self.stream.readable().await
    }

    /// From now on little that comes wakes nobody.
    pub(crate) fn quieten(&self) {
        if cfg!(target_os = "linux") && !self.quiet.swap(true, Relaxed) {
            self.set_low_water(MUCH);
        }
    }

    /// From now on all that comes wakes who waits; what has come meanwhile does so now.
    pub(crate) fn listen(&self) {
        if self.quiet.swap(false, Relaxed) {
            self.set_low_water(1);
        }
    }

    fn set_low_water(&self, bytes: i32) {
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

    #[tokio::test]
    async fn what_came_in_the_quiet_wakes_who_goes_to_sleep() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (accepted, connected) = tokio::join!(listener.accept(), TcpStream::connect(address));
        let (quiet, mut peer) = (Tcp::new(accepted.unwrap().0), connected.unwrap());
        // A new stream is taken to be readable until it is found not to be.
        quiet.try_read(&mut [0; 16]).unwrap_err();
        quiet.quieten();
        peer.write_all(b"hello").await.unwrap();
        // It has come, and nobody is told.
        while quiet.peek_now() < 5 {
            tokio::task::yield_now().await;
        }
        let told = timeout(Duration::from_millis(200), quiet.stream.readable()).await;
        assert!(told.is_err(), "five bytes are little");
        let told = timeout(Duration::from_secs(60), quiet.readable()).await;
        told.expect("bytes are there").unwrap();
        assert_eq!(quiet.try_read(&mut [0; 16]).unwrap(), 5);
        // Nor is the end kept quiet.
        quiet.try_read(&mut [0; 16]).unwrap_err();
        quiet.quieten();
        drop(peer);
        let told = timeout(Duration::from_secs(60), quiet.stream.readable()).await;
        told.expect("the end is told").unwrap();
    }

    impl Tcp {
        /// Bytes that are there, as the system says.
        fn peek_now(&self) -> usize {
            let socket = socket2::SockRef::from(&self.stream);
            let mut bytes = [std::mem::MaybeUninit::uninit(); 16];
            socket.peek(&mut bytes).unwrap_or(0)
        }
    }
}
