//! Images as PNG files.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use yarp_devices::image::{Image, PixelFormat};

/// An error of writing a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The file system refused.
    #[error("{path} could not be written: {source}", path = path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Reason.
        source: std::io::Error,
    },
    /// The image could not be encoded.
    #[error("{path} could not be encoded: {source}", path = path.display())]
    Png {
        /// Path of the file.
        path: PathBuf,
        /// Reason.
        source: png::EncodingError,
    },
}

impl OutputError {
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::File {
            path: path.to_owned(),
            source,
        }
    }
}

/// Writes an image as PNG, in colour or grey as it is.
///
/// Errors: [`OutputError`].
pub fn write_image(path: &Path, image: &Image) -> Result<(), OutputError> {
    let colours = image.to_rgb();
    let (kind, pixels) = match (image.format(), &colours) {
        (PixelFormat::Mono, _) | (_, Err(_)) => (png::ColorType::Grayscale, image.pixels()),
        (_, Ok(colours)) => (png::ColorType::Rgb, colours.pixels()),
    };
    let size = [image.width(), image.height()];
    write(path, size, kind, png::BitDepth::Eight, pixels)
}

/// Writes grey values of 16 bits as PNG: depth in millimetres, for example.
///
/// Errors: [`OutputError`].
pub fn write_gray(path: &Path, width: usize, values: &[u16]) -> Result<(), OutputError> {
    let bytes: Vec<u8> = values
        .iter()
        .flat_map(|value| value.to_be_bytes())
        .collect();
    let height = values.len() / width.max(1);
    write(
        path,
        [width, height],
        png::ColorType::Grayscale,
        png::BitDepth::Sixteen,
        &bytes,
    )
}

fn write(
    path: &Path,
    [width, height]: [usize; 2],
    colour: png::ColorType,
    depth: png::BitDepth,
    bytes: &[u8],
) -> Result<(), OutputError> {
    let file = File::create(path).map_err(OutputError::file(path))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    let failed = |source| OutputError::Png {
        path: path.to_owned(),
        source,
    };
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(bytes).map_err(failed)?;
    writer.finish().map_err(failed)
}
