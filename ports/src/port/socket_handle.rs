//! Access to the socket of a connection that does not keep it open.

use std::fmt;
use std::io;
use std::net::Shutdown;
use std::os::fd::AsFd;
use std::sync::{Arc, Weak};
use std::time::Duration;

use socket2::{SockRef, TcpKeepalive};
use tokio::net::TcpStream;

/// A weak reference to the socket of a connection.
#[derive(Clone)]
pub(crate) struct SocketHandle(Weak<dyn AsFd + Send + Sync>);

impl SocketHandle {
    /// Creates a handle that does not keep the socket open.
    pub(crate) fn of<S: AsFd + Send + Sync + 'static>(socket: &Arc<S>) -> Self {
        let weak: Weak<S> = Arc::downgrade(socket);
        Self(weak)
    }

    /// For a connection that has no socket.
    pub(crate) fn none() -> Self {
        let weak: Weak<TcpStream> = Weak::new();
        Self(weak)
    }

    /// Shuts the socket down for writing.
    pub(crate) fn finish(&self) {
        // One that is gone sends nothing, either.
        let _ = self.with(|socket, _| socket.shutdown(Shutdown::Write));
    }

    /// Returns the byte in the header of each packet.
    pub(super) fn type_of_service(&self) -> io::Result<u32> {
        self.with(|socket, six| match six {
            true => socket.tclass_v6(),
            false => socket.tos_v4(),
        })
    }

    pub(super) fn set_type_of_service(&self, value: u32) -> io::Result<()> {
        self.with(|socket, six| match six {
            true => socket.set_tclass_v6(value),
            false => socket.set_tos_v4(value),
        })
    }

    /// Makes the system close a TCP connection whose peer has not responded for this long.
    pub(crate) fn set_user_timeout(&self, silence: Duration) -> io::Result<()> {
        let second = Duration::from_secs(1);
        let asking = TcpKeepalive::new()
            .with_time((silence / 2).max(second))
            .with_interval((silence / 4).max(second));
        self.with(|socket, _| {
            socket.set_tcp_user_timeout(Some(silence))?;
            socket.set_tcp_keepalive(&asking)
        })
    }

    /// Limits the bytes that a TCP connection accepts before the peer's window admits them.
    pub(crate) fn set_max_unsent(&self, bytes: u32) -> io::Result<()> {
        #[cfg(target_os = "linux")]
        self.with(|socket, _| socket.set_tcp_notsent_lowat(bytes))?;
        Ok(())
    }

    /// Calls `ask` with the socket, and with whether it uses IPv6.
    fn with<T>(&self, ask: impl FnOnce(SockRef<'_>, bool) -> io::Result<T>) -> io::Result<T> {
        let socket = self.0.upgrade().ok_or(io::ErrorKind::NotConnected)?;
        let descriptor = socket.as_fd();
        let socket = SockRef::from(&descriptor);
        let six = socket.local_addr()?.is_ipv6();
        ask(socket, six)
    }
}

impl fmt::Debug for SocketHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SocketHandle")
    }
}
