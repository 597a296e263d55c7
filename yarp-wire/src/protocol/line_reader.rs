//! Lines of text as stock reads them.

use bytes::{Buf, Bytes, BytesMut};

use super::ProtocolError;
use crate::ready::Ready;

/// Lines of which the room is kept.
const MAX_RETAINED_CAPACITY: usize = 4 * 1024;

/// Collects a line from bytes that arrive in pieces.
///
/// CR and NUL are dropped; LF ends the line, unless a backslash precedes it: then both are dropped
/// and the line continues.
#[derive(Clone, Debug)]
pub(crate) struct LineReader {
    /// Reuses the buffer of short lines for later ones, once their bytes are unshared.
    line: BytesMut,
    limit: usize,
}

impl LineReader {
    pub(crate) fn new(limit: usize) -> Self {
        Self {
            line: BytesMut::new(),
            limit,
        }
    }

    /// Takes bytes from `input` up to and including the end of a line.
    pub(crate) fn read(&mut self, input: &mut BytesMut) -> Ready<Bytes, ProtocolError> {
        while !input.is_empty() {
            let end = input.iter().position(|byte| *byte == b'\n');
            let piece = &input[..end.unwrap_or(input.len())];
            if self.line.len() + piece.len() > self.limit {
                return Err(ProtocolError::LineTooLong { limit: self.limit });
            }
            for part in piece.split(|byte| matches!(byte, b'\r' | 0)) {
                self.line.extend_from_slice(part);
            }
            let taken = piece.len();
            let Some(end) = end else {
                input.advance(taken);
                break;
            };
            input.advance(end + 1);
            if self.line.last() == Some(&b'\\') {
                self.line.truncate(self.line.len() - 1);
            } else {
                let line = self.line.split().freeze();
                if line.len() > MAX_RETAINED_CAPACITY {
                    self.line = BytesMut::new();
                }
                return Ok(Some(line));
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_continue_and_are_bounded() {
        let read = |text: &[u8]| {
            let mut reader = LineReader::new(20);
            reader.read(&mut BytesMut::from(text))
        };
        assert_eq!(read(b"ab\r\nc"), Ok(Some("ab".into())));
        assert_eq!(read(b"ab"), Ok(None));
        assert_eq!(read(b"a\\\r\nb\n"), Ok(Some("ab".into())));
        assert_eq!(read(b"a\0b\n"), Ok(Some("ab".into())));
        let long = read(&[b'x'; 21]);
        assert_eq!(long, Err(ProtocolError::LineTooLong { limit: 20 }));
    }
}
