//! Reading an object that stands in front of others.

use bytes::{Buf, Bytes};

use crate::bottle::{Bottle, DecodeError};
use crate::message_limits::Limits;
use crate::wire_version::WireVersion;

/// An object whose own bytes determine its end, so that it can be part of a message.
///
/// A [`ReadObject`](crate::message::ReadObject) gets a whole message; a `ReadPrefix` consumes its
/// part and leaves the rest. [`read_whole`] derives the former from the latter.
pub trait ReadPrefix: Sized {
    /// Reads the object from the front of `bytes`.
    ///
    /// After an error the position of `bytes` is unspecified. Nothing is allocated for a claimed
    /// length before the bytes are present.
    fn take(bytes: &mut Bytes, wire_version: WireVersion) -> Result<Self, DecodeError>;
}

/// Reads an object that fills `bytes` exactly.
pub fn read_whole<T: ReadPrefix>(
    bytes: &Bytes,
    wire_version: WireVersion,
) -> Result<T, DecodeError> {
    let mut rest = bytes.clone();
    let object = T::take(&mut rest, wire_version)?;
    match rest.len() {
        0 => Ok(object),
        extra => Err(DecodeError::Trailing {
            length: bytes.len() - extra,
            extra,
        }),
    }
}

impl ReadPrefix for Bottle {
    fn take(bytes: &mut Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let (bottle, length) = Self::decode_prefix(bytes, wire_version, Limits::DEFAULT)?;
        bytes.advance(length);
        Ok(bottle)
    }
}

/// Reads the words of a fixed layout, keeping track of the position.
pub(super) struct Front<'a> {
    bytes: &'a mut Bytes,
    whole: usize,
    expected: &'static str,
}

impl<'a> Front<'a> {
    /// Starts to read an object; `expected` describes it in errors.
    pub(super) fn new(bytes: &'a mut Bytes, expected: &'static str) -> Self {
        let whole = bytes.len();
        Self {
            bytes,
            whole,
            expected,
        }
    }

    /// Returns the error of bytes that are something else.
    pub(super) fn shape(&self) -> DecodeError {
        DecodeError::Shape {
            expected: self.expected,
        }
    }

    /// The bytes that were not taken yet.
    pub(super) fn rest(&mut self) -> &mut Bytes {
        self.bytes
    }

    /// The next `N` bytes.
    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        let array = *self
            .bytes
            .first_chunk::<N>()
            .ok_or_else(|| self.truncated(N))?;
        self.bytes.advance(N);
        Ok(array)
    }

    /// The next number.
    pub(super) fn i32(&mut self) -> Result<i32, DecodeError> {
        self.array().map(i32::from_le_bytes)
    }

    /// The next numbers, which have to be these.
    pub(super) fn words(&mut self, words: &[i32]) -> Result<(), DecodeError> {
        for word in words {
            if self.i32()? != *word {
                return Err(self.shape());
            }
        }
        Ok(())
    }

    /// The next number, as a count.
    pub(super) fn count(&mut self) -> Result<usize, DecodeError> {
        let at = self.whole - self.bytes.len();
        let length = self.i32()?;
        usize::try_from(length).map_err(|_| DecodeError::NegativeLength { length, at })
    }

    /// The next `count` elements of `width` bytes, shared with the message.
    pub(super) fn run(&mut self, count: usize, width: usize) -> Result<Bytes, DecodeError> {
        let limit = Limits::DEFAULT.message;
        let length = count
            .checked_mul(width)
            .filter(|length| *length <= limit)
            .ok_or(DecodeError::TooLong { limit })?;
        if self.bytes.len() < length {
            return Err(self.truncated(length));
        }
        Ok(self.bytes.split_to(length))
    }

    fn truncated(&self, missing: usize) -> DecodeError {
        DecodeError::Truncated {
            have: self.whole,
            need: self.whole - self.bytes.len() + missing,
        }
    }
}
