//! An encrypted TCP stream that is read and written without waiting, as the plain one is.
//!
//! Encrypted bytes that the system does not take at once stay here, at most [`MAX_UNSENT`]; they go out with the next
//! write or read, or while somebody waits in [`TlsStream::readable`]; a connection at rest is always waited for there. What is
//! left when the stream is dropped is sent in the background, for at most [`CLOSE_TIMEOUT`].

use std::io::{self, BufRead, ErrorKind, IoSlice, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::BufMut;
use rustls::Connection;
use socket2::SockRef;
use tokio::net::TcpStream;
use tokio::sync::Notify;

use super::invalid;
use crate::latency::Tcp;

/// Bytes of encrypted data that wait for the system to take them, apart from what TLS adds.
const MAX_UNSENT: usize = 64 * 1024;
/// Bytes read from the system at once.
const MAX_READ: usize = 32 * 1024;
/// Time in which the last bytes of a stream have to go out.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// An encrypted TCP stream.
#[derive(Debug)]
pub(crate) struct TlsStream {
    /// Taken only when the stream is dropped.
    tcp: Option<Tcp>,
    state: Mutex<State>,
    /// Something was left unsent by somebody who does not wait in [`TlsStream::readable`].
    unsent: Notify,
}

#[derive(Debug)]
struct State {
    connection: Connection,
    /// Read and not yet taken by TLS: `received[taken..]`.
    received: Vec<u8>,
    taken: usize,
    /// Decrypted bytes are there.
    has_more: bool,
}

impl TlsStream {
    pub(super) fn new(tcp: Tcp, mut connection: Connection) -> Self {
        connection.set_buffer_limit(Some(MAX_UNSENT));
        Self {
            tcp: Some(tcp),
            state: Mutex::new(State {
                connection,
                received: Vec::new(),
                taken: 0,
                has_more: false,
            }),
            unsent: Notify::new(),
        }
    }

    /// Returns the TCP stream below.
    pub(crate) fn tcp(&self) -> &Tcp {
        self.tcp.as_ref().expect("it is taken only in drop")
    }

    pub(super) fn is_handshaking(&self) -> bool {
        self.state().connection.is_handshaking()
    }

    /// Waits until there may be something to read; sends meanwhile what was left unsent.
    pub(crate) async fn readable(&self) -> io::Result<()> {
        loop {
            if self.state().has_more() {
                return Ok(());
            }
            if self.flush()? {
                tokio::select! {
                    biased;
                    ready = self.tcp().readable_by(1) => return ready,
                    () = self.unsent.notified() => {}
                }
            } else {
                tokio::select! {
                    biased;
                    ready = self.tcp().readable_by(1) => return ready,
                    ready = self.tcp().writable() => ready?,
                }
            }
        }
    }

    /// Waits until the system takes something.
    pub(crate) async fn writable(&self) -> io::Result<()> {
        self.tcp().writable().await
    }

    /// Reads what is there, up to the room that `buffer` offers at once. `Ok(0)` is the end.
    pub(crate) fn try_read_buf(&self, buffer: &mut impl BufMut) -> io::Result<usize> {
        let tcp = self.tcp();
        self.read(buffer, |room| tcp.try_read(room))
    }

    /// Reads like [`TlsStream::try_read_buf`], even if the system has not reported readiness.
    pub(crate) fn peek_now(&self, mut bytes: &mut [u8]) -> io::Result<usize> {
        let socket = SockRef::from(&**self.tcp());
        self.read(&mut bytes, |room| (&*socket).read(room))
    }

    /// Encrypts and sends what is accepted of `chunks`; tells how much that is.
    pub(crate) fn try_write_vectored(&self, chunks: &[IoSlice<'_>]) -> io::Result<usize> {
        let mut state = self.state();
        if !state.flush(self.tcp())? {
            return Err(ErrorKind::WouldBlock.into());
        }
        let accepted = state.connection.writer().write_vectored(chunks)?;
        if !state.flush(self.tcp())? {
            self.unsent.notify_one();
        }
        Ok(accepted)
    }

    /// Sends what was left unsent; tells whether all is sent.
    pub(super) fn flush(&self) -> io::Result<bool> {
        self.state().flush(self.tcp())
    }

    /// Takes bytes from the system during the handshake; `false` is the end of the stream.
    pub(super) fn receive(&self) -> io::Result<bool> {
        let mut state = self.state();
        match state.fill(|room| self.tcp().try_read(room)) {
            Ok(0) => Ok(false),
            Ok(_) => state.feed().map(|()| true),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(true),
            Err(error) => Err(error),
        }
    }

    fn read(
        &self,
        buffer: &mut impl BufMut,
        mut system: impl FnMut(&mut [u8]) -> io::Result<usize>,
    ) -> io::Result<usize> {
        let mut state = self.state();
        state.flush(self.tcp())?;
        let mut room = buffer.chunk_mut().len().min(buffer.remaining_mut());
        let mut total = 0;
        loop {
            let read = state.take(buffer, room)?;
            total += read;
            room -= read;
            if room == 0 {
                return Ok(total);
            }
            if state.is_fed() {
                if total > 0 {
                    return Ok(total);
                }
                if state.is_closed() {
                    return Ok(0);
                }
                if state.fill(&mut system)? == 0 {
                    // Without the goodbye of TLS somebody may have cut it off.
                    return Err(ErrorKind::ConnectionAborted.into());
                }
            }
            if let Err(error) = state.feed() {
                // The alert says what is wrong.
                let _ = state.flush(self.tcp());
                return Err(error);
            }
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Returns whether nothing is left that TLS could take.
    fn is_fed(&self) -> bool {
        self.taken == self.received.len()
    }

    fn has_more(&self) -> bool {
        self.has_more || !self.is_fed()
    }

    /// Returns whether the peer has said goodbye.
    fn is_closed(&mut self) -> bool {
        matches!(self.connection.reader().fill_buf(), Ok(chunk) if chunk.is_empty())
    }

    /// Takes decrypted bytes.
    fn take(&mut self, buffer: &mut impl BufMut, room: usize) -> io::Result<usize> {
        let mut reader = self.connection.reader();
        let mut total = 0;
        while total < room {
            // `WouldBlock` says that there is nothing now.
            let Ok(chunk) = reader.fill_buf() else { break };
            let count = chunk.len().min(room - total);
            if count == 0 {
                break;
            }
            buffer.put_slice(&chunk[..count]);
            reader.consume(count);
            total += count;
        }
        self.has_more = matches!(reader.fill_buf(), Ok(chunk) if !chunk.is_empty());
        Ok(total)
    }

    /// Reads from the system, once all that was read before is taken.
    fn fill(
        &mut self,
        mut system: impl FnMut(&mut [u8]) -> io::Result<usize>,
    ) -> io::Result<usize> {
        self.received.resize(MAX_READ, 0);
        let read = system(&mut self.received);
        self.received.truncate(*read.as_ref().unwrap_or(&0));
        self.taken = 0;
        read
    }

    /// Has TLS take what was read, until something is decrypted.
    fn feed(&mut self) -> io::Result<()> {
        while !self.is_fed() {
            let taken = self
                .connection
                .read_tls(&mut &self.received[self.taken..])?;
            self.taken += taken;
            let state = self.connection.process_new_packets().map_err(invalid)?;
            if state.plaintext_bytes_to_read() > 0 {
                self.has_more = true;
                break;
            }
            if taken == 0 {
                // Behind a goodbye nothing counts.
                self.taken = self.received.len();
            }
        }
        Ok(())
    }

    fn flush(&mut self, tcp: &Tcp) -> io::Result<bool> {
        while self.connection.wants_write() {
            match self.connection.write_tls(&mut Sending(tcp)) {
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(false),
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }
}

/// Writes to a TCP stream without waiting.
struct Sending<'a>(&'a TcpStream);

impl Write for Sending<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.try_write(bytes)
    }

    fn write_vectored(&mut self, chunks: &[IoSlice<'_>]) -> io::Result<usize> {
        self.0.try_write_vectored(chunks)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl AsFd for TlsStream {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.tcp().as_fd()
    }
}

impl Drop for TlsStream {
    fn drop(&mut self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.connection.send_close_notify();
        let Some(tcp) = self.tcp.take() else { return };
        if !matches!(state.flush(&tcp), Ok(false)) {
            return;
        }
        let mut rest = Vec::new();
        while state.connection.wants_write() {
            if state.connection.write_tls(&mut rest).is_err() {
                return;
            }
        }
        drop(state);
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            runtime.spawn(tokio::time::timeout(CLOSE_TIMEOUT, async move {
                let mut rest = &rest[..];
                while !rest.is_empty() {
                    match tcp.try_write(rest) {
                        Ok(count) => rest = &rest[count..],
                        Err(error) if error.kind() == ErrorKind::WouldBlock => {
                            tcp.writable().await?;
                        }
                        Err(error) => return Err(error),
                    }
                }
                Ok(())
            }));
        }
    }
}
