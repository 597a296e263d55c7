//! The handshake of `auth.conf`: both ends of a connection show that they hold the same key.
//!
//! It comes before any other byte, on every TCP connection, also to the name server:
//!
//! | step | from | bytes |
//! | --- | --- | --- |
//! | 1 | acceptor | a nonce of 8 bytes, and the HMAC-SHA256 of it: 32 bytes |
//! | 2 | initiator | a nonce, and the HMAC of both nonces so far |
//! | 3 | acceptor | a nonce, and the HMAC of all three |
//!
//! The key of the HMAC is the text of `auth.conf` as it stands. What follows is neither encrypted
//! nor signed, and what travels as datagrams is not covered. Source: stock 3.5.0, asked byte by
//! byte.

mod key_handshake;
mod shared_key;

pub use key_handshake::{AuthError, KeyHandshake, NONCE_LEN, Nonce, STEP_LEN};
pub use shared_key::Key;
