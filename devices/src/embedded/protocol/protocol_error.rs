//! What bytes can be that are no message.

/// Why a stream cannot be read on; the connection has to end.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolError {
    /// Three characters that are no header, so that nobody knows where the next one begins.
    #[error("header \"{}\" is unknown, expected one of moc, gcp, moj, gja, gra, hom, shu, trf", .0.escape_ascii())]
    UnknownHeader([u8; 3]),
    /// Neither `d` nor `q`.
    #[error("answer begins with \"{}\", expected the acknowledgement \"d\" or \"q\"", [*.0].escape_ascii())]
    NotAnAcknowledgement(u8),
    /// More bytes than the answer has.
    #[error("{0} bytes behind the end of the answer, which nobody asked for")]
    Surplus(usize),
    /// A field of an asynchronous packet has a value that it cannot have.
    #[error("asynchronous packet with {field} {value}, expected {expected}")]
    Packet {
        /// The field of table 13.
        field: &'static str,
        /// What it holds.
        value: i32,
        /// What it can hold.
        expected: &'static str,
    },
}
