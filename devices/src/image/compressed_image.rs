//! Decoding of PNG and JPEG images.

use std::io::Cursor;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::file_checks::{MAX_FILE_BYTES, Reading, check_size, malformed};
use super::{Image, PixelFormat};

pub(super) fn png(bytes: &[u8]) -> Reading {
    let limits = png::Limits {
        bytes: MAX_FILE_BYTES,
    };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    // Palettes become colours, 16 bits become 8.
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info()?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    check_size(width, height)?;
    let size = reader
        .output_buffer_size()
        .filter(|size| *size <= MAX_FILE_BYTES)
        .ok_or_else(|| malformed("too large a picture"))?;
    let mut pixels = vec![0; size];
    let info = reader.next_frame(&mut pixels)?;
    pixels.truncate(info.buffer_size());
    let (format, pixels) = match info.color_type {
        png::ColorType::Grayscale => (PixelFormat::Mono, pixels),
        png::ColorType::GrayscaleAlpha => (PixelFormat::Mono, without_opacity(&pixels, 2)),
        png::ColorType::Rgba => (PixelFormat::Rgb, without_opacity(&pixels, 4)),
        _ => (PixelFormat::Rgb, pixels),
    };
    Ok(Image::new(format, width, height, pixels)?)
}

/// Pixels without their last channel.
fn without_opacity(pixels: &[u8], channels: usize) -> Vec<u8> {
    let colours = pixels.chunks_exact(channels);
    colours
        .flat_map(|pixel| &pixel[..channels - 1])
        .copied()
        .collect()
}

pub(super) fn jpeg(bytes: &[u8]) -> Reading {
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let refused = |error| malformed(format!("no JPEG picture: {error:?}"));
    decoder.decode_headers().map_err(refused)?;
    let (width, height) = decoder.dimensions().unwrap_or_default();
    check_size(width, height)?;
    // A block of 8 x 8 pixels takes a bit at least.
    if width * height > bytes.len().saturating_mul(512) {
        return Err(malformed(format!(
            "{} bytes claim {width} x {height} pixels",
            bytes.len()
        )));
    }
    let pixels = decoder.decode().map_err(refused)?;
    Ok(Image::new(PixelFormat::Rgb, width, height, pixels)?)
}
