//! Checks of bytes against objects.

use std::fmt::Debug;

use bytes::{Bytes, BytesMut};
use yarp_wire::WireVersion;
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::{ReadObject, WireObject};

/// Returns the bytes of hexadecimal digits, ignoring blanks.
pub(crate) fn bytes(hex: &str) -> Bytes {
    yarp_testing::from_hex(hex).into()
}

/// Returns the encoding for readers of a wire version.
pub(crate) fn written(object: &dyn WireObject, wire_version: WireVersion) -> Bytes {
    let mut out = BytesMut::new();
    object.write_binary(&mut out, wire_version);
    out.freeze()
}

/// Returns the encoding on a text connection.
pub(crate) fn text(object: &dyn WireObject) -> String {
    let mut out = BytesMut::new();
    object.write_text(&mut out);
    String::from_utf8(out.to_vec()).unwrap()
}

/// Checks that `object` is written as these bytes and read from them.
#[track_caller]
pub(crate) fn check<T>(object: &T, wire_version: WireVersion, hex: &str)
where
    T: WireObject + ReadObject + PartialEq + Debug,
{
    let expected = bytes(hex);
    assert_eq!(written(object, wire_version), expected, "{object:?}");
    assert_eq!(T::read_binary(&expected, wire_version).as_ref(), Ok(object));
}

/// Checks that these bytes are not laid out as a `T`.
#[track_caller]
pub(crate) fn refused<T: ReadObject + Debug>(wire_version: WireVersion, hex: &str) {
    let error = T::read_binary(&bytes(hex), wire_version).unwrap_err();
    assert!(matches!(error, DecodeError::Shape { .. }), "{error}");
}
