//! The key that both ends share.

use std::fmt;

use hmac::{Hmac, Mac};
use sha2::Sha256;

/// Length of a code in bytes.
pub(super) const CODE_LEN: usize = 32;

/// The secret of a network. Its `Debug` output does not contain the secret.
#[derive(Clone)]
pub struct Key(Hmac<Sha256>);

impl Key {
    /// Creates the key from these bytes; `None` if they are empty, which is no secret.
    pub fn new(secret: &[u8]) -> Option<Self> {
        if secret.is_empty() {
            return None;
        }
        // Any length will do: a long one is hashed first.
        Hmac::new_from_slice(secret).ok().map(Self)
    }

    /// Returns the code of a message.
    pub(super) fn code(&self, message: &[u8]) -> [u8; CODE_LEN] {
        let code = self.0.clone().chain_update(message);
        code.finalize().into_bytes().into()
    }

    /// Returns whether `code` is that of the message, in constant time.
    pub(super) fn verify(&self, message: &[u8], code: &[u8]) -> bool {
        let own = self.0.clone().chain_update(message);
        own.verify_slice(code).is_ok()
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key(..)")
    }
}
