//! Images in files: PPM and PGM (the binary forms P6 and P5), PNG, JPEG. PPM and PGM are written, too.
//!
//! The size in a file's header is compared with the file's content, or bounded, before memory is allocated. Source:
//! netpbm's `ppm(5)` and `pgm(5)`. PNG and JPEG need the feature `image-files`.

use std::error::Error;
use std::path::Path;

#[cfg(feature = "image-files")]
use super::compressed_image;
use super::file_checks::{Reading, check_size, malformed};
use super::{Image, PixelFormat};
use crate::DeviceError;

/// Reads an image from a file; its first bytes determine the format, not its name.
///
/// Errors: [`DeviceError::File`].
pub fn read(path: &Path) -> Result<Image, DeviceError> {
    let failed = |source| DeviceError::File {
        step: "read a picture from",
        path: path.display().to_string(),
        source,
    };
    let bytes = std::fs::read(path).map_err(|error| failed(error.into()))?;
    decode(&bytes).map_err(failed)
}

/// Decodes an image: PPM, PGM, PNG or JPEG.
pub fn decode(bytes: &[u8]) -> Result<Image, Box<dyn Error + Send + Sync>> {
    match bytes {
        [b'P', b'5' | b'6', ..] => netpbm(bytes),
        #[cfg(feature = "image-files")]
        [0x89, b'P', b'N', b'G', ..] => compressed_image::png(bytes),
        #[cfg(feature = "image-files")]
        [0xff, 0xd8, ..] => compressed_image::jpeg(bytes),
        #[cfg(not(feature = "image-files"))]
        [0x89, b'P', b'N', b'G', ..] | [0xff, 0xd8, ..] => Err(malformed(
            "this program was built without the feature image-files: it reads PPM and PGM only",
        )),
        _ => Err(malformed("neither PPM, PGM, PNG nor JPEG")),
    }
}

/// Encodes an image as PPM, or a grey one as PGM. `image` is in red, green and blue, or grey.
pub(crate) fn ppm(image: &Image) -> Vec<u8> {
    let kind = match image.format() {
        PixelFormat::Mono => "P5",
        _ => "P6",
    };
    let mut bytes = format!("{kind}\n{} {}\n255\n", image.width(), image.height()).into_bytes();
    bytes.extend_from_slice(image.pixels());
    bytes
}

fn netpbm(bytes: &[u8]) -> Reading {
    let format = match bytes[1] {
        b'5' => PixelFormat::Mono,
        _ => PixelFormat::Rgb,
    };
    let mut rest = &bytes[2..];
    let mut number = || -> Result<usize, Box<dyn Error + Send + Sync>> {
        loop {
            match rest {
                [b'#', ..] => {
                    let end = rest.iter().position(|byte| *byte == b'\n');
                    rest = &rest[end.unwrap_or(rest.len())..];
                }
                [byte, ..] if byte.is_ascii_whitespace() => rest = &rest[1..],
                _ => break,
            }
        }
        let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let text = std::str::from_utf8(&rest[..digits])?;
        rest = &rest[digits..];
        text.parse()
            .map_err(|_| malformed("expected width, height and the largest value"))
    };
    let (width, height, largest) = (number()?, number()?, number()?);
    check_size(width, height)?;
    if largest != 255 {
        return Err(malformed(format!("largest value {largest}, expected 255")));
    }
    let pixels = match rest {
        [byte, pixels @ ..] if byte.is_ascii_whitespace() => pixels,
        _ => return Err(malformed("expected pixels behind the head")),
    };
    let expected = width * height * format.bytes().unwrap_or(0);
    let pixels = pixels.get(..expected).ok_or_else(|| {
        malformed(format!(
            "{} bytes of pixels, expected {expected}",
            pixels.len()
        ))
    })?;
    Ok(Image::new(format, width, height, pixels.to_vec())?)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn encoded(color: png::ColorType, pixels: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(color);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(pixels).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn netpbm_is_read_with_comments() {
        let image =
            decode(b"P6 # a comment\n2 1\n# another\n255\n\x01\x02\x03\x04\x05\x06").unwrap();
        assert_eq!((image.width(), image.height()), (2, 1));
        assert_eq!(image.pixel(1, 0), Some(&[4, 5, 6][..]));
        let image = decode(b"P5 2 2 255 abcd").unwrap();
        assert_eq!(image.format(), PixelFormat::Mono);
        assert_eq!(&image.pixels()[..], b"abcd");
    }

    #[test]
    fn images_that_are_written_are_read_back() {
        for (format, bytes) in [(PixelFormat::Mono, 6), (PixelFormat::Rgb, 18)] {
            let pixels: Vec<u8> = (30..30 + bytes).collect();
            let image = Image::new(format, 3, 2, pixels).unwrap();
            assert_eq!(decode(&ppm(&image)).unwrap(), image);
        }
    }

    #[test]
    fn png_is_read_with_and_without_opacity() {
        let colours = decode(&encoded(png::ColorType::Rgb, &[1, 2, 3, 4, 5, 6])).unwrap();
        assert_eq!(colours.pixels()[..], [1, 2, 3, 4, 5, 6]);
        let opaque = encoded(png::ColorType::Rgba, &[1, 2, 3, 255, 4, 5, 6, 0]);
        assert_eq!(decode(&opaque).unwrap(), colours);
        let grey = decode(&encoded(png::ColorType::Grayscale, &[7, 8])).unwrap();
        assert_eq!(
            (grey.format(), &grey.pixels()[..]),
            (PixelFormat::Mono, &[7, 8][..])
        );
    }

    #[test]
    fn jpeg_is_read() {
        let mut bytes = Vec::new();
        let encoder = jpeg_encoder::Encoder::new(&mut bytes, 95);
        let pixels = [200, 100, 50].repeat(16 * 16);
        encoder
            .encode(&pixels, 16, 16, jpeg_encoder::ColorType::Rgb)
            .unwrap();
        let image = decode(&bytes).unwrap();
        assert_eq!((image.width(), image.height()), (16, 16));
        let pixel = image.pixel(8, 8).unwrap();
        assert!(
            pixel
                .iter()
                .zip([200, 100, 50])
                .all(|(a, b)| a.abs_diff(b) < 6),
            "{pixel:?}"
        );
    }

    #[test]
    fn what_a_file_claims_and_does_not_hold_is_refused() {
        for bytes in [
            &b""[..],
            b"P6",
            b"P6 2 1 255",
            b"P6 2 1 255\n\x01",
            b"P6 0 1 255\n",
            b"P6 99999999 99999999 255\nx",
            b"P6 99999999999999999999999 1 255\nx",
            b"P6 2 1 65535\n123456123456",
            b"GIF89a",
            b"\x89PNG\r\n\x1a\n",
            b"\xff\xd8\xff",
        ] {
            assert!(decode(bytes).is_err(), "{}", bytes.escape_ascii());
        }
        let error = read(Path::new("/nowhere/at all.png")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "cannot read a picture from /nowhere/at all.png"
        );
    }

    proptest! {
        #[test]
        fn any_bytes_are_judged(kind in 0..4_usize, tail in prop::collection::vec(any::<u8>(), 0..200)) {
            let head: [&[u8]; 4] = [b"P6 ", b"P5 3 3 255 ", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"];
            let bytes = [head[kind], &tail].concat();
            let _ = decode(&bytes);
        }

        #[test]
        fn a_damaged_picture_does_no_harm(at in 0..200_usize, byte in any::<u8>()) {
            let mut bytes = encoded(png::ColorType::Rgb, &[1, 2, 3, 4, 5, 6]);
            let at = at % bytes.len();
            bytes[at] = byte;
            let _ = decode(&bytes);
        }
    }
}
