//! The version of a service.

use bytes::{Buf, BufMut, Bytes, BytesMut};
use yarp_wire::WireVersion;
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::{ReadObject, WireObject};

/// The call that queries it.
pub const GET_VERSION: &str = "getRemoteProtocolVersion";

/// The answer to [`GET_VERSION`]: the version of the protocol, and of YARP.
///
/// ```text
/// int32 256   int32 1   int16 protocol   int16 major   int16 minor   int16 patch
/// ```
///
/// Its layout is unique: no codes precede the numbers. Source: bytes written by 4.0.0.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct ServiceVersion {
    /// Must be the same on both sides.
    pub protocol: i16,
    /// Of YARP: major, minor, patch.
    pub yarp: [i16; 3],
}

const LIST: i32 = 256;
const LENGTH: usize = 16;

impl ServiceVersion {
    /// Version of the servers of YARP 4.0.0.
    pub const SERVED: Self = Self {
        protocol: 0,
        yarp: [4, 0, 0],
    };
}

impl WireObject for ServiceVersion {
    fn write_binary(&self, out: &mut BytesMut, _wire_version: WireVersion) {
        out.put_i32_le(LIST);
        out.put_i32_le(1);
        out.put_i16_le(self.protocol);
        self.yarp.iter().for_each(|number| out.put_i16_le(*number));
    }

    /// Writes numbers: the binary form is no bottle, so there is none to print.
    fn write_text(&self, out: &mut BytesMut) {
        let [major, minor, patch] = self.yarp;
        let line = format!("{} {major} {minor} {patch}\r\n", self.protocol);
        out.put_slice(line.as_bytes());
    }
}

impl ReadObject for ServiceVersion {
    fn read_binary(bytes: &Bytes, _wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut rest = bytes.clone();
        if rest.len() != LENGTH || rest.get_i32_le() != LIST || rest.get_i32_le() != 1 {
            return Err(DecodeError::Shape {
                expected: "the version of a service, sixteen bytes",
            });
        }
        Ok(Self {
            protocol: rest.get_i16_le(),
            yarp: std::array::from_fn(|_| rest.get_i16_le()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_those_recorded() {
        let recorded: &[u8] = b"\x00\x01\0\0\x01\0\0\0\0\0\x04\0\0\0\0\0";
        let mut out = BytesMut::new();
        ServiceVersion::SERVED.write_binary(&mut out, WireVersion::V4);
        assert_eq!(&out[..], recorded);
        let read = |bytes: &'static [u8]| {
            ServiceVersion::read_binary(&Bytes::from_static(bytes), WireVersion::V4)
        };
        assert_eq!(read(recorded), Ok(ServiceVersion::SERVED));
        assert!(read(&recorded[..15]).is_err());
        assert!(read(b"\x09\x01\0\0\x01\0\0\0fail").is_err());
    }
}
