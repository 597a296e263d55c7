//! Bounds on the resources that a peer can claim.

/// Bounds on the sizes that the bytes of a peer can claim.
///
/// A claim above a bound is an error that closes that connection; a claim below it costs nothing
/// until the bytes themselves arrive.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct Limits {
    /// Largest message payload in bytes.
    pub message: usize,
    /// Longest line on a text connection in bytes, and longest text message.
    pub line: usize,
    /// Deepest nesting of lists.
    pub depth: usize,
    /// Maximum number of values in one binary bottle: each takes some 40 bytes in memory. Typed
    /// messages such as vectors and images do not count as bottles.
    pub values: usize,
    /// Maximum size of a decompressed payload, in bytes.
    pub inflated: usize,
}

impl Limits {
    /// 1 GiB messages, 4 MiB of text, lists nested 200 deep, 4 million values, 256 MiB out of
    /// compressed ones.
    pub const DEFAULT: Self = Self {
        message: 1 << 30,
        line: 4 << 20,
        depth: 200,
        values: 4 << 20,
        inflated: 256 << 20,
    };

    /// Returns the same bounds with another maximum message size, in bytes.
    pub const fn with_message(mut self, bytes: usize) -> Self {
        self.message = bytes;
        self
    }

    /// Returns the same bounds with another maximum size of a decompressed payload, in bytes.
    pub const fn with_inflated(mut self, bytes: usize) -> Self {
        self.inflated = bytes;
        self
    }

    /// Returns the same bounds with another maximum line length, in bytes.
    pub const fn with_line(mut self, bytes: usize) -> Self {
        self.line = bytes;
        self
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self::DEFAULT
    }
}
