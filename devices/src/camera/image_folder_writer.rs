//! Images and sound in files of a folder.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::image::{Image, image_file};
use crate::{
    Audio, AudioVisualStream, Device, DeviceError, FrameWriterAudioVisual, FrameWriterImage,
};

/// Name of the file with the sound.
const SOUND_FILE: &str = "sound.wav";
/// Bytes in front of the samples of a WAV file.
const WAV_HEADER: u32 = 44;
/// Maximum number of channels: a WAV file tells the bytes of one moment in 16 bits.
const MAX_CHANNELS: usize = u16::MAX as usize / 2;
/// Default of the maximum number of images: five minutes of 30 a second.
const DEFAULT_MAX_IMAGES: u64 = 9_000;
/// Default of the maximum size of the sound, bytes.
const DEFAULT_MAX_SOUND_BYTES: u32 = 1 << 30;
/// Default of the maximum size of all files, bytes.
const DEFAULT_MAX_BYTES: u64 = 4 << 30;

/// Options of an [`ImageFolderWriter`].
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct ImageFolderOptions {
    max_images: u64,
    max_sound_bytes: u32,
    max_bytes: u64,
}

impl Default for ImageFolderOptions {
    fn default() -> Self {
        Self {
            max_images: DEFAULT_MAX_IMAGES,
            max_sound_bytes: DEFAULT_MAX_SOUND_BYTES,
            max_bytes: DEFAULT_MAX_BYTES,
        }
    }
}

impl ImageFolderOptions {
    /// Returns the defaults: at most 9000 images, 1 GiB of sound, and 4 GiB of both.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the maximum number of images; further ones are refused.
    pub fn max_images(mut self, images: u64) -> Self {
        self.max_images = images;
        self
    }

    /// Sets the maximum size of the samples of the sound, bytes; further sound is refused. A WAV file holds 4 GiB at most.
    pub fn max_sound_bytes(mut self, bytes: u32) -> Self {
        self.max_sound_bytes = bytes.min(u32::MAX - WAV_HEADER);
        self
    }

    /// Sets the maximum size of all files that the writer makes, bytes; further images and sound are refused.
    pub fn max_bytes(mut self, bytes: u64) -> Self {
        self.max_bytes = bytes;
        self
    }
}

/// A device that writes images to a folder as `image_000001.ppm` and on, and sound as `sound.wav`.
///
/// * It makes the folder if it is not there. It replaces no file: a folder that has images, parts of images (`image_000001.part`) or sound of such names is refused.
/// * An image has its name once it is whole. The sound file can be read at any time: its header is written with each chunk.
/// * Calls write on the thread of the caller, so they take as long as the disk does.
///
/// ```
/// use yarp_devices::FrameWriterImage;
/// use yarp_devices::camera::{ImageFolderOptions, ImageFolderWriter};
/// use yarp_devices::image::{Image, PixelFormat, image_file};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let folder = folder.path();
/// let writer = ImageFolderWriter::open(folder, ImageFolderOptions::new())?;
/// let image = Image::new(PixelFormat::Rgb, 1, 1, vec![1, 2, 3])?;
/// writer.put_image(&image)?;
/// assert_eq!(image_file::read(&folder.join("image_000001.ppm"))?, image);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct ImageFolderWriter {
    folder: PathBuf,
    options: ImageFolderOptions,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    images: u64,
    /// Bytes of all files.
    bytes: u64,
    sound: Option<SoundFile>,
}

#[derive(Debug)]
struct SoundFile {
    file: File,
    channels: usize,
    rate: u32,
    /// Bytes of samples.
    bytes: u32,
}

impl ImageFolderWriter {
    /// Opens a folder.
    ///
    /// * Errors: [`DeviceError::File`] when it cannot be made or has images or sound of such names.
    pub fn open(folder: &Path, options: ImageFolderOptions) -> Result<Self, DeviceError> {
        fs::create_dir_all(folder).map_err(failed("create the folder", folder))?;
        let listed = || failed("list the folder", folder);
        for entry in fs::read_dir(folder).map_err(listed())? {
            let name = entry.map_err(listed())?.file_name();
            if is_output(&name.to_string_lossy()) {
                return Err(failed("write into a folder with", &folder.join(name))(
                    io::ErrorKind::AlreadyExists.into(),
                ));
            }
        }
        Ok(Self {
            folder: folder.to_owned(),
            options,
            state: Mutex::default(),
        })
    }

    /// Returns the number of images written.
    pub fn images(&self) -> u64 {
        self.state().images
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Refuses an image beyond the maximum number, or beyond the maximum size together with `others`, bytes that follow.
    fn check_image_fits(
        &self,
        state: &State,
        image: &[u8],
        others: u64,
    ) -> Result<(), DeviceError> {
        let refused = |asked: String, expected: String| DeviceError::Unsuitable {
            what: "image",
            asked,
            expected,
        };
        let most = self.options.max_images;
        if state.images >= most {
            let expected = format!("at most {most} images");
            return Err(refused((state.images + 1).to_string(), expected));
        }
        let (most, wanted) = (self.options.max_bytes, image.len() as u64 + others);
        let left = most.saturating_sub(state.bytes);
        if wanted > left {
            let expected = format!("at most {left} bytes, all in all {most}");
            return Err(refused(
                format!("of {wanted} bytes with its sound"),
                expected,
            ));
        }
        Ok(())
    }

    fn write_image(&self, state: &mut State, image: &[u8]) -> Result<(), DeviceError> {
        let path = self.folder.join(image_name(state.images + 1));
        let partial = path.with_extension("part");
        let mut file = create_new(&partial).map_err(failed("make the new file", &partial))?;
        // A link, unlike a renamed file, replaces nothing.
        let written = file.write_all(image);
        let written = written.and_then(|()| fs::hard_link(&partial, &path));
        // This call made it.
        let removed = fs::remove_file(&partial);
        written.map_err(failed("write the new image", &path))?;
        state.images += 1;
        state.bytes += image.len() as u64;
        removed.map_err(failed("remove the part", &partial))
    }

    /// Refuses sound that does not fit that before it, or the file. Empty sound fits always.
    fn check_sound_fits(&self, state: &State, sound: &Audio) -> Result<(), DeviceError> {
        if sound.is_empty() {
            return Ok(());
        }
        let refused = |asked: String, expected: String| DeviceError::Unsuitable {
            what: "sound",
            asked,
            expected,
        };
        let said = |channels, rate| format!("{channels} channels, {rate} samples a second");
        if sound.channels > MAX_CHANNELS {
            let expected = format!("at most {MAX_CHANNELS} channels");
            return Err(refused(said(sound.channels, sound.rate), expected));
        }
        let before = match &state.sound {
            Some(file) if (file.channels, file.rate) != (sound.channels, sound.rate) => {
                let expected = format!("{} as before", said(file.channels, file.rate));
                return Err(refused(said(sound.channels, sound.rate), expected));
            }
            Some(file) => file.bytes,
            None => 0,
        };
        let (left, wanted) = (
            self.options.max_sound_bytes - before,
            2 * sound.samples.len(),
        );
        if wanted > left as usize {
            let expected = format!(
                "at most {left}, all in all {}",
                self.options.max_sound_bytes
            );
            return Err(refused(format!("of {wanted} bytes"), expected));
        }
        Ok(())
    }

    fn write_sound(&self, state: &mut State, sound: &Audio) -> Result<(), DeviceError> {
        if sound.is_empty() {
            return Ok(());
        }
        let path = self.folder.join(SOUND_FILE);
        let step = "write the sound";
        let added = state.sound_growth(sound);
        let file = match &mut state.sound {
            Some(file) => file,
            none => none.insert(SoundFile {
                file: create_new(&path).map_err(failed(step, &path))?,
                channels: sound.channels,
                rate: sound.rate,
                bytes: 0,
            }),
        };
        file.append(sound).map_err(failed(step, &path))?;
        state.bytes += added;
        Ok(())
    }
}

impl State {
    /// Returns by how many bytes the file of the sound grows.
    fn sound_growth(&self, sound: &Audio) -> u64 {
        let samples = 2 * sound.samples.len() as u64;
        match self.sound {
            _ if sound.is_empty() => 0,
            None => samples + u64::from(WAV_HEADER),
            Some(_) => samples,
        }
    }
}

impl SoundFile {
    /// Writes the samples, then the header with the new size.
    fn append(&mut self, sound: &Audio) -> io::Result<()> {
        let samples: Vec<u8> = sound
            .samples
            .iter()
            .flat_map(|at| at.to_le_bytes())
            .collect();
        let end = u64::from(WAV_HEADER + self.bytes);
        self.file.seek(SeekFrom::Start(end))?;
        self.file.write_all(&samples)?;
        // Checked before: the file has room for them.
        self.bytes += samples.len() as u32;
        self.file.rewind()?;
        self.file.write_all(&self.header())
    }

    /// Returns the header: format 1 is 16-bit samples, the channels of one moment side by side.
    fn header(&self) -> Vec<u8> {
        let frame = 2 * self.channels as u16;
        let mut header = Vec::with_capacity(WAV_HEADER as usize);
        header.extend(b"RIFF");
        header.extend((WAV_HEADER - 8 + self.bytes).to_le_bytes());
        header.extend(b"WAVEfmt ");
        header.extend(16_u32.to_le_bytes());
        header.extend(1_u16.to_le_bytes());
        header.extend((self.channels as u16).to_le_bytes());
        header.extend(self.rate.to_le_bytes());
        header.extend(self.rate.saturating_mul(u32::from(frame)).to_le_bytes());
        header.extend(frame.to_le_bytes());
        header.extend(16_u16.to_le_bytes());
        header.extend(b"data");
        header.extend(self.bytes.to_le_bytes());
        header
    }
}

impl FrameWriterImage for ImageFolderWriter {
    fn put_image(&self, image: &Image) -> Result<(), DeviceError> {
        let bytes = ppm(image)?;
        let mut state = self.state();
        self.check_image_fits(&state, &bytes, 0)?;
        self.write_image(&mut state, &bytes)
    }
}

impl FrameWriterAudioVisual for ImageFolderWriter {
    /// Writes both or, if one does not fit, neither.
    fn put_audio_visual(&self, image: &Image, sound: &Audio) -> Result<(), DeviceError> {
        let bytes = ppm(image)?;
        let mut state = self.state();
        self.check_image_fits(&state, &bytes, state.sound_growth(sound))?;
        self.check_sound_fits(&state, sound)?;
        self.write_image(&mut state, &bytes)?;
        self.write_sound(&mut state, sound)
    }
}

impl AudioVisualStream for ImageFolderWriter {
    fn has_audio(&self) -> bool {
        true
    }

    fn has_video(&self) -> bool {
        true
    }

    /// Images in one channel are written in three.
    fn has_raw_video(&self) -> bool {
        false
    }
}

impl Device for ImageFolderWriter {
    crate::offers! {
        frame_writer_image: FrameWriterImage,
        frame_writer_audio_visual: FrameWriterAudioVisual,
        audio_visual_stream: AudioVisualStream,
    }
}

fn image_name(number: u64) -> String {
    format!("image_{number:06}.ppm")
}

/// Returns whether a file of this name would be mixed up with those of a writer.
fn is_output(name: &str) -> bool {
    let is_image =
        name.starts_with("image_") && (name.ends_with(".ppm") || name.ends_with(".part"));
    is_image || name == SOUND_FILE
}

/// Returns the content of the file of an image.
fn ppm(image: &Image) -> Result<Vec<u8>, DeviceError> {
    Ok(image_file::ppm(&image.to_rgb()?))
}

fn create_new(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).open(path)
}

fn failed(step: &'static str, path: &Path) -> impl FnOnce(io::Error) -> DeviceError {
    let path = path.display().to_string();
    move |error| DeviceError::File {
        step,
        path,
        source: error.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::PixelFormat;

    fn image(grey: u8) -> Image {
        Image::new(PixelFormat::Mono, 2, 1, vec![grey, grey + 1]).unwrap()
    }

    fn sound(channels: usize, samples: &[i16]) -> Audio {
        Audio {
            channels,
            rate: 8_000,
            samples: samples.to_vec(),
        }
    }

    #[test]
    fn images_are_numbered_and_whole() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("a/b");
        let writer = ImageFolderWriter::open(&inner, ImageFolderOptions::new()).unwrap();
        for grey in [10, 20] {
            writer.put_image(&image(grey)).unwrap();
        }
        assert_eq!(writer.images(), 2);
        let second = image_file::read(&inner.join("image_000002.ppm")).unwrap();
        assert_eq!(second, image(20).to_rgb().unwrap());
        let mut names: Vec<_> = fs::read_dir(&inner)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        names.sort();
        assert_eq!(names, ["image_000001.ppm", "image_000002.ppm"]);
    }

    #[test]
    fn sound_is_a_wav_file_after_every_chunk() {
        let folder = tempfile::tempdir().unwrap();
        let writer = ImageFolderWriter::open(folder.path(), ImageFolderOptions::new()).unwrap();
        let file = folder.path().join("sound.wav");
        writer.put_audio_visual(&image(1), &sound(1, &[])).unwrap();
        assert!(!file.exists(), "there was no sound");
        writer
            .put_audio_visual(&image(1), &sound(2, &[1, -1]))
            .unwrap();
        let mut expected = b"RIFF\x28\0\0\0WAVEfmt \x10\0\0\0\x01\0\x02\0\x40\x1f\0\0\0\x7d\0\0\x04\0\x10\0data\x04\0\0\0".to_vec();
        expected.extend([1, 0, 0xff, 0xff]);
        assert_eq!(fs::read(&file).unwrap(), expected);
        writer
            .put_audio_visual(&image(1), &sound(2, &[256, 2]))
            .unwrap();
        expected[4] = 44;
        expected[40] = 8;
        expected.extend([0, 1, 2, 0]);
        assert_eq!(fs::read(&file).unwrap(), expected);
        assert_eq!(writer.images(), 3);
    }

    #[test]
    fn other_sound_than_before_is_refused_with_its_image() {
        let folder = tempfile::tempdir().unwrap();
        let writer = ImageFolderWriter::open(folder.path(), ImageFolderOptions::new()).unwrap();
        writer.put_audio_visual(&image(1), &sound(1, &[1])).unwrap();
        assert!(
            writer
                .put_audio_visual(&image(1), &sound(2, &[1, 2]))
                .is_err()
        );
        let faster = Audio {
            rate: 16_000,
            ..sound(1, &[1])
        };
        assert!(writer.put_audio_visual(&image(1), &faster).is_err());
        assert_eq!(writer.images(), 1);
        let many = sound(MAX_CHANNELS + 1, &vec![0; MAX_CHANNELS + 1]);
        let other = tempfile::tempdir().unwrap();
        let other = ImageFolderWriter::open(other.path(), ImageFolderOptions::new()).unwrap();
        assert!(other.put_audio_visual(&image(1), &many).is_err());
    }

    #[test]
    fn images_and_sound_are_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let options = ImageFolderOptions::new().max_images(2).max_sound_bytes(5);
        let writer = ImageFolderWriter::open(folder.path(), options).unwrap();
        assert!(
            writer
                .put_audio_visual(&image(1), &sound(1, &[1, 2, 3]))
                .is_err()
        );
        assert_eq!(writer.images(), 0);
        writer
            .put_audio_visual(&image(1), &sound(1, &[1, 2]))
            .unwrap();
        assert!(writer.put_audio_visual(&image(1), &sound(1, &[3])).is_err());
        writer.put_image(&image(1)).unwrap();
        let error = writer.put_image(&image(1)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "image 3 is refused, expected at most 2 images"
        );
        assert!(!folder.path().join("image_000003.ppm").exists());
    }

    #[test]
    fn no_file_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let open = || ImageFolderWriter::open(folder.path(), ImageFolderOptions::new());
        let writer = open().unwrap();
        let other = open().unwrap();
        other.put_image(&image(7)).unwrap();
        assert!(writer.put_image(&image(9)).is_err());
        assert!(open().is_err(), "there are images");
        let kept = image_file::read(&folder.path().join("image_000001.ppm")).unwrap();
        assert_eq!(kept.pixels()[0], 7);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        let file = folder.path().join("image_000001.ppm");
        assert!(ImageFolderWriter::open(&file, ImageFolderOptions::new()).is_err());
    }

    #[test]
    fn the_size_of_all_files_is_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let image_bytes = ppm(&image(1)).unwrap().len() as u64;
        // Two images, and the sound of two samples.
        let most = 2 * image_bytes + u64::from(WAV_HEADER) + 4;
        let options = ImageFolderOptions::new().max_bytes(most);
        let writer = ImageFolderWriter::open(folder.path(), options).unwrap();
        writer.put_audio_visual(&image(1), &sound(1, &[1])).unwrap();
        let error = writer.put_audio_visual(&image(2), &sound(1, &[2, 3]));
        assert_eq!(
            error.unwrap_err().to_string(),
            format!(
                "image of {} bytes with its sound is refused, expected at most {} bytes, all in all {most}",
                image_bytes + 4,
                image_bytes + 2
            )
        );
        assert_eq!(writer.images(), 1, "neither is written");
        writer.put_audio_visual(&image(2), &sound(1, &[2])).unwrap();
        assert!(writer.put_image(&image(3)).is_err());
        let files = fs::read_dir(folder.path()).unwrap();
        let written: u64 = files
            .map(|file| file.unwrap().metadata().unwrap().len())
            .sum();
        assert_eq!(written, most);
    }

    #[test]
    fn a_partial_file_of_another_writer_stays() {
        let folder = tempfile::tempdir().unwrap();
        let writer = ImageFolderWriter::open(folder.path(), ImageFolderOptions::new()).unwrap();
        let partial = folder.path().join("image_000001.part");
        fs::write(&partial, "theirs").unwrap();
        let error = writer.put_image(&image(1)).unwrap_err().to_string();
        assert!(error.contains("image_000001.part"), "{error}");
        assert_eq!(fs::read(&partial).unwrap(), b"theirs");
        assert_eq!(writer.images(), 0);
    }

    #[test]
    fn a_folder_with_any_output_is_refused() {
        for name in ["image_000007.ppm", "image_000003.part", "sound.wav"] {
            let folder = tempfile::tempdir().unwrap();
            fs::write(folder.path().join(name), "theirs").unwrap();
            let opened = ImageFolderWriter::open(folder.path(), ImageFolderOptions::new());
            let error = opened.unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("notes.txt"), "").unwrap();
        ImageFolderWriter::open(folder.path(), ImageFolderOptions::new()).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_dangling_link_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let writer = ImageFolderWriter::open(folder.path(), ImageFolderOptions::new()).unwrap();
        let path = folder.path().join("image_000001.ppm");
        std::os::unix::fs::symlink(folder.path().join("nothing"), &path).unwrap();
        let error = writer.put_image(&image(1)).unwrap_err().to_string();
        assert!(error.contains("image_000001.ppm"), "{error}");
        assert!(fs::symlink_metadata(&path).unwrap().is_symlink());
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            1,
            "no part is left"
        );
    }
}
