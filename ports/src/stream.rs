//! TCP streams as YARP uses them.

use std::future::Future;
use std::io;
use std::time::Duration;

use bytes::BytesMut;
use tokio::net::TcpStream;

use crate::error::{PortError, resolve};

/// Connects to a port with a deadline; small messages go out at once.
pub(crate) async fn connect(
    peer: &str,
    host: &str,
    port: u16,
    deadline: Duration,
) -> Result<TcpStream, PortError> {
    let address = format!("{host}:{port}");
    let connecting = async {
        let stream = TcpStream::connect(resolve(host, port).await?).await?;
        stream.set_nodelay(true)?;
        Ok(stream)
    };
    match tokio::time::timeout(deadline, connecting).await {
        Ok(Ok(stream)) => Ok(stream),
        Ok(Err(source)) => Err(PortError::connect(peer, address, "TCP connection", source)),
        Err(_) => Err(PortError::Deadline {
            peer: format!("{peer} at {address}"),
            step: "TCP connection",
            seconds: deadline.as_secs_f64(),
        }),
    }
}

/// Bytes a buffer starts with; idle connections hold none.
const FIRST: usize = 4 * 1024;
/// Most that a buffer grows by at a time, beyond doubling.
const STEP: usize = 64 * 1024;

/// Reads what there is, once there is something. `Ok(0)` is the end of the stream.
///
/// `missing` is what the message in progress still needs: the buffer grows towards it, but never
/// by more than it already holds (or a small step), so that a claim alone takes no memory.
pub(crate) async fn read_some(
    stream: &TcpStream,
    buffer: &mut BytesMut,
    missing: usize,
) -> io::Result<usize> {
    loop {
        stream.readable().await?;
        match try_read(stream, buffer, missing) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            other => return other,
        }
    }
}

/// As [`read_some`] without waiting.
pub(crate) fn try_read(
    stream: &TcpStream,
    buffer: &mut BytesMut,
    missing: usize,
) -> io::Result<usize> {
    if buffer.is_empty() && buffer.capacity() < FIRST {
        buffer.reserve(FIRST);
    }
    if buffer.capacity() == buffer.len() || missing > buffer.capacity() - buffer.len() {
        let step = buffer.len().clamp(FIRST, usize::MAX).max(STEP);
        buffer.reserve(missing.clamp(FIRST, step));
    }
    stream.try_read_buf(buffer)
}

/// Writes all of `output` and empties it.
pub(crate) async fn write_all(stream: &TcpStream, output: &mut BytesMut) -> io::Result<()> {
    use bytes::Buf;
    while !output.is_empty() {
        match stream.try_write(output) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(written) => output.advance(written),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                stream.writable().await?;
            }
            Err(error) => return Err(error),
        }
    }
    output.clear();
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
        Err(_) => Err(PortError::Deadline {
            peer: peer.to_owned(),
            step,
            seconds: deadline.as_secs_f64(),
        }),
    }
}
