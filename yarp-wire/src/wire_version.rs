//! The two wire versions of the binary bottle.

/// The version of the binary form in which a message is written or read.
///
/// YARP 4.0 gave the codes of floating point values new meanings, so that the same number
/// stands for values of different sizes:
///
/// | code | 3.x | 4.0 |
/// | --- | --- | --- |
/// | 10 | float64, 8 bytes | float32, 4 bytes |
/// | 18 | - | vocab64, 8 bytes |
/// | 20 | - | float64, 8 bytes |
/// | 128 | float32, 4 bytes | - |
///
/// A connection does not announce the wire version. A message that holds one of these codes reveals
/// it, because its bytes add up in one wire version only (see [`crate::bottle::detect`]). Text
/// connections are the same in both.
///
/// Source: bytes written by 3.5.0, and recorded traffic of 3.12.3 and 4.0.0.
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq)]
pub enum WireVersion {
    /// YARP 3.x.
    #[default]
    V3,
    /// YARP 4.0.
    V4,
}

impl WireVersion {
    /// Returns the other wire version.
    pub const fn other(self) -> Self {
        match self {
            Self::V3 => Self::V4,
            Self::V4 => Self::V3,
        }
    }
}

impl std::fmt::Display for WireVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::V3 => "3.x",
            Self::V4 => "4.0",
        })
    }
}
