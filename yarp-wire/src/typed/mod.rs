//! The messages with a type of their own: vectors, matrices, images, sounds and the rest.
//!
//! Each type is a [`WireObject`](crate::message::WireObject) and a
//! [`ReadObject`](crate::message::ReadObject) for both wire versions, and most are laid out as a
//! bottle, so that every tool can print them. [`ReadPrefix`] reads an object inside another
//! message. Declare your own messages with [`wire_struct!`](crate::wire_struct).
//!
//! | type | bottle | stock |
//! | --- | --- | --- |
//! | [`VectorOf`] | `1.0 2.0` | `yarp::sig::VectorOf` |
//! | [`Matrix`] | `rows columns (values)` | `yarp::sig::Matrix` |
//! | [`Image`] | `[mat] [rgb] (depth size quantum width height) {pixels}` | `yarp::sig::FlexImage` |
//! | [`Sound`] | `samples channels 2 frequency (samples) (markers)` | `yarp::sig::Sound` |
//! | [`Stamp`](crate::Stamp) | `count time` | `yarp::os::Stamp` |
//! | [`Property`] | `(key value...) (key value...)` | `yarp::os::Property` |
//! | [`Pair`] | `(head) (body)` | `yarp::os::PortablePair` |

mod element;
mod image_header;
mod matrix;
mod pair;
mod pixel;
mod pixel_conversion;
mod prefix_reader;
mod property_message;
mod sound;
mod sound_layout;
mod stamp_message;
mod typed_image;
mod typed_record;
mod vector_of;

pub use element::Element;
pub use image_header::HEADER as IMAGE_HEADER;
pub use matrix::{Matrix, MatrixError};
pub use pair::Pair;
pub use pixel::PixelCode;
pub use prefix_reader::{ReadPrefix, read_whole};
pub use property_message::Property;
pub use sound::{Sound, SoundError, SoundMarker};
pub use sound_layout::{SoundLayout, SoundMessage};
pub use typed_image::{Image, ImageError};
pub use typed_record::{Field, Record};
pub use vector_of::VectorOf;

/// Items that the expansion of [`wire_struct!`](crate::wire_struct) uses.
#[doc(hidden)]
pub mod private {
    pub use bytes::{Bytes, BytesMut};
}
