//! The handshake of `auth.conf`: both ends of a connection prove that they hold the same key.
//!
//! It precedes every other byte on every TCP connection, including those to the name server:
//!
//! | step | from | bytes |
//! | --- | --- | --- |
//! | 1 | acceptor | a nonce of 8 bytes, and the HMAC-SHA256 of it: 32 bytes |
//! | 2 | initiator | a nonce, and the HMAC of both nonces so far |
//! | 3 | acceptor | a nonce, and the HMAC of all three |
//!
//! The key of the HMAC is the text of `auth.conf` unchanged. Later bytes are neither encrypted nor
//! signed, and datagrams are not covered. Source: stock 3.5.0, probed byte by byte.

mod key_handshake;
mod shared_key;

pub use key_handshake::{AuthError, KeyHandshake, NONCE_LEN, Nonce, STEP_LEN};
pub use shared_key::Key;
