//! Frames.

use bytes::{Buf, BufMut, BytesMut};

use super::WebSocketError;
use crate::ready::Ready;

/// The last frame of a message.
const FIN: u8 = 0x80;
/// Bits that belong to extensions.
const RESERVED: u8 = 0x70;
/// Masked.
const MASKED: u8 = 0x80;
/// Largest frame that is no data.
const LARGEST_CONTROL: u64 = 125;
/// Instead of a length: two bytes of length follow.
const LENGTH_16: u8 = 126;
/// Instead of a length: eight bytes of length follow.
const LENGTH_64: u8 = 127;
/// Bytes of a mask.
const MASK: usize = 4;

/// Kinds of frames.
mod kind {
    pub(super) const CONTINUATION: u8 = 0x0;
    pub(super) const TEXT: u8 = 0x1;
    pub(super) const BINARY: u8 = 0x2;
    pub(super) const CLOSE: u8 = 0x8;
    pub(super) const PING: u8 = 0x9;
    pub(super) const PONG: u8 = 0xa;
}

/// Takes a stream out of the frames of a page; any split of the bytes gives the same stream.
#[derive(Debug)]
pub struct FrameReader {
    /// The content of the data frames that has not been consumed yet.
    pub stream: BytesMut,
    limit: usize,
    state: State,
    /// A message has begun and not ended.
    within: bool,
    closed: bool,
}

#[derive(Debug)]
enum State {
    Head,
    Data {
        left: u64,
        mask: [u8; MASK],
        at: usize,
    },
    Control {
        kind: u8,
        length: usize,
        mask: [u8; MASK],
    },
}

/// The head of a frame.
struct Head {
    last: bool,
    kind: u8,
    length: u64,
    mask: [u8; MASK],
}

impl FrameReader {
    /// Creates a reader at the start of the first frame; data frames may have at most `limit`
    /// bytes.
    pub fn new(limit: usize) -> Self {
        Self {
            stream: BytesMut::new(),
            limit,
            state: State::Head,
            within: false,
            closed: false,
        }
    }

    /// Returns whether a close frame was received: nothing follows it.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Moves the content of data frames from `input` to the stream; answers to other frames go to
    /// `output`.
    pub fn read(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Result<(), WebSocketError> {
        while self.step(input, output)?.is_some() {}
        Ok(())
    }

    /// Performs one step of [`FrameReader::read`], so that earlier frames can be used before later
    /// ones are parsed.
    pub(crate) fn step(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<(), WebSocketError> {
        if self.closed {
            input.clear();
            return Ok(None);
        }
        match &mut self.state {
            State::Head => match self.head(input)? {
                Some(head) => self.begin(&head)?,
                None => return Ok(None),
            },
            State::Data { left: 0, .. } => self.state = State::Head,
            State::Data { left, mask, at } => {
                if input.is_empty() {
                    return Ok(None);
                }
                let here = usize::try_from(*left).unwrap_or(usize::MAX);
                let mut piece = input.split_to(here.min(input.len()));
                unmask(&mut piece, *mask, *at);
                *left -= piece.len() as u64;
                *at = (*at + piece.len()) % MASK;
                match self.stream.is_empty() {
                    true => self.stream = piece,
                    false => self.stream.extend_from_slice(&piece),
                }
            }
            State::Control { kind, length, mask } => {
                if input.len() < *length {
                    return Ok(None);
                }
                let mut body = input.split_to(*length);
                unmask(&mut body, *mask, 0);
                match *kind {
                    kind::PING => {
                        output.put_slice(&[FIN | kind::PONG, body.len() as u8]);
                        output.put_slice(&body);
                    }
                    kind::CLOSE => {
                        // The reason of the page, without its words.
                        let code = body.get(..2).unwrap_or_default();
                        output.put_slice(&[FIN | kind::CLOSE, code.len() as u8]);
                        output.put_slice(code);
                        self.closed = true;
                    }
                    _ => {}
                }
                self.state = State::Head;
            }
        }
        Ok(Some(()))
    }

    /// Takes the head of a frame; `None` while bytes are missing.
    fn head(&self, input: &mut BytesMut) -> Ready<Head, WebSocketError> {
        let Some([first, second]) = input.first_chunk().copied() else {
            return Ok(None);
        };
        if first & RESERVED != 0 {
            return Err(WebSocketError::Extension);
        }
        if second & MASKED == 0 {
            return Err(WebSocketError::Unmasked);
        }
        let rest = &input[2..];
        let (length, bytes) = match second & !MASKED {
            LENGTH_16 => match rest.first_chunk() {
                Some(length) => (u64::from(u16::from_be_bytes(*length)), 2),
                None => return Ok(None),
            },
            LENGTH_64 => match rest.first_chunk() {
                Some(length) => (u64::from_be_bytes(*length), 8),
                None => return Ok(None),
            },
            length => (u64::from(length), 0),
        };
        let limit = self.limit;
        if usize::try_from(length).is_ok_and(|length| length <= limit) {
            let Some(mask) = rest[bytes..].first_chunk().copied() else {
                return Ok(None);
            };
            input.advance(2 + bytes + MASK);
            return Ok(Some(Head {
                last: first & FIN != 0,
                kind: first & 0xf,
                length,
                mask,
            }));
        }
        Err(WebSocketError::TooLarge { length, limit })
    }

    fn begin(&mut self, head: &Head) -> Result<(), WebSocketError> {
        let Head {
            last,
            kind,
            length,
            mask,
        } = *head;
        self.state = match kind {
            kind::CONTINUATION | kind::TEXT | kind::BINARY => {
                if (kind == kind::CONTINUATION) != self.within {
                    return Err(WebSocketError::Order);
                }
                self.within = !last;
                let (left, at) = (length, 0);
                State::Data { left, mask, at }
            }
            kind::CLOSE | kind::PING | kind::PONG => {
                if !last || length > LARGEST_CONTROL {
                    return Err(WebSocketError::Control);
                }
                let length = length as usize;
                State::Control { kind, length, mask }
            }
            kind => return Err(WebSocketError::Kind { kind }),
        };
        Ok(())
    }
}

/// Removes the mask from bytes at offset `at`.
fn unmask(bytes: &mut [u8], mask: [u8; MASK], at: usize) {
    for (index, byte) in bytes.iter_mut().enumerate() {
        *byte ^= mask[(at + index) % MASK];
    }
}

/// Appends the head of a whole binary frame of `length` bytes.
pub fn put_frame_head(out: &mut impl BufMut, length: usize) {
    out.put_u8(FIN | kind::BINARY);
    match (u8::try_from(length), u16::try_from(length)) {
        (Ok(short), _) if short < LENGTH_16 => out.put_u8(short),
        (_, Ok(length)) => {
            out.put_u8(LENGTH_16);
            out.put_u16(length);
        }
        _ => {
            out.put_u8(LENGTH_64);
            out.put_u64(length as u64);
        }
    }
}

/// Appends a close frame: all is well, and nothing more follows.
pub fn put_close(out: &mut impl BufMut) {
    const NORMAL: u16 = 1000;
    out.put_slice(&[FIN | kind::CLOSE, 2]);
    out.put_u16(NORMAL);
}
