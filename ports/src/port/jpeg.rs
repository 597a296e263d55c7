//! Encoding of images as JPEG, and decoding.

use bytes::{Bytes, BytesMut};
use libjpeg_turbo_rs::{PixelFormat, Subsampling};
use yarp_wire::message::{Payload, ReadObject};
use yarp_wire::mjpeg;
use yarp_wire::typed::{Image, ImageError, PixelCode};
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::port_limits::EXPANSION_BUDGET;

/// Quality of encoded images, of 100; the default of most JPEG encoders.
const QUALITY: u8 = 75;
/// Maximum number of pixels of a decoded image.
const MAX_PIXELS: usize = 1 << 26;
/// Maximum number of pixels that a byte can represent: a block of 8 x 8 takes at least one bit.
const MAX_PIXELS_PER_BYTE: usize = 512;

/// The reason why a JPEG image is not decoded.
#[derive(Debug, thiserror::Error)]
pub(crate) enum JpegError {
    /// It claims more pixels than it can hold, or than we take.
    #[error("{bytes} bytes of JPEG claim {width} x {height} pixels")]
    TooLarge {
        bytes: usize,
        width: usize,
        height: usize,
    },
    /// The budget of the process has fewer bytes left than this.
    #[error("the process has no room for an image of {0} bytes now")]
    NoRoom(usize),
    #[error("not a JPEG image: {0:?}")]
    Jpeg(DecodeErrors),
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A defect of the library.
    #[error("the JPEG decoder panicked")]
    Panicked,
}

/// Returns the part of an MJPEG stream for the image in this payload; `None` if it is not an image,
/// or has pixels that JPEG cannot represent.
pub(super) fn part(payload: &Payload, envelope: Option<&Bytes>) -> Option<Bytes> {
    let image = Image::read(payload).ok()?;
    let mut jpeg = compress(&image)?;
    if let Some(envelope) = envelope {
        jpeg = mjpeg::with_comment(&jpeg, envelope);
    }
    let mut part = BytesMut::new();
    mjpeg::put_part(&mut part, &jpeg);
    Some(part.freeze())
}

/// Encodes the image as JPEG; `None` if JPEG cannot represent its pixels.
pub(super) fn compress(image: &Image) -> Option<Bytes> {
    let format = match image.code() {
        PixelCode::MONO => PixelFormat::Grayscale,
        PixelCode::RGB => PixelFormat::Rgb,
        PixelCode::BGR => PixelFormat::Bgr,
        PixelCode::RGBA => PixelFormat::Rgba,
        PixelCode::BGRA => PixelFormat::Bgra,
        _ => return None,
    };
    let (width, height) = (image.width(), image.height());
    // One colour for four pixels, as most writers of JPEG.
    let colours = Subsampling::S420;
    let pixels = image.packed();
    let jpeg = libjpeg_turbo_rs::compress(&pixels, width, height, format, QUALITY, colours);
    Some(jpeg.ok()?.into())
}

/// Decodes a JPEG image to `rgb` pixels, in the buffer of an earlier one if available. Its claimed
/// size is checked before memory is allocated.
pub(super) fn decode(jpeg: &[u8], buffer: BytesMut) -> Result<Image, JpegError> {
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(jpeg), options);
    decoder.decode_headers().map_err(JpegError::Jpeg)?;
    let (width, height) = decoder.dimensions().unwrap_or_default();
    let most = jpeg
        .len()
        .saturating_mul(MAX_PIXELS_PER_BYTE)
        .min(MAX_PIXELS);
    if width.checked_mul(height).is_none_or(|pixels| pixels > most) {
        let bytes = jpeg.len();
        return Err(JpegError::TooLarge {
            bytes,
            width,
            height,
        });
    }
    let size = decoder.output_buffer_size().unwrap_or_default();
    let Some(_reservation) = EXPANSION_BUDGET.reserve(size) else {
        return Err(JpegError::NoRoom(size));
    };
    let mut pixels = buffer;
    pixels.resize(size, 0);
    decoder.decode_into(&mut pixels).map_err(JpegError::Jpeg)?;
    let pixels = pixels.freeze();
    Ok(Image::from_packed(PixelCode::RGB, width, height, pixels)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(code: PixelCode, bytes: usize) -> Image {
        let pixels: Vec<u8> = (0..48 * 32 * bytes).map(|i| (i / 64) as u8).collect();
        Image::from_packed(code, 48, 32, pixels).unwrap()
    }

    #[test]
    fn images_look_the_same_afterwards() {
        for (code, bytes) in [
            (PixelCode::MONO, 1),
            (PixelCode::RGB, 3),
            (PixelCode::BGRA, 4),
        ] {
            let image = image(code, bytes);
            let jpeg = compress(&image).unwrap();
            let back = decode(&jpeg, BytesMut::new()).unwrap();
            assert_eq!(
                (back.code(), back.width(), back.height()),
                (PixelCode::RGB, 48, 32)
            );
            let expected = image.converted(PixelCode::RGB).unwrap();
            let far = |(a, b): (&u8, &u8)| a.abs_diff(*b) > 40;
            let wrong = back
                .packed()
                .iter()
                .zip(&expected.packed())
                .filter(|p| far(*p))
                .count();
            assert!(wrong < 48 * 32 / 20, "{wrong} of {code}");
        }
        assert!(compress(&image(PixelCode::MONO_FLOAT, 4)).is_none());
        assert!(compress(&Image::new(PixelCode::RGB, 0, 0).unwrap()).is_none());
    }

    /// The size is at a fixed distance after the marker of the frame.
    #[test]
    fn a_bomb_is_refused_before_it_takes_memory() {
        let mut jpeg = compress(&image(PixelCode::RGB, 3)).unwrap().to_vec();
        let at = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
        jpeg[at + 5..at + 9].copy_from_slice(&[0x3f, 0xff, 0x3f, 0xff]);
        let result = decode(&jpeg, BytesMut::new());
        assert!(
            matches!(result, Err(JpegError::TooLarge { .. })),
            "{result:?}"
        );
    }

    #[test]
    fn damaged_jpeg_images_are_refused() {
        let jpeg = compress(&image(PixelCode::RGB, 3)).unwrap();
        for cut in 0..jpeg.len() {
            let _ = decode(&jpeg[..cut], BytesMut::new());
        }
        for at in 0..jpeg.len() {
            for value in [0, 0xff, jpeg[at] ^ 1, jpeg[at] ^ 0x80] {
                let mut damaged = jpeg.to_vec();
                damaged[at] = value;
                let _ = decode(&damaged, BytesMut::new());
            }
        }
    }
}
