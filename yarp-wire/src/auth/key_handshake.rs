//! Both sides of the key handshake, as state machines without I/O.

use bytes::{Buf, BufMut, BytesMut};

use super::Key;
use super::shared_key::CODE_LEN;

/// Bytes of a nonce.
pub const NONCE_LEN: usize = 8;
/// Bytes of each step: a nonce and a code.
pub const STEP_LEN: usize = NONCE_LEN + CODE_LEN;

/// Random bytes that must be unpredictable and are never reused.
pub type Nonce = [u8; NONCE_LEN];

/// The reason for refusing a peer: it does not hold the key.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
#[error("step {step} of 3 was not made with our key")]
pub struct AuthError {
    /// The step that failed: 1 and 3 are the acceptor's, 2 is the initiator's.
    pub step: usize,
}

/// One side of the handshake.
///
/// ```
/// use bytes::BytesMut;
/// use yarp_wire::auth::{KeyHandshake, Key};
///
/// let key = Key::new(b"my_secret_key").unwrap();
/// let (mut here, mut there) = (BytesMut::new(), BytesMut::new());
/// let mut acceptor = KeyHandshake::accept(key.clone(), [[1; 8], [3; 8]], &mut there);
/// let mut initiator = KeyHandshake::initiate(key, [2; 8]);
/// assert_eq!(initiator.poll(&mut there, &mut here), Ok(false));
/// assert_eq!(acceptor.poll(&mut here, &mut there), Ok(true));
/// assert_eq!(initiator.poll(&mut there, &mut here), Ok(true));
/// ```
#[derive(Debug)]
pub struct KeyHandshake {
    key: Key,
    /// The nonces so far, from both sides: three at the end.
    said: Vec<u8>,
    /// The own nonces that have not been sent yet.
    own: std::vec::IntoIter<Nonce>,
    /// Number of steps that have not been received yet.
    to_hear: usize,
}

impl KeyHandshake {
    /// Creates the accepting side, which sends first.
    pub fn accept(key: Key, nonces: [Nonce; 2], output: &mut BytesMut) -> Self {
        let mut handshake = Self::new(key, nonces.to_vec(), 1);
        handshake.say(output);
        handshake
    }

    /// Creates the connecting side.
    pub fn initiate(key: Key, nonce: Nonce) -> Self {
        Self::new(key, vec![nonce], 2)
    }

    fn new(key: Key, own: Vec<Nonce>, to_hear: usize) -> Self {
        Self {
            key,
            said: Vec::with_capacity(3 * NONCE_LEN),
            own: own.into_iter(),
            to_hear,
        }
    }

    /// Consumes received bytes from `input` and appends the answer to `output`; returns whether the
    /// peer has proved that it holds the key. After an error the connection must be closed.
    ///
    /// Not a [`Ready`](crate::Ready): the handshake decodes no value, and ends with a yes.
    ///
    /// Never consumes more than the handshake itself.
    pub fn poll(&mut self, input: &mut BytesMut, output: &mut BytesMut) -> Result<bool, AuthError> {
        while self.to_hear > 0 {
            let Some(step) = input.first_chunk::<STEP_LEN>() else {
                return Ok(false);
            };
            let (nonce, code) = step.split_at(NONCE_LEN);
            self.said.extend_from_slice(nonce);
            if !self.key.verify(&self.said, code) {
                let step = self.said.len() / NONCE_LEN;
                return Err(AuthError { step });
            }
            input.advance(STEP_LEN);
            self.to_hear -= 1;
            self.say(output);
        }
        Ok(true)
    }

    /// Returns the number of bytes that are missing before the handshake can continue; 0 when it is
    /// complete.
    pub fn missing(&self, input: &BytesMut) -> usize {
        match self.to_hear {
            0 => 0,
            _ => STEP_LEN.saturating_sub(input.len()),
        }
    }

    /// Sends the next step, if there is one.
    fn say(&mut self, output: &mut BytesMut) {
        if let Some(nonce) = self.own.next() {
            self.said.extend_from_slice(&nonce);
            output.put_slice(&nonce);
            output.put_slice(&self.key.code(&self.said));
        }
    }
}

#[cfg(test)]
mod tests {
    use yarp_testing::from_hex as hex;

    use super::*;

    /// Codes that another implementation of HMAC-SHA256 gave for the same key and nonces.
    #[test]
    fn the_bytes_are_those_of_the_standard() {
        let key = Key::new(b"my_secret_key").unwrap();
        let nonces: [Nonce; 3] =
            std::array::from_fn(|number| std::array::from_fn(|index| (8 * number + index) as u8));
        let mut wire = BytesMut::new();
        let mut acceptor = KeyHandshake::accept(key.clone(), [nonces[0], nonces[2]], &mut wire);
        let mut initiator = KeyHandshake::initiate(key, nonces[1]);
        let check = |wire: &BytesMut, nonce: Nonce, code: &str| {
            assert_eq!(wire[..NONCE_LEN], nonce);
            assert_eq!(wire[NONCE_LEN..], hex(code));
        };
        check(
            &wire,
            nonces[0],
            "99ce3c33290be20779b3723bf17c9a3800a80bb28aa0f7df1cd15d2c34ff7809",
        );
        let mut back = BytesMut::new();
        assert_eq!(initiator.poll(&mut wire, &mut back), Ok(false));
        check(
            &back,
            nonces[1],
            "7ec0ce5bf8390190180021f906e347a41ae9fa9805eea526aa5bbdd907dcc043",
        );
        assert_eq!(acceptor.poll(&mut back, &mut wire), Ok(true));
        check(
            &wire,
            nonces[2],
            "683068ee132fccffca210bfa57a64bc6c78a26ffeb8fc761fae54cafbd762764",
        );
        assert_eq!(initiator.poll(&mut wire, &mut back), Ok(true));
        assert!(wire.is_empty() && back.is_empty());
    }

    #[test]
    fn no_key_is_made_of_nothing_and_none_is_printed() {
        assert!(Key::new(b"").is_none());
        let key = Key::new(b"my_secret_key").unwrap();
        assert_eq!(format!("{key:?}"), "Key(..)");
    }
}
