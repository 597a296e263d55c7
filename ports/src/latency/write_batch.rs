//! Batches of bytes to be written to a socket.

use std::collections::VecDeque;
use std::io::{self, IoSlice};

use bytes::{Buf, Bytes, BytesMut};
use yarp_wire::message::{Piece, Pieces};

use super::Optimisation;
use crate::socket::Socket;

/// Room that is kept for the next bytes once all have been sent.
const MAX_RETAINED_CAPACITY: usize = 64 * 1024;
/// Buffers handed to one system call.
const MAX_IO_SLICES: usize = 16;
/// Bytes handed to one system call where batches are switched off: about one small message.
const UNBATCHED_LEN: usize = 64;

/// Bytes to be sent: small parts are copied into one buffer, large ones are shared. Empty batches
/// keep their buffer.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    buffer: BytesMut,
    /// Bytes of the buffer that have been sent.
    sent: usize,
    /// Large parts, each with the number of buffered bytes before it.
    shared: VecDeque<(usize, Bytes)>,
    /// Bytes in the large parts.
    sharing: usize,
}

impl Batch {
    /// Returns the buffer for small parts.
    pub(crate) fn buffer(&mut self) -> &mut BytesMut {
        &mut self.buffer
    }

    /// Appends a payload.
    pub(crate) fn push(&mut self, pieces: &Pieces) {
        if let Some(bytes) = pieces.as_written() {
            self.buffer.extend_from_slice(bytes);
            return;
        }
        for piece in pieces.iter() {
            match piece {
                Piece::Shared(bytes) if !Optimisation::SharedParts.is_enabled() => {
                    self.buffer.extend_from_slice(bytes);
                }
                Piece::Written(bytes) => self.buffer.extend_from_slice(bytes),
                Piece::Shared(bytes) => {
                    self.sharing += bytes.len();
                    self.shared.push_back((self.buffer.len(), bytes.clone()));
                }
            }
        }
    }

    /// Bytes to be sent.
    pub(crate) fn len(&self) -> usize {
        self.buffer.len() - self.sent + self.sharing
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Writes as much as the socket accepts now; `sent` is called with the length of each write.
    pub(crate) fn write_to(
        &mut self,
        socket: &Socket,
        mut sent: impl FnMut(usize),
    ) -> io::Result<()> {
        while !self.is_empty() {
            let mut vectors = [IoSlice::new(&[]); MAX_IO_SLICES];
            let used = self.fill(&mut vectors);
            let first = &vectors[0][..vectors[0].len().min(UNBATCHED_LEN)];
            let slices = match Optimisation::WriteBatch.is_enabled() {
                true => &vectors[..used],
                false => &[IoSlice::new(first)],
            };
            let written = match socket.try_write_vectored(slices) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(written) => written,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) => return Err(error),
            };
            sent(written);
            self.advance(written);
        }
        Ok(())
    }

    /// Fills `slices` with the first bytes; returns the number of slices used.
    fn fill<'a>(&'a self, slices: &mut [IoSlice<'a>]) -> usize {
        let mut used = 0;
        let mut put = |bytes: &'a [u8]| {
            if !bytes.is_empty()
                && let Some(slice) = slices.get_mut(used)
            {
                *slice = IoSlice::new(bytes);
                used += 1;
            }
        };
        let mut from = self.sent;
        for (at, bytes) in self.shared.iter().take(8) {
            put(&self.buffer[from..*at]);
            put(bytes);
            from = *at;
        }
        if self.shared.len() <= 8 {
            put(&self.buffer[from..]);
        }
        used
    }

    /// Takes note that this many bytes have been sent.
    fn advance(&mut self, mut count: usize) {
        while count > 0 {
            let end = self.shared.front().map_or(self.buffer.len(), |(at, _)| *at);
            let written = count.min(end - self.sent);
            self.sent += written;
            count -= written;
            let Some((_, bytes)) = self.shared.front_mut() else {
                break;
            };
            let shared = count.min(bytes.len());
            bytes.advance(shared);
            self.sharing -= shared;
            count -= shared;
            if bytes.is_empty() {
                self.shared.pop_front();
            }
        }
        if self.is_empty() {
            self.clear();
        }
    }

    /// Forgets all there is.
    pub(crate) fn clear(&mut self) {
        if self.buffer.capacity() > MAX_RETAINED_CAPACITY {
            self.buffer = BytesMut::new();
        }
        self.buffer.clear();
        self.sent = 0;
        self.shared.clear();
        self.sharing = 0;
    }
}

/// Messages that are sent each by itself, as datagrams; they lie one behind the other. Emptied ones
/// keep their buffer.
#[derive(Debug, Default)]
pub(crate) struct DatagramBatch {
    buffer: BytesMut,
    /// The end of each message.
    ends: Vec<usize>,
}

impl DatagramBatch {
    /// Appends the output of `put` and the payload; returns their length.
    pub(crate) fn push(&mut self, put: impl FnOnce(&mut BytesMut), pieces: &Pieces) -> usize {
        let before = self.buffer.len();
        put(&mut self.buffer);
        for piece in pieces.iter() {
            self.buffer.extend_from_slice(piece.as_bytes());
        }
        self.ends.push(self.buffer.len());
        self.buffer.len() - before
    }

    /// Returns the messages in their order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &[u8]> {
        let begins = std::iter::once(0).chain(self.ends.iter().copied());
        begins
            .zip(&self.ends)
            .map(|(begin, end)| &self.buffer[begin..*end])
    }

    /// Forgets all there is.
    pub(crate) fn clear(&mut self) {
        if self.buffer.capacity() > MAX_RETAINED_CAPACITY {
            self.buffer = BytesMut::new();
        }
        self.buffer.clear();
        self.ends.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_pace_sends_the_same_bytes() {
        let large = |byte| Bytes::from(vec![byte; Pieces::MIN_SHARED_LEN]);
        for step in [1, 7, 1000, Pieces::MIN_SHARED_LEN + 1, usize::MAX] {
            let mut batch = Batch::default();
            let mut expected = Vec::new();
            for (i, part) in (0..12).map(|i| (i, large(i))) {
                batch.buffer().extend_from_slice(&[i; 3]);
                let mut pieces = Pieces::new();
                pieces.share(&part);
                pieces.written().extend_from_slice(b"end");
                batch.push(&pieces);
                expected.extend_from_slice(&[i; 3]);
                expected.extend_from_slice(&part);
                expected.extend_from_slice(b"end");
            }
            let mut sent = Vec::new();
            while !batch.is_empty() {
                let mut slices = [IoSlice::new(&[]); 16];
                let used = batch.fill(&mut slices);
                let whole = slices[..used]
                    .iter()
                    .flat_map(|slice| slice.iter().copied());
                let whole: Vec<u8> = whole.collect();
                let part = &whole[..whole.len().min(step)];
                assert!(!part.is_empty());
                sent.extend_from_slice(part);
                let count = part.len();
                batch.advance(count);
            }
            assert!(sent == expected, "in steps of {step}");
        }
    }

    #[test]
    fn messages_stay_apart() {
        let mut messages = DatagramBatch::default();
        for _ in 0..2 {
            for text in ["a", "", "bc"] {
                let mut pieces = Pieces::new();
                pieces.written().extend_from_slice(text.as_bytes());
                let length = messages.push(|out| out.extend_from_slice(b"head"), &pieces);
                assert_eq!(length, 4 + text.len());
            }
            let all: Vec<&[u8]> = messages.iter().collect();
            assert_eq!(all, [&b"heada"[..], b"head", b"headbc"]);
            messages.clear();
        }
        assert_eq!(messages.iter().count(), 0);
    }
}
