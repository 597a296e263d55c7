//! Stamps as messages of their own.

use bytes::{BufMut, Bytes, BytesMut};

use super::prefix_reader::{Front, ReadPrefix, read_whole};
use crate::bottle::{Bottle, DecodeError};
use crate::float_vector::float64_list;
use crate::message::{Form, Payload, ReadObject, WireObject};
use crate::stamp::Stamp;
use crate::wire_version::WireVersion;

/// Returns the code of one float64 in a mixed list.
fn float64(wire_version: WireVersion) -> i32 {
    float64_list(wire_version) - 256
}

/// ```text
/// 256  2             list of two; a header of 3.x and 4.0 has three
/// 1    count
/// 10 or 20           float64 in 3.x or 4.0
/// time               float64, seconds
/// 4 length bytes     only in a list of three: the name of a frame, which is passed over
/// ```
///
/// In text a stamp is printed with 15 significant digits, and ended by CR LF unlike other types.
/// Source: bytes and text written by 3.5.0.
impl WireObject for Stamp {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        for word in [256, 2, 1, self.count, float64(wire_version)] {
            out.put_i32_le(word);
        }
        out.put_f64_le(self.time);
    }

    fn write_text(&self, out: &mut BytesMut) {
        out.put_slice(self.to_string().as_bytes());
        out.put_slice(b"\r\n");
    }
}

const EXPECTED: &str = "a stamp: count and time";

impl ReadPrefix for Stamp {
    fn take(bytes: &mut Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut front = Front::new(bytes, EXPECTED);
        front.words(&[256])?;
        let items = front.i32()?;
        if items != 2 && items != 3 {
            return Err(front.shape());
        }
        front.words(&[1])?;
        let count = front.i32()?;
        front.words(&[float64(wire_version)])?;
        let time = f64::from_le_bytes(front.array()?);
        if items == 3 {
            front.words(&[4])?;
            let length = front.count()?;
            front.run(length, 1)?;
        }
        Ok(Self { count, time })
    }
}

impl ReadObject for Stamp {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        read_whole(bytes, wire_version)
    }

    fn read(payload: &Payload) -> Result<Self, DecodeError> {
        match payload.form() {
            Form::Binary(_) => {
                let wire_version = payload.wire_version();
                Self::read_binary(&payload.bytes(), wire_version)
            }
            // A whole number of seconds is printed without a point, so that as a bottle it
            // would be an integer.
            Form::Text => from_bottle(&payload.to_bottle()?),
        }
    }
}

fn from_bottle(bottle: &Bottle) -> Result<Stamp, DecodeError> {
    let count = bottle.get(0).and_then(|count| count.as_i32());
    let time = bottle.get(1).and_then(|time| time.as_f64());
    match (count, time) {
        (Some(count), Some(time)) => Ok(Stamp { count, time }),
        _ => Err(DecodeError::Shape { expected: EXPECTED }),
    }
}
