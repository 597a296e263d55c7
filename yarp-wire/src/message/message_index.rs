//! The index in front of a binary message.

use bytes::BufMut;

use crate::framed_number;
use crate::ready::Ready;

/// The size that a binary message announces.
///
/// ```text
/// 59 41 0A 00 00 00 52 50            number 10: bytes of the index header
/// LEN OUT FF FF FF FF FF FF FF FF    how many lengths follow
/// LEN x int32                        blocks of the message
/// OUT x int32                        blocks of a reply; stock sends one 0
/// ```
///
/// The boundaries between blocks carry no meaning; only the sum does.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Index {
    /// Bytes of the message after the index.
    pub total: usize,
}

/// Bytes of the index header.
const HEADER_LEN: usize = 10;
/// Number and header.
const FIXED_LEN: usize = framed_number::LEN + HEADER_LEN;

/// The reason why bytes are not an index.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IndexError {
    /// The number in front is not the one expected.
    #[error("expected a message index (number 10), got {got:02X?}")]
    NoIndex {
        /// The eight bytes.
        got: [u8; framed_number::LEN],
    },
    /// A block length below zero.
    #[error("message index lists a block of {length} bytes")]
    NegativeLength {
        /// The length as it stands.
        length: i32,
    },
    /// More bytes than the limit.
    #[error("message index announces {total} bytes, allowed {limit}")]
    TooLong {
        /// The announced size.
        total: usize,
        /// The limit in force.
        limit: usize,
    },
}

impl Index {
    /// Reads an index at the start of `bytes`: the index and its own size, or `None` while bytes
    /// are missing.
    pub fn read(bytes: &[u8], limit: usize) -> Ready<(Self, usize), IndexError> {
        let Some(head) = bytes.first_chunk::<{ framed_number::LEN }>() else {
            return Ok(None);
        };
        if framed_number::decode(head) != Some(HEADER_LEN as i32) {
            return Err(IndexError::NoIndex { got: *head });
        }
        let Some(fixed) = bytes.first_chunk::<FIXED_LEN>() else {
            return Ok(None);
        };
        let counts = [fixed[framed_number::LEN], fixed[framed_number::LEN + 1]];
        let blocks: usize = counts.iter().map(|count| usize::from(*count)).sum();
        let end = FIXED_LEN + 4 * blocks;
        let Some(lengths) = bytes.get(FIXED_LEN..end) else {
            return Ok(None);
        };
        let mut total = 0usize;
        for length in lengths.chunks_exact(4) {
            let length = i32::from_le_bytes(length.try_into().expect("four bytes"));
            total += usize::try_from(length).map_err(|_| IndexError::NegativeLength { length })?;
        }
        if total > limit {
            return Err(IndexError::TooLong { total, limit });
        }
        Ok(Some((Self { total }, end)))
    }

    /// Appends an index of a command block and, if present, a payload.
    ///
    /// A message of one part is announced as one block, otherwise as two.
    pub fn put(out: &mut impl BufMut, command: usize, payload: usize) {
        let blocks = if payload == 0 { 1 } else { 2 };
        let mut index = [0; FIXED_LEN + 12];
        index[..framed_number::LEN].copy_from_slice(&framed_number::encode(HEADER_LEN as i32));
        index[framed_number::LEN..FIXED_LEN]
            .copy_from_slice(&[blocks, 1, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff]);
        index[FIXED_LEN..FIXED_LEN + 4].copy_from_slice(&(command as i32).to_le_bytes());
        let mut end = FIXED_LEN + 4;
        if blocks == 2 {
            index[end..end + 4].copy_from_slice(&(payload as i32).to_le_bytes());
            end += 4;
        }
        // The reply has one block, of unknown length.
        out.put_slice(&index[..end + 4]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_adds_up() {
        let mut bytes = Vec::new();
        Index::put(&mut bytes, 8, 12);
        assert_eq!(bytes.len(), 30);
        assert_eq!(
            Index::read(&bytes, 100),
            Ok(Some((Index { total: 20 }, 30)))
        );
        for end in 0..30 {
            assert_eq!(Index::read(&bytes[..end], 100), Ok(None));
        }
        let error = IndexError::TooLong {
            total: 20,
            limit: 19,
        };
        assert_eq!(Index::read(&bytes, 19), Err(error));
    }

    #[test]
    fn lying_lengths_are_refused() {
        let mut bytes = Vec::new();
        Index::put(&mut bytes, 8, 12);
        bytes[18..22].copy_from_slice(&(-1i32).to_le_bytes());
        assert_eq!(
            Index::read(&bytes, 100),
            Err(IndexError::NegativeLength { length: -1 })
        );
        assert!(matches!(
            Index::read(b"GARBAGE!", 100),
            Err(IndexError::NoIndex { .. })
        ));
    }
}
