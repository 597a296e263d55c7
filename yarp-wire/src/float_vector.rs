//! Lists of equal numbers without a [`Value`](crate::Value) for each.

use bytes::{Buf, BufMut, Bytes, BytesMut};

use crate::bottle::DecodeError;
use crate::message::{ReadObject, WireObject};
use crate::message_limits::Limits;
use crate::wire_version::WireVersion;

/// Floating point numbers, stock's `yarp::sig::Vector`.
///
/// ```text
/// int32 256 + code of float64   int32 n   n x float64
/// ```
///
/// The same bytes are a bottle of n floats. Stock readers refuse an empty vector.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vector(pub Vec<f64>);

/// Returns the list code of a vector of float64 for readers of `wire_version`.
pub const fn float64_list(wire_version: WireVersion) -> i32 {
    match wire_version {
        WireVersion::V3 => 256 + 10,
        WireVersion::V4 => 256 + 20,
    }
}

/// Appends `values` as a vector.
pub fn put_float64s(out: &mut BytesMut, values: &[f64], wire_version: WireVersion) {
    out.put_i32_le(float64_list(wire_version));
    out.put_i32_le(values.len() as i32);
    out.reserve(8 * values.len());
    for value in values {
        out.put_f64_le(*value);
    }
}

impl WireObject for Vector {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        put_float64s(out, &self.0, wire_version);
    }
}

impl ReadObject for Vector {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut rest = bytes.clone();
        let vector = take_vector(&mut rest, wire_version)?;
        match rest.len() {
            0 => Ok(vector),
            extra => Err(DecodeError::Trailing {
                length: bytes.len() - extra,
                extra,
            }),
        }
    }
}

/// Takes a vector from the front of `bytes`.
pub fn take_vector(bytes: &mut Bytes, wire_version: WireVersion) -> Result<Vector, DecodeError> {
    let have = bytes.len();
    let Some(head) = bytes.first_chunk::<8>() else {
        return Err(DecodeError::Truncated { have, need: 8 });
    };
    let (code, count) = head.split_at(4);
    let code = i32::from_le_bytes(code.try_into().expect("four bytes"));
    let count = i32::from_le_bytes(count.try_into().expect("four bytes"));
    if code != float64_list(wire_version) {
        return Err(DecodeError::UnknownCode {
            code,
            at: 0,
            wire_version,
        });
    }
    let count = usize::try_from(count).map_err(|_| DecodeError::NegativeLength {
        length: count,
        at: 4,
    })?;
    let need = 8 + 8 * count;
    if need > Limits::DEFAULT.message {
        let limit = Limits::DEFAULT.message;
        return Err(DecodeError::TooLong { limit });
    }
    if have < need {
        return Err(DecodeError::Truncated { have, need });
    }
    bytes.advance(8);
    let values = (0..count).map(|_| bytes.get_f64_le()).collect();
    Ok(Vector(values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Bottle;

    #[test]
    fn a_vector_is_a_bottle_of_floats() {
        for wire_version in [WireVersion::V3, WireVersion::V4] {
            let vector = Vector(vec![1.0, -2.5]);
            let mut bytes = BytesMut::new();
            vector.write_binary(&mut bytes, wire_version);
            let bytes = bytes.freeze();
            assert_eq!(
                bytes,
                Bottle::parse("1.0 -2.5").unwrap().encode(wire_version)
            );
            assert_eq!(Vector::read_binary(&bytes, wire_version), Ok(vector));
            assert!(Vector::read_binary(&bytes.slice(..20), wire_version).is_err());
        }
        let mut text = BytesMut::new();
        Vector(vec![1.0]).write_text(&mut text);
        assert_eq!(text, "1.0\n");
    }
}
