//! Errors of the protocol.

/// Reasons why a stream cannot be parsed further; the connection has to end.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolError {
    /// Three characters that are not a header, so that the start of the next one is unknown.
    #[error("header \"{}\" is unknown, expected one of moc, gcp, moj, gja, gra, hom, shu, trf", .0.escape_ascii())]
    UnknownHeader([u8; 3]),
    /// Neither `d` nor `q`.
    #[error("answer begins with \"{}\", expected the acknowledgement \"d\" or \"q\"", [*.0].escape_ascii())]
    NotAnAcknowledgement(u8),
    /// More bytes than the answer has.
    #[error("{0} unexpected bytes after the end of the reply")]
    Surplus(usize),
    /// A field of an asynchronous packet has a value that it cannot have.
    #[error("asynchronous packet with {field} {value}, expected {expected}")]
    Packet {
        /// The field of table 13.
        field: &'static str,
        /// The value found.
        value: i32,
        /// The values allowed.
        expected: &'static str,
    },
}
