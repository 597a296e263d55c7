//! Short words packed into one integer.

use std::fmt;

/// A word of up to four ASCII characters in 32 bits, first character in the lowest byte.
///
/// ```
/// use yarp_wire::Vocab32;
/// const POSITION: Vocab32 = Vocab32::new("pos");
/// assert_eq!(POSITION.code(), 7_565_168);
/// assert_eq!(POSITION.to_string(), "pos");
/// ```
#[derive(Clone, Copy, Debug, Default, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct Vocab32(u32);

/// A word of up to eight ASCII characters in 64 bits, first character in the lowest byte.
///
/// Only YARP 4.0 knows it; YARP 3.x keeps the first four characters.
#[derive(Clone, Copy, Debug, Default, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct Vocab64(u64);

impl Vocab32 {
    /// `true` on the wire: the character `1`.
    pub const TRUE: Self = Self(b'1' as u32);
    /// `false` on the wire.
    pub const FALSE: Self = Self(0);
    /// The answer to a successful command.
    pub const OK: Self = Self::new("ok");
    /// The answer to a failed command.
    pub const FAIL: Self = Self::new("fail");
    /// First item of an answer that is several lines.
    pub const MANY: Self = Self::new("many");

    /// Packs the first four bytes of `word`; further ones are dropped, as every peer does.
    pub const fn new(word: &str) -> Self {
        Self::from_bytes(word.as_bytes())
    }

    /// Packs the first four of `bytes`.
    pub const fn from_bytes(bytes: &[u8]) -> Self {
        let mut code = 0u32;
        let mut i = 0;
        while i < bytes.len() && i < 4 {
            code |= (bytes[i] as u32) << (8 * i);
            i += 1;
        }
        Self(code)
    }

    /// Returns the word with this code, which may be unknown.
    pub const fn from_code(code: u32) -> Self {
        Self(code)
    }

    /// Returns the code on the wire.
    pub const fn code(self) -> u32 {
        self.0
    }

    /// Returns the characters, zero bytes left out.
    pub fn bytes(self) -> impl Iterator<Item = u8> {
        self.0.to_le_bytes().into_iter().filter(|b| *b != 0)
    }
}

impl Vocab64 {
    /// Packs the first eight bytes of `word`.
    pub const fn new(word: &str) -> Self {
        Self::from_bytes(word.as_bytes())
    }

    /// Packs the first eight of `bytes`.
    pub const fn from_bytes(bytes: &[u8]) -> Self {
        let mut code = 0u64;
        let mut i = 0;
        while i < bytes.len() && i < 8 {
            code |= (bytes[i] as u64) << (8 * i);
            i += 1;
        }
        Self(code)
    }

    /// Returns the word with this code.
    pub const fn from_code(code: u64) -> Self {
        Self(code)
    }

    /// Returns the code on the wire.
    pub const fn code(self) -> u64 {
        self.0
    }

    /// Returns the word that a reader of YARP 3.x sees: the first four characters.
    pub const fn truncated(self) -> Vocab32 {
        Vocab32(self.0 as u32)
    }

    /// Returns the characters, zero bytes left out.
    pub fn bytes(self) -> impl Iterator<Item = u8> {
        self.0.to_le_bytes().into_iter().filter(|b| *b != 0)
    }
}

impl fmt::Display for Vocab32 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.bytes()
            .try_for_each(|b| write!(f, "{}", char::from(b)))
    }
}

impl fmt::Display for Vocab64 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.bytes()
            .try_for_each(|b| write!(f, "{}", char::from(b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_pack_from_the_lowest_byte() {
        assert_eq!(Vocab32::new("ok").code(), 0x6b6f);
        assert_eq!(Vocab32::new("torq").code(), 1_903_325_044);
        assert_eq!(Vocab32::new("toolong"), Vocab32::new("tool"));
        assert_eq!(Vocab64::new("abcde").truncated(), Vocab32::new("abcd"));
        assert_eq!(Vocab32::new("a").to_string(), "a");
    }
}
