//! Images of devices as messages, and back. Pixels are shared wherever rows need no padding.

use yarp_devices::DeviceError;
use yarp_devices::image::{Image, PixelFormat};
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::ReadObject;
use yarp_wire::typed::{self, ImageError, PixelCode};
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

/// The code that a format has on the wire.
pub fn code_of(format: PixelFormat) -> PixelCode {
    match format {
        PixelFormat::Mono => PixelCode::MONO,
        PixelFormat::Rgb => PixelCode::RGB,
        PixelFormat::Bgr => PixelCode::BGR,
        PixelFormat::Other(code) => PixelCode::from_code(code),
    }
}

/// Returns the format of a code on the wire.
pub fn format_of(code: PixelCode) -> PixelFormat {
    match code {
        PixelCode::MONO => PixelFormat::Mono,
        PixelCode::RGB => PixelFormat::Rgb,
        PixelCode::BGR => PixelFormat::Bgr,
        other => PixelFormat::Other(other.code()),
    }
}

/// The message of an image.
pub fn to_wire(image: &Image) -> Result<typed::Image, ImageError> {
    let pixels = image.pixels().clone();
    typed::Image::from_packed(
        code_of(image.format()),
        image.width(),
        image.height(),
        pixels,
    )
}

/// The image of a message, in red, green and blue, or in grey if it is.
///
/// Rows are taken in their order of arrival; [`typed::Image`] describes why the mark for another order is ignored.
pub fn from_wire(image: &typed::Image) -> Result<Image, FromWireError> {
    let converted = match image.code() {
        PixelCode::MONO | PixelCode::RGB => image.clone(),
        _ => image.converted(PixelCode::RGB)?,
    };
    let format = format_of(converted.code());
    Ok(Image::new(
        format,
        converted.width(),
        converted.height(),
        converted.packed(),
    )?)
}

/// Reasons why a message is not a usable image.
#[derive(Debug, thiserror::Error)]
pub enum FromWireError {
    /// Pixels of another kind.
    #[error(transparent)]
    Kind(#[from] ImageError),
    /// Pixels that do not fill it.
    #[error(transparent)]
    Size(#[from] DeviceError),
    /// It is no image at all.
    #[error(transparent)]
    Bytes(#[from] DecodeError),
}

/// An image within a message: a list of four, the same in both wire versions but for the difference described at
/// [`typed::Image`].
pub fn to_list(image: &typed::Image) -> Bottle {
    let integer = |number: usize| Value::Int32(number as i32);
    let numbers = [
        image.bytes_per_pixel(),
        image.pixels().len(),
        image.quantum(),
        image.width(),
        image.height(),
    ];
    Bottle::of(Vocab32::new("mat"))
        .with(Vocab32::from_code(image.code().code() as u32))
        .with(Value::List(numbers.into_iter().map(integer).collect()))
        .with(image.pixels().clone())
}

/// The image within a message.
pub fn from_list(list: &Bottle) -> Result<Image, FromWireError> {
    // Header and pixels are judged by the reader of images, which wants them as they travel.
    let bytes = list.encode(WireVersion::V3);
    from_wire(&typed::Image::read_binary(&bytes, WireVersion::V3)?)
}

#[cfg(test)]
mod tests {
    use bytes::{Bytes, BytesMut};
    use yarp_wire::message::WireObject;

    use super::*;

    fn image(width: usize, format: PixelFormat) -> Image {
        let bytes = format.bytes().unwrap();
        let pixels: Vec<u8> = (0..width * 2 * bytes).map(|at| at as u8).collect();
        Image::new(format, width, 2, pixels).unwrap()
    }

    #[test]
    fn images_come_back_as_they_went() {
        for width in [1, 3, 8, 32] {
            for format in [PixelFormat::Mono, PixelFormat::Rgb] {
                let original = image(width, format);
                let wire = to_wire(&original).unwrap();
                assert_eq!(from_wire(&wire).unwrap(), original);
                assert_eq!(from_list(&to_list(&wire)).unwrap(), original);
            }
        }
    }

    #[test]
    fn pixels_are_shared_where_rows_need_no_padding() {
        let original = image(32, PixelFormat::Rgb);
        let wire = to_wire(&original).unwrap();
        assert_eq!(wire.pixels().as_ptr(), original.pixels().as_ptr());
        let back = from_wire(&wire).unwrap();
        assert_eq!(back.pixels().as_ptr(), original.pixels().as_ptr());
    }

    #[test]
    fn within_a_message_the_bytes_are_those_of_the_image() {
        let wire = to_wire(&image(3, PixelFormat::Rgb)).unwrap();
        for wire_version in [WireVersion::V3, WireVersion::V4] {
            let mut alone = BytesMut::new();
            wire.write_binary(&mut alone, wire_version);
            assert_eq!(to_list(&wire).encode(wire_version), alone);
        }
    }

    #[test]
    fn what_is_no_image_is_refused() {
        for text in [
            "",
            "1 2",
            "[mat] [rgb] (3 24 8 1 1) {1 2}",
            "[mat] [rgb] (3 8 8 2000000000 2000000000) {}",
        ] {
            assert!(from_list(&Bottle::parse(text).unwrap()).is_err(), "{text}");
        }
        let depths =
            typed::Image::from_packed(PixelCode::MONO_FLOAT, 2, 1, Bytes::from_static(&[0; 8]))
                .unwrap();
        assert!(from_wire(&depths).is_err());
    }
}
