//! Encrypted connections: the carrier `tls`, and connections of other carriers where encryption is required.
//!
//! | file | what it does |
//! | --- | --- |
//! | `tls_conf` | `tls.conf`: the lab's authority, the certificate and key of this host, whether encryption is required |
//! | `handshake` | the handshake of either end, in bounded time |
//! | `stream` | reads and writes on an encrypted TCP stream, without waiting |
//!
//! The whole connection is inside TLS 1.3, the header of YARP included: the side that connected begins with a `ClientHello`,
//! whose first byte no carrier begins with. Only the handshake of `auth.conf` comes before. Both ends show a certificate of
//! the lab's authority. `docs/tls.md` has the design.

mod handshake;
mod stream;
mod tls_conf;

use std::io;

pub use handshake::TlsError;
pub(crate) use handshake::{accept, initiate, is_hello};
pub(crate) use stream::TlsStream;
pub(crate) use tls_conf::{FILE, load};
pub use tls_conf::{Required, Tls};

/// Returns an error of TLS as one of the stream.
fn invalid(error: rustls::Error) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, error)
}
