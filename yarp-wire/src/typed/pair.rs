//! Two objects in one message.

use bytes::{BufMut, Bytes, BytesMut};

use super::prefix_reader::{Front, ReadPrefix, read_whole};
use crate::bottle::DecodeError;
use crate::message::{ReadObject, WireObject};
use crate::wire_version::WireVersion;

/// A head and a body, stock's `yarp::os::PortablePair`.
///
/// ```text
/// 256  2   head   body
/// ```
///
/// The same bytes are the bottle `(head) (body)` if head and body are lists, as every type of
/// this crate is. Source: bytes written and read by 3.5.0.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Pair<A, B> {
    /// The first object.
    pub head: A,
    /// The second object.
    pub body: B,
}

impl<A: WireObject, B: WireObject> WireObject for Pair<A, B> {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        out.put_i32_le(256);
        out.put_i32_le(2);
        self.head.write_binary(out, wire_version);
        self.body.write_binary(out, wire_version);
    }
}

impl<A: ReadPrefix, B: ReadPrefix> ReadPrefix for Pair<A, B> {
    fn take(bytes: &mut Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut front = Front::new(bytes, "a pair: a list of two");
        front.words(&[256, 2])?;
        Ok(Self {
            head: A::take(front.rest(), wire_version)?,
            body: B::take(front.rest(), wire_version)?,
        })
    }
}

impl<A: ReadPrefix, B: ReadPrefix> ReadObject for Pair<A, B> {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        read_whole(bytes, wire_version)
    }
}
