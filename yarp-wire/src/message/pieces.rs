//! The binary form of a message while it is being written.

use bytes::{Bytes, BytesMut};

/// The binary form of a message: small parts are written into one buffer, large existing parts are
/// shared.
///
/// ```
/// use bytes::{BufMut, Bytes};
/// use yarp_wire::message::Pieces;
///
/// let pixels = Bytes::from(vec![7; 1_000_000]);
/// let mut pieces = Pieces::new();
/// pieces.written().put_slice(b"head");
/// pieces.share(&pixels);
/// assert_eq!(pieces.len(), 1_000_004);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Pieces {
    /// All that is written, one after the other.
    written: BytesMut,
    /// The shared parts, each with the number of bytes written before it.
    shared: Vec<(usize, Bytes)>,
    /// Bytes shared.
    sharing: usize,
}

/// A part of [`Pieces`].
#[derive(Clone, Copy, Debug)]
pub enum Piece<'a> {
    /// Bytes of the buffer: to keep them is to copy them.
    Written(&'a [u8]),
    /// Bytes that can be kept without copying them.
    Shared(&'a Bytes),
}

impl Pieces {
    /// From this length on bytes are shared; shorter ones are cheaper to copy.
    pub const MIN_SHARED_LEN: usize = 16 * 1024;

    /// Creates an empty message.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the buffer for bytes that are written out.
    pub fn written(&mut self) -> &mut BytesMut {
        &mut self.written
    }

    /// Appends bytes without copying them, if they are worth it.
    pub fn share(&mut self, bytes: &Bytes) {
        if bytes.len() < Self::MIN_SHARED_LEN {
            self.written.extend_from_slice(bytes);
        } else {
            self.sharing += bytes.len();
            self.shared.push((self.written.len(), bytes.clone()));
        }
    }

    /// Bytes in all.
    pub fn len(&self) -> usize {
        self.written.len() + self.sharing
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Forgets everything but the room that was made.
    pub fn clear(&mut self) {
        self.written.clear();
        self.shared.clear();
        self.sharing = 0;
    }

    /// Returns the capacity of the buffer.
    pub fn capacity(&self) -> usize {
        self.written.capacity()
    }

    /// Makes a large message that was written out one that can be shared.
    pub fn seal(&mut self) {
        if self.shared.is_empty() && self.written.len() >= Self::MIN_SHARED_LEN {
            let bytes = std::mem::take(&mut self.written).freeze();
            self.share(&bytes);
        }
    }

    /// All of it, if nothing of it is shared.
    pub fn as_written(&self) -> Option<&[u8]> {
        self.shared.is_empty().then_some(&self.written[..])
    }

    /// Returns the parts in their order.
    pub fn iter(&self) -> impl Iterator<Item = Piece<'_>> {
        let mut from = 0;
        let parts = self.shared.iter().flat_map(move |(at, bytes)| {
            let written = &self.written[from..*at];
            from = *at;
            [Piece::Written(written), Piece::Shared(bytes)]
        });
        let rest = self.shared.last().map_or(0, |(at, _)| *at);
        let rest = std::iter::once(Piece::Written(&self.written[rest..]));
        parts
            .chain(rest)
            .filter(|piece| !piece.as_bytes().is_empty())
    }

    /// Returns the parts in their order; copies the written ones.
    pub fn to_vec(&self) -> Vec<Bytes> {
        let keep = |piece: Piece<'_>| match piece {
            Piece::Written(bytes) => Bytes::copy_from_slice(bytes),
            Piece::Shared(bytes) => bytes.clone(),
        };
        self.iter().map(keep).collect()
    }
}

impl<'a> Piece<'a> {
    /// Returns the bytes.
    pub fn as_bytes(self) -> &'a [u8] {
        match self {
            Self::Written(bytes) => bytes,
            Self::Shared(bytes) => bytes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_keep_their_order() {
        let large = |byte| Bytes::from(vec![byte; Pieces::MIN_SHARED_LEN]);
        let mut pieces = Pieces::new();
        pieces.share(&large(1));
        pieces.written().extend_from_slice(b"ab");
        pieces.share(&Bytes::from_static(b"cd"));
        pieces.share(&large(2));
        pieces.share(&large(3));
        pieces.written().extend_from_slice(b"e");
        let whole = pieces.to_vec().concat();
        assert_eq!(whole.len(), pieces.len());
        let runs: Vec<u8> = whole.chunk_by(|a, b| a == b).map(|run| run[0]).collect();
        assert_eq!(runs, [1, b'a', b'b', b'c', b'd', 2, 3, b'e']);
        assert_eq!(pieces.iter().count(), 5);
        pieces.clear();
        assert!(pieces.is_empty() && pieces.iter().next().is_none());
    }

    #[test]
    fn large_messages_become_shared() {
        let mut pieces = Pieces::new();
        pieces.written().resize(Pieces::MIN_SHARED_LEN - 1, 7);
        pieces.seal();
        assert!(matches!(pieces.iter().next(), Some(Piece::Written(_))));
        pieces.written().extend_from_slice(&[7]);
        pieces.seal();
        assert!(matches!(pieces.iter().next(), Some(Piece::Shared(_))));
        assert_eq!(pieces.len(), Pieces::MIN_SHARED_LEN);
    }
}
