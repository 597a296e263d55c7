//! What every fuzz target does with its bytes: feed them to a parser of control board messages,
//! and check what must hold whatever they are.
//!
//! The same functions are replayed over the committed corpora by `tests/fuzz_corpus.rs`.

use bytes::{Bytes, BytesMut};
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::{Bottle, Dialect, Limits};
use yarp_wrappers::control_board::messages::{Command, JointData, Reply, Request};

/// One fuzz target: its name, which is also that of its corpus, and what it does.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 3] = [
    ("request", request),
    ("streamed", streamed),
    ("state", state),
];

const DIALECTS: [Dialect; 2] = [Dialect::V3, Dialect::V4];

/// Questions, orders and replies, in binary: what is understood prints, and is understood again.
pub fn request(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for dialect in DIALECTS {
        let Ok(bottle) = Bottle::decode(&bytes, dialect, Limits::DEFAULT) else {
            continue;
        };
        if let Ok(understood) = Request::parse(&bottle)
            && let Some(printed) = understood.to_bottle()
        {
            let again = Request::parse(&printed).expect("our own words");
            // Compared as they print: a nan is not equal to itself.
            assert_eq!(format!("{again:?}"), format!("{understood:?}"), "{printed}");
        }
        let reply = Reply::from_bottle(bottle);
        let _ = (
            reply.is_ok(),
            reply.is_refusal(),
            reply.read_version(),
            reply.value(),
        );
        let _ = (reply.float(), reply.count(), reply.floats(7), reply.pair());
    }
}

/// Streamed commands: what reads also writes, and reads the same again.
pub fn streamed(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for dialect in DIALECTS {
        if let Ok(command) = Command::read_binary(&bytes, dialect) {
            let _ = command.parse();
            written(&command, dialect, |bytes| {
                Command::read_binary(bytes, dialect)
                    .map(|again| written(&again, dialect, |_| Ok(())))
            });
        }
    }
}

/// Whole states: what reads also writes, and reads the same again.
pub fn state(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for dialect in DIALECTS {
        if let Ok(state) = JointData::read_binary(&bytes, dialect) {
            written(&state, dialect, |bytes| {
                JointData::read_binary(bytes, dialect)
                    .map(|again| written(&again, dialect, |_| Ok(())))
            });
        }
    }
}

/// Writes a message and hands the bytes to `check`, which must not fail.
fn written<T>(
    object: &dyn WireObject,
    dialect: Dialect,
    check: impl Fn(&Bytes) -> Result<T, yarp_wire::bottle::DecodeError>,
) {
    let mut bytes = BytesMut::new();
    object.write_binary(&mut bytes, dialect);
    check(&bytes.freeze()).map(drop).expect("our own bytes");
}
