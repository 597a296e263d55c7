//! Lists of equal numbers of any width.

use bytes::{BufMut, Bytes, BytesMut};

use super::element::{Element, collect};
use super::prefix_reader::{Front, ReadPrefix, read_whole};
use crate::bottle::DecodeError;
use crate::float_vector::Vector;
use crate::message::{ReadObject, WireObject};
use crate::wire_version::WireVersion;

/// Numbers of one kind, stock's `yarp::sig::VectorOf<T>`.
///
/// ```text
/// int32 256 + code of T   int32 n   n x T
/// ```
///
/// The same bytes are a bottle of n equal numbers. As in stock, an empty vector is written with
/// n = 0 and **refused on reading**, and so is a list of another kind of number, a mixed one
/// included: numbers are not converted. [`Vector`] is the reader that takes an empty one.
///
/// ```
/// use yarp_wire::WireVersion;
/// use yarp_wire::message::{ReadObject, WireObject};
/// use yarp_wire::typed::VectorOf;
///
/// let counts = VectorOf(vec![3, -4]);
/// let mut bytes = bytes::BytesMut::new();
/// counts.write_binary(&mut bytes, WireVersion::V3);
/// assert_eq!(VectorOf::read_binary(&bytes.freeze(), WireVersion::V3), Ok(counts));
/// ```
///
/// Source: bytes written and read by 3.5.0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VectorOf<T>(pub Vec<T>);

impl<T: Element> WireObject for VectorOf<T> {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        out.reserve(8 + T::WIDTH * self.0.len());
        out.put_i32_le(T::list_code(wire_version));
        out.put_i32_le(self.0.len() as i32);
        for element in &self.0 {
            element.put(out);
        }
    }
}

impl<T: Element> ReadPrefix for VectorOf<T> {
    fn take(bytes: &mut Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut front = Front::new(bytes, "a vector of at least one number of its kind");
        front.words(&[T::list_code(wire_version)])?;
        let count = front.count()?;
        if count == 0 {
            return Err(front.shape());
        }
        Ok(Self(collect(&front.run(count, T::WIDTH)?)))
    }
}

impl<T: Element> ReadObject for VectorOf<T> {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        read_whole(bytes, wire_version)
    }
}

impl From<Vector> for VectorOf<f64> {
    fn from(vector: Vector) -> Self {
        Self(vector.0)
    }
}

impl From<VectorOf<f64>> for Vector {
    fn from(vector: VectorOf<f64>) -> Self {
        Self(vector.0)
    }
}
