//! Sources of the images of a camera.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::camera_options::Scene;
use super::mjpeg_splitter;
use super::test_pattern::Painter;
use crate::DeviceError;
use crate::image::{Image, PixelFormat, image_file};

/// Maximum size of a film, in bytes: the whole file is kept in memory.
const MAX_FILM_BYTES: u64 = 1 << 30;

/// Pictures, one after the other.
#[derive(Debug)]
pub(super) enum ImageSource {
    Pattern(Painter),
    Still(Image),
    Folder {
        files: Vec<PathBuf>,
        next: usize,
    },
    Film {
        bytes: Vec<u8>,
        pictures: Vec<Range<usize>>,
        next: usize,
    },
}

impl ImageSource {
    /// Errors: [`DeviceError::File`].
    pub(super) fn open(scene: &Scene) -> Result<Self, DeviceError> {
        let path = match scene {
            Scene::Pattern(pattern) => return Ok(Self::Pattern(Painter::new(*pattern))),
            Scene::File(path) => path,
        };
        if path.is_dir() {
            return folder(path);
        }
        let ending = path.extension().and_then(|ending| ending.to_str());
        match ending.map(str::to_ascii_lowercase).as_deref() {
            Some("mjpeg" | "mjpg") => film(path),
            _ => Ok(Self::Still(image_file::read(path)?.to_rgb()?)),
        }
    }

    /// Returns whether its images have a size of their own.
    pub(super) fn has_own_size(&self) -> bool {
        !matches!(self, Self::Pattern(_))
    }

    /// Returns the next image, in red, green and blue; a test pattern has the requested size.
    ///
    /// An image of a folder or film that cannot be read is skipped; an error if none can.
    pub(super) fn next(&mut self, width: usize, height: usize) -> Result<Image, DeviceError> {
        match self {
            Self::Pattern(painter) => Image::new(
                PixelFormat::Rgb,
                width,
                height,
                painter.paint(width, height),
            ),
            Self::Still(image) => Ok(image.clone()),
            Self::Folder { files, next } => first_good(files, next, |path| image_file::read(path)),
            Self::Film {
                bytes,
                pictures,
                next,
            } => first_good(pictures, next, |place| {
                image_file::decode(&bytes[place.clone()]).map_err(|source| DeviceError::File {
                    step: "read a picture of",
                    path: format!("the film, at byte {}", place.start),
                    source,
                })
            }),
        }
    }
}

/// The first from `next` on that can be read; `next` is then behind it.
fn first_good<T>(
    all: &[T],
    next: &mut usize,
    read: impl Fn(&T) -> Result<Image, DeviceError>,
) -> Result<Image, DeviceError> {
    let mut last = Err(DeviceError::NoDataYet { what: "picture" });
    for _ in 0..all.len() {
        let place = *next % all.len();
        *next = place + 1;
        last = read(&all[place]).and_then(|image| image.to_rgb());
        match &last {
            Ok(_) => return last,
            Err(error) => tracing::debug!("skipped: {error}"),
        }
    }
    last
}

fn failed<E>(step: &'static str, path: &Path) -> impl FnOnce(E) -> DeviceError
where
    E: Into<Box<dyn std::error::Error + Send + Sync>>,
{
    let path = path.display().to_string();
    move |error| DeviceError::File {
        step,
        path,
        source: error.into(),
    }
}

fn folder(path: &Path) -> Result<ImageSource, DeviceError> {
    let step = "list the pictures of";
    let mut files = Vec::new();
    for entry in fs::read_dir(path).map_err(failed(step, path))? {
        let file = entry.map_err(failed(step, path))?.path();
        let ending = file.extension().and_then(|ending| ending.to_str());
        let ending = ending.map(str::to_ascii_lowercase);
        if matches!(
            ending.as_deref(),
            Some("ppm" | "pgm" | "png" | "jpg" | "jpeg")
        ) {
            files.push(file);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(failed(step, path)(
            "no file that ends in ppm, pgm, png, jpg or jpeg",
        ));
    }
    Ok(ImageSource::Folder { files, next: 0 })
}

fn film(path: &Path) -> Result<ImageSource, DeviceError> {
    let step = "read a film from";
    let size = fs::metadata(path).map_err(failed(step, path))?.len();
    if size > MAX_FILM_BYTES {
        return Err(failed(step, path)(format!(
            "{size} bytes are more than {MAX_FILM_BYTES}"
        )));
    }
    let bytes = fs::read(path).map_err(failed(step, path))?;
    let pictures = mjpeg_splitter::images(&bytes);
    if pictures.is_empty() {
        return Err(failed(step, path)("no JPEG picture in it"));
    }
    Ok(ImageSource::Film {
        bytes,
        pictures,
        next: 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(source: &mut ImageSource, count: usize) -> Vec<u8> {
        let mut next = || source.next(1, 1).expect("it shows").pixels()[0];
        (0..count).map(|_| next()).collect()
    }

    #[test]
    fn a_folder_is_shown_in_the_order_of_names_and_begins_again() {
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes) in [
            ("b.ppm", &b"P6 1 1 255 BBB"[..]),
            ("a.pgm", b"P5 1 1 255 A"),
            ("c.png", b"no picture"),
            ("d.txt", b"P6 1 1 255 DDD"),
        ] {
            fs::write(folder.path().join(name), bytes).unwrap();
        }
        let mut source = ImageSource::open(&Scene::File(folder.path().into())).unwrap();
        assert_eq!(shown(&mut source, 5), b"ABABA");
        fs::remove_file(folder.path().join("b.ppm")).unwrap();
        assert_eq!(shown(&mut source, 2), b"AA");
        fs::remove_file(folder.path().join("a.pgm")).unwrap();
        assert!(source.next(1, 1).is_err(), "none can be read");
    }

    #[test]
    fn a_film_begins_again_at_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.MJPEG");
        let picture = |grey: u8| {
            let mut bytes = Vec::new();
            let encoder = jpeg_encoder::Encoder::new(&mut bytes, 90);
            let pixels = vec![grey; 64];
            encoder
                .encode(&pixels, 8, 8, jpeg_encoder::ColorType::Luma)
                .unwrap();
            bytes
        };
        fs::write(&path, [picture(0), picture(255)].concat()).unwrap();
        let mut source = ImageSource::open(&Scene::File(path)).unwrap();
        let dark: Vec<bool> = shown(&mut source, 5)
            .iter()
            .map(|grey| *grey < 128)
            .collect();
        assert_eq!(dark, [true, false, true, false, true]);
    }
}
