//! What a peer may make us hold.

/// Bounds on what the bytes of a peer can claim.
///
/// A claim above a bound is an error that ends that connection; a claim below it costs nothing
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
    /// Most values of one binary bottle: each takes some 40 bytes once it is read. Typed messages
    /// such as vectors and images are not bottles in this sense.
    pub values: usize,
    /// Largest payload that a compressed one may become, in bytes.
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

    /// The same bounds with another largest message, in bytes.
    pub const fn with_message(mut self, bytes: usize) -> Self {
        self.message = bytes;
        self
    }

    /// The same bounds with another largest payload out of a compressed one, in bytes.
    pub const fn with_inflated(mut self, bytes: usize) -> Self {
        self.inflated = bytes;
        self
    }

    /// The same bounds with another longest line, in bytes.
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
