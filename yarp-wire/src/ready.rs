//! The result of decoders that are fed as bytes arrive.

/// Result of one call of a decoder that takes bytes as they arrive.
///
/// | value | meaning |
/// | --- | --- |
/// | `Ok(Some(value))` | the value is complete; bytes behind it are untouched |
/// | `Ok(None)` | bytes are missing: call again with the same input when more have arrived |
/// | `Err(error)` | the bytes are invalid, whatever follows: close the connection |
///
/// A decoder takes its bytes from a `BytesMut`, or returns how many they are next to the value. It
/// never sees the end of the stream: whoever reads the socket does. A decoder that knows how many
/// bytes are missing says so in a method `missing`; [`Scan`](crate::bottle::Scan) holds the number
/// itself.
pub type Ready<T, E> = Result<Option<T>, E>;
