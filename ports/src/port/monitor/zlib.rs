//! `bottle_compression_zlib`: any message, compressed.
//!
//! On the way it is a bottle of the size that the message had, an int32, and a blob in zlib's form.
//! A reader passes on as it came what is not of that form, as stock does; what would become larger
//! than [`Limits::inflated`], larger than it claims, or larger than what is left of the process's budget, is stopped.
//!
//! Source: messages between 3.5.0 and the plugin of 4.0.0.

use std::io::{Read, Write};
use std::sync::Arc;

use bytes::{Bytes, BytesMut};
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use yarp_wire::message::{Form, Payload, WireObject};
use yarp_wire::{Bottle, Limits, Value, WireVersion};

use super::{Made, Monitor, MonitorSetup, MonitorSide, Passing, of_bottle};
use crate::port::large_messages::read_bottle;
use crate::port::log_modifier::Content;
use crate::port_limits::{EXPANSION_BUDGET, Reservation};

/// Deflate makes at most this many bytes out of one.
const MAX_COMPRESSION_RATIO: usize = 1032;

/// Bytes in zlib's form.
pub(super) fn deflate(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to memory cannot fail.
    let _ = encoder.write_all(bytes);
    encoder.finish().unwrap_or_default()
}

/// The reason why bytes cannot be decompressed.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum InflateError {
    /// They are not in zlib's form, or not of the size they claim.
    Broken,
    /// They claim more than they can be, or than we take.
    TooLarge,
}

/// Returns the `size` bytes that these are in zlib's form. Takes memory only as it fills.
pub(super) fn inflate(bytes: &[u8], size: usize, limits: Limits) -> Result<Bytes, InflateError> {
    let most = bytes
        .len()
        .saturating_mul(MAX_COMPRESSION_RATIO)
        .min(limits.inflated);
    if size > most {
        return Err(InflateError::TooLarge);
    }
    let budget = EXPANSION_BUDGET.reserve(size);
    let reservation = budget.ok_or(InflateError::TooLarge)?;
    let mut inflated = Vec::new();
    let mut decoder = ZlibDecoder::new(bytes).take(size as u64 + 1);
    decoder
        .read_to_end(&mut inflated)
        .map_err(|_| InflateError::Broken)?;
    match inflated.len() {
        length if length > size => Err(InflateError::TooLarge),
        length if length < size => Err(InflateError::Broken),
        _ => Ok(Bytes::from_owner(Inflated {
            bytes: inflated,
            _reservation: reservation,
        })),
    }
}

/// Bytes that count against the budget of the process as long as somebody has them.
struct Inflated {
    bytes: Vec<u8>,
    _reservation: Reservation,
}

impl AsRef<[u8]> for Inflated {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

#[derive(Debug)]
pub(super) struct BottleZlib(MonitorSide);

impl BottleZlib {
    pub(super) fn make(setup: &MonitorSetup) -> Made {
        Ok(Arc::new(Self(setup.side)))
    }
}

impl Monitor for BottleZlib {
    fn update(&self, message: Passing) -> Option<Passing> {
        let payload = match self.0 {
            MonitorSide::Send => compress(&message.payload)?,
            MonitorSide::Receive => expand(&message.payload, Limits::DEFAULT)?,
        };
        Some(message.with(payload))
    }
}

/// Returns the bytes of a payload as a reader of `wire_version` wants them.
fn binary(payload: &Payload, wire_version: WireVersion) -> Bytes {
    let mut bytes = BytesMut::new();
    Content(payload).write_binary(&mut bytes, wire_version);
    bytes.freeze()
}

/// Compresses the message; `None` if its size exceeds an int32.
fn compress(payload: &Payload) -> Option<Payload> {
    let bytes = binary(payload, payload.wire_version());
    let size = i32::try_from(bytes.len()).ok()?;
    let blob = Value::Blob(deflate(&bytes).into());
    Some(of_bottle(&Bottle::from_iter([size.into(), blob])))
}

/// Decompresses the message; other messages pass unchanged; `None` if the result is too large.
fn expand(payload: &Payload, limits: Limits) -> Option<Payload> {
    let as_it_came = || Some(payload.clone());
    let Ok((bottle, _reservation)) = read_bottle(payload) else {
        return as_it_came();
    };
    let size = bottle.get(0).and_then(Value::as_i64);
    let blob = bottle.get(1).and_then(Value::as_blob);
    let (Some(Ok(size)), Some(blob)) = (size.map(usize::try_from), blob) else {
        return as_it_came();
    };
    match inflate(blob, size, limits) {
        Ok(bytes) => Some(Payload::new(bytes, Form::Binary(payload.wire_version()))),
        Err(InflateError::Broken) => as_it_came(),
        Err(InflateError::TooLarge) => {
            let bytes = blob.len();
            tracing::debug!(bytes, size, "a compressed message is dropped: too large");
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn payload(text: &str) -> Payload {
        of_bottle(&Bottle::parse(text).unwrap())
    }

    /// The output of the plugin of 4.0.0 in a port of 3.5.0 for `1 2.5 hello (a b)` and for `2`.
    const STOCK: [(&str, &str); 2] = [
        (
            "59 {120 156 99 96 100 96 96 97 96 96 96 132 98 46 6 24 96 113 0 137 179 2 113 70 106 78 \
             78 62 11 80 150 9 170 40 17 68 36 1 0 59 163 3 63}",
            "1 2.5 hello (a b)",
        ),
        ("12 {120 156 99 100 100 96 0 34 6 38 32 6 0 0 51 0 6}", "2"),
    ];

    #[test]
    fn compression_is_compatible_with_stock() {
        for (compressed, message) in STOCK {
            let expanded = expand(&payload(compressed), Limits::DEFAULT).unwrap();
            assert_eq!(expanded.to_bottle().unwrap().to_string(), message);
            let ours = compress(&payload(message)).unwrap().to_bottle().unwrap();
            let stock = Bottle::parse(compressed).unwrap();
            assert_eq!(ours.get(0), stock.get(0));
            let inflated = |bottle: &Bottle| {
                let size = bottle.get(0).unwrap().as_i64().unwrap() as usize;
                inflate(
                    bottle.get(1).unwrap().as_blob().unwrap(),
                    size,
                    Limits::DEFAULT,
                )
            };
            assert_eq!(inflated(&ours), inflated(&stock));
        }
    }

    #[test]
    fn uncompressed_messages_pass_unchanged() {
        for text in ["", "hello", "5 {1 2 3}", "1 2", "-1 {1}", "{1 2} 3"] {
            let message = payload(text);
            assert_eq!(expand(&message, Limits::DEFAULT), Some(message), "{text}");
        }
    }

    #[test]
    fn a_bomb_is_stopped() {
        let limits = Limits::DEFAULT.with_inflated(1000);
        let bomb = deflate(&vec![0; 100_000]);
        assert_eq!(inflate(&bomb, 100_000, limits), Err(InflateError::TooLarge));
        assert_eq!(inflate(&bomb, 1000, limits), Err(InflateError::TooLarge));
        // It claims more than bytes of its number can hold.
        assert_eq!(
            inflate(&bomb[..20], 100_000, Limits::DEFAULT),
            Err(InflateError::TooLarge)
        );
        let message = Bottle::from_iter([Value::Int32(100_000), Value::Blob(bomb.into())]);
        assert_eq!(expand(&of_bottle(&message), limits), None);
    }

    proptest! {
        #[test]
        fn compression_round_trip(bytes in proptest::collection::vec(0..4u8, 0..3000)) {
            let message = Payload::new(bytes.into(), Form::Binary(WireVersion::V3));
            let there = compress(&message).unwrap();
            prop_assert_eq!(expand(&there, Limits::DEFAULT).unwrap(), message);
        }
    }
}
