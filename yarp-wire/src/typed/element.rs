//! Numbers that stand side by side without a code for each.

use bytes::{BufMut, Bytes, BytesMut};

use crate::float_vector::float64_list;
use crate::wire_version::WireVersion;

/// A number type of vectors and pixels.
///
/// | element | list code in 3.x | in 4.0 | stock's `VectorOf` |
/// | --- | --- | --- | --- |
/// | `f64` | 256 + 10 | 256 + 20 | all versions |
/// | `i32` | 256 + 1 | 256 + 1 | all versions |
/// | `f32` | 256 + 128 | 256 + 10 | 4.0 |
/// | `i16`, `u16` | 256 + 64 | 256 + 64 | 4.0 |
/// | `i8`, `u8` | 256 + 32 | 256 + 32 | 4.0 |
///
/// An element type for which 3.x has no `VectorOf` is still a bottle that its tools print. The code
/// does not distinguish signed from unsigned; a bottle shows such numbers as signed.
///
/// Source: bytes written by 3.5.0; the element types of 4.0 from its `sig/Vector.h`.
pub trait Element: Copy + sealed::Sealed {
    /// Bytes of one element.
    const WIDTH: usize;

    /// Returns the code of a list of such elements.
    fn list_code(wire_version: WireVersion) -> i32;

    /// Appends the element.
    fn put(self, out: &mut BytesMut);

    /// The element that these [`Element::WIDTH`] bytes are.
    ///
    /// # Panics
    ///
    /// If there are more or fewer bytes.
    fn from_bytes(bytes: &[u8]) -> Self;
}

/// Returns the elements that fill `run` exactly.
pub(super) fn collect<T: Element>(run: &Bytes) -> Vec<T> {
    run.chunks_exact(T::WIDTH).map(T::from_bytes).collect()
}

mod sealed {
    /// Prevents other implementations: an element's code has to be in the table.
    pub trait Sealed {}
}

macro_rules! elements {
    ($($element:ty, $put:ident, $code:expr;)*) => {$(
        impl sealed::Sealed for $element {}

        impl Element for $element {
            const WIDTH: usize = size_of::<$element>();

            fn list_code(wire_version: WireVersion) -> i32 {
                $code(wire_version)
            }

            fn put(self, out: &mut BytesMut) {
                out.$put(self);
            }

            fn from_bytes(bytes: &[u8]) -> Self {
                Self::from_le_bytes(bytes.try_into().expect("as many bytes as an element has"))
            }
        }
    )*};
}

elements! {
    f64, put_f64_le, float64_list;
    f32, put_f32_le, float32_list;
    i32, put_i32_le, |_| 256 + 1;
    i16, put_i16_le, |_| 256 + 64;
    u16, put_u16_le, |_| 256 + 64;
    i8, put_i8, |_| 256 + 32;
    u8, put_u8, |_| 256 + 32;
}

const fn float32_list(wire_version: WireVersion) -> i32 {
    match wire_version {
        WireVersion::V3 => 256 + 128,
        WireVersion::V4 => 256 + 10,
    }
}
