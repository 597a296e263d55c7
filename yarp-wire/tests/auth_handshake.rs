//! The key handshake with any input: only peers that hold the key pass.

use bytes::BytesMut;
use proptest::prelude::*;
use yarp_wire::auth::{AuthError, Key, KeyHandshake, NONCE_LEN, Nonce, STEP_LEN};

fn key(secret: &[u8]) -> Key {
    Key::new(secret).unwrap()
}

/// Feeds the output of one side to the other, `size` bytes at a time.
fn hear(
    side: &mut KeyHandshake,
    said: &[u8],
    size: usize,
    output: &mut BytesMut,
) -> Result<bool, AuthError> {
    let mut input = BytesMut::new();
    let mut through = side.poll(&mut input, output)?;
    for piece in said.chunks(size) {
        assert!(!through, "more is sent than is asked for");
        assert!(side.missing(&input) >= piece.len());
        input.extend_from_slice(piece);
        through = side.poll(&mut input, output)?;
    }
    assert!(input.is_empty());
    Ok(through)
}

/// Runs the three steps; returns the bytes of each and the number of completed steps.
fn run(
    keys: [&Key; 2],
    nonces: [Nonce; 3],
    size: usize,
    spoil: Option<usize>,
) -> Result<(), usize> {
    let (mut first, mut second, mut third) = (BytesMut::new(), BytesMut::new(), BytesMut::new());
    let spoilt = |step: usize, said: &mut BytesMut| {
        if let Some(bit) = spoil
            && bit / 8 / STEP_LEN == step
        {
            said[bit / 8 % STEP_LEN] ^= 1 << (bit % 8);
        }
    };
    let [accepting, connecting] = keys.map(Key::clone);
    let mut acceptor = KeyHandshake::accept(accepting, [nonces[0], nonces[2]], &mut first);
    let mut initiator = KeyHandshake::initiate(connecting, nonces[1]);
    spoilt(0, &mut first);
    let through = hear(&mut initiator, &first, size, &mut second).map_err(|error| error.step)?;
    assert!(!through);
    spoilt(1, &mut second);
    let through = hear(&mut acceptor, &second, size, &mut third).map_err(|error| error.step)?;
    assert!(through);
    spoilt(2, &mut third);
    let through = hear(&mut initiator, &third, size, &mut first).map_err(|error| error.step)?;
    assert!(through);
    assert_eq!([second.len(), third.len()], [STEP_LEN; 2]);
    Ok(())
}

proptest! {
    #[test]
    fn peers_that_share_a_key_complete_the_handshake(
        secret in proptest::collection::vec(any::<u8>(), 1..200),
        nonces in any::<[Nonce; 3]>(),
        size in 1..=STEP_LEN,
    ) {
        let key = key(&secret);
        prop_assert_eq!(run([&key, &key], nonces, size, None), Ok(()));
    }

    #[test]
    fn another_key_is_refused_at_the_first_step(
        secrets in any::<[[u8; 5]; 2]>(),
        nonces in any::<[Nonce; 3]>(),
    ) {
        prop_assume!(secrets[0] != secrets[1]);
        let keys = secrets.map(|secret| key(&secret));
        prop_assert_eq!(run([&keys[0], &keys[1]], nonces, STEP_LEN, None), Err(1));
    }

    #[test]
    fn a_single_wrong_bit_is_refused_at_its_step(
        nonces in any::<[Nonce; 3]>(),
        bit in 0..3 * STEP_LEN * 8,
    ) {
        let key = key(b"secret");
        prop_assert_eq!(run([&key, &key], nonces, STEP_LEN, Some(bit)), Err(bit / 8 / STEP_LEN + 1));
    }

    #[test]
    fn noise_never_gets_through(
        noise in proptest::collection::vec(any::<u8>(), 0..4 * STEP_LEN),
        nonces in any::<[Nonce; 3]>(),
    ) {
        let key = key(b"secret");
        let mut output = BytesMut::new();
        let mut acceptor = KeyHandshake::accept(key.clone(), [nonces[0], nonces[2]], &mut output);
        let mut input = BytesMut::from(&noise[..]);
        let expected = match noise.len() {
            0..STEP_LEN => Ok(false),
            _ => Err(AuthError { step: 2 }),
        };
        prop_assert_eq!(acceptor.poll(&mut input, &mut output), expected);
        let mut initiator = KeyHandshake::initiate(key, nonces[1]);
        let mut input = BytesMut::from(&noise[..]);
        output.clear();
        let through = initiator.poll(&mut input, &mut output);
        prop_assert_ne!(through, Ok(true));
        prop_assert!(output.is_empty(), "nothing is said to who has not shown the key");
    }
}

/// The acceptor's bytes cannot be replayed to it, nor to another acceptor of the same network.
#[test]
fn the_steps_of_others_are_no_answer() {
    let key = key(b"secret");
    let (mut said, mut more) = (BytesMut::new(), BytesMut::new());
    let mut acceptor =
        KeyHandshake::accept(key.clone(), [[1; NONCE_LEN], [2; NONCE_LEN]], &mut said);
    let mut other = KeyHandshake::accept(key, [[3; NONCE_LEN], [4; NONCE_LEN]], &mut more);
    let mut output = BytesMut::new();
    let refused = Err(AuthError { step: 2 });
    assert_eq!(other.poll(&mut said.clone(), &mut output), refused);
    assert_eq!(acceptor.poll(&mut said, &mut output), refused);
    assert!(output.is_empty());
}

/// A peer that sends its header at once is not read further than the handshake goes.
#[test]
fn bytes_after_the_handshake_are_not_consumed() {
    let key = key(b"secret");
    let (mut first, mut second) = (BytesMut::new(), BytesMut::new());
    let mut acceptor =
        KeyHandshake::accept(key.clone(), [[1; NONCE_LEN], [2; NONCE_LEN]], &mut first);
    let mut initiator = KeyHandshake::initiate(key, [3; NONCE_LEN]);
    assert_eq!(initiator.poll(&mut first, &mut second), Ok(false));
    second.extend_from_slice(b"CONNECT /early\r\n");
    assert_eq!(acceptor.poll(&mut second, &mut first), Ok(true));
    assert_eq!(&second[..], b"CONNECT /early\r\n");
    assert_eq!(acceptor.missing(&second), 0);
}
