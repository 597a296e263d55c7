//! Readiness notification for a service manager.

/// Sends `READY=1` to the socket named by `NOTIFY_SOCKET`, as systemd expects; does nothing without
/// the variable.
pub(crate) fn notify_ready() {
    #[cfg(target_os = "linux")]
    if let Some(socket) = std::env::var_os("NOTIFY_SOCKET")
        && let Err(error) = linux::send(&socket, b"READY=1\n")
    {
        tracing::warn!("cannot notify the service manager of readiness: {error}");
    }
}

#[cfg(target_os = "linux")]
mod linux {
    use std::ffi::OsStr;
    use std::io;
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::ffi::OsStrExt;
    use std::os::unix::net::{SocketAddr, UnixDatagram};

    pub(super) fn send(name: &OsStr, text: &[u8]) -> io::Result<()> {
        // A name that begins with `@` is an abstract socket, not a file.
        let address = match name.as_bytes().strip_prefix(b"@") {
            Some(name) => SocketAddr::from_abstract_name(name)?,
            None => SocketAddr::from_pathname(name)?,
        };
        let socket = UnixDatagram::unbound()?;
        socket.set_nonblocking(true)?;
        socket.send_to_addr(text, &address).map(drop)
    }
}
