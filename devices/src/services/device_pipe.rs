//! Images and sound from one device to another.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::error::chain;
use crate::{
    Audio, AudioRender, Device, DeviceError, FrameWriterAudioVisual, FrameWriterImage, Service,
    ServiceStart, ServiceUpdate,
};

/// Maximum number of samples per channel that are passed on at once, as stock's.
const MAX_SOUND_CHUNK: usize = 4410;

/// Passes images and sound of a source on to a sink, like stock's device `pipe`.
///
/// * It passes on images with sound if both devices have them, otherwise images, otherwise sound. A device that says that it has no sound or
///   no images ([`AudioVisualStream`](crate::AudioVisualStream)) has no images with sound.
/// * Each image is passed on once. Images that newer ones superseded before an update are dropped.
/// * Sound is passed on in chunks of 4410 samples; what is left follows when the source has ended its recording. The pipe begins to record and
///   to play if the devices do not yet, and ends what it began. A chunk is dropped if the sink is full.
/// * Images with sound begin with the sound of the start of the service: what was recorded before is dropped.
/// * A source that fails is tried again; a sink that fails ends the pipe.
///
/// ```
/// use std::sync::Arc;
/// use yarp_devices::camera::{CameraOptions, ImageFolderOptions, ImageFolderWriter, SimulatedCamera};
/// use yarp_devices::services::DevicePipe;
/// use yarp_devices::{Service, ServiceUpdate};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let folder = folder.path();
/// let camera = Arc::new(SimulatedCamera::start(CameraOptions::new())?);
/// let writer = Arc::new(ImageFolderWriter::open(folder, ImageFolderOptions::new())?);
/// let pipe = DevicePipe::new(camera, writer.clone())?;
/// pipe.start_service()?;
/// assert_eq!(pipe.update_service()?, ServiceUpdate::Worked);
/// pipe.stop_service()?;
/// assert_eq!(writer.images(), 1);
/// # Ok(())
/// # }
/// ```
pub struct DevicePipe {
    source: Arc<dyn Device>,
    sink: Arc<dyn Device>,
    content: PipedContent,
    state: Mutex<State>,
}

/// Content that a pipe passes on.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum PipedContent {
    /// Images with sound.
    AudioVisual,
    /// Images.
    Images,
    /// Sound.
    Sound,
}

#[derive(Debug, Default)]
struct State {
    /// Number of the image that was passed on last.
    passed: Option<u64>,
    /// True if the source failed at the last update: the first failure of a run is logged as a warning.
    failing: bool,
    /// True if the sink was full at the last update, in the same way.
    full: bool,
    /// True if the sound from before the start was dropped.
    is_sound_fresh: bool,
    began_recording: bool,
    began_playing: bool,
}

impl std::fmt::Debug for DevicePipe {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DevicePipe")
            .field("content", &self.content)
            .finish_non_exhaustive()
    }
}

impl DevicePipe {
    /// Connects two devices.
    ///
    /// * Errors: [`DeviceError::NotSupported`] if nothing that the source gives is taken by the sink.
    pub fn new(source: Arc<dyn Device>, sink: Arc<dyn Device>) -> Result<Self, DeviceError> {
        let content = content(source.as_ref(), sink.as_ref());
        Ok(Self {
            content: content.ok_or_else(|| DeviceError::NotSupported {
                what: "a pipe between devices that have neither images nor sound in common"
                    .to_owned(),
            })?,
            source,
            sink,
            state: Mutex::default(),
        })
    }

    /// Returns the content that it passes on.
    pub fn content(&self) -> PipedContent {
        self.content
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns what the source has since the last update; none if there is nothing.
    fn take(&self, state: &mut State) -> Result<Option<Chunk<'_>>, DeviceError> {
        let (source, sink) = (self.source.as_ref(), self.sink.as_ref());
        match self.content {
            PipedContent::AudioVisual => {
                let both = need(source.audio_visual_grabber())?;
                if state.passed == Some(both.image()?.number) {
                    return Ok(None);
                }
                self.drop_old_sound(state)?;
                let (frame, sound) = both.audio_visual()?;
                state.passed = Some(frame.number);
                let sink = need(sink.frame_writer_audio_visual())?;
                Ok(Some(Chunk::Both(sink, frame.image, sound)))
            }
            PipedContent::Images => {
                let frame = need(source.frame_grabber_image())?.image()?;
                if state.passed == Some(frame.number) {
                    return Ok(None);
                }
                state.passed = Some(frame.number);
                let sink = need(sink.frame_writer_image())?;
                Ok(Some(Chunk::Image(sink, frame.image)))
            }
            PipedContent::Sound => {
                let source = need(source.audio_grabber())?;
                let whole = MAX_SOUND_CHUNK.min(source.recording_capacity()?.samples);
                if source.recorded()?.samples < whole.max(1) && source.is_recording()? {
                    return Ok(None);
                }
                let sound = source.sound(0, MAX_SOUND_CHUNK, Duration::ZERO)?;
                if sound.is_empty() {
                    return Ok(None);
                }
                let sink = need(sink.audio_render())?;
                Ok(Some(Chunk::Sound(sink, sound)))
            }
        }
    }

    /// Plays sound unless the sink is full.
    fn play(state: &mut State, sink: &dyn AudioRender, sound: &Audio) -> Result<(), DeviceError> {
        let (capacity, unplayed) = (sink.playback_capacity()?, sink.unplayed()?);
        let room = capacity.samples.saturating_sub(unplayed.samples);
        let is_full = sound.len() > room;
        if is_full && !state.full {
            tracing::warn!("the sink of the pipe plays too slowly: sound is dropped");
        }
        state.full = is_full;
        match is_full {
            true => Ok(()),
            false => sink.render(sound),
        }
    }

    /// Ends the recording and the playback that the pipe began.
    fn end_sound(&self, state: &mut State) -> Result<(), DeviceError> {
        let recording = match std::mem::take(&mut state.began_recording) {
            true => need(self.source.audio_grabber())?.set_recording(false),
            false => Ok(()),
        };
        if std::mem::take(&mut state.began_playing) {
            need(self.sink.audio_render())?.set_playing(false)?;
        }
        recording
    }

    /// Drops the sound that was recorded before the start, unless that is done.
    fn drop_old_sound(&self, state: &mut State) -> Result<(), DeviceError> {
        if !state.is_sound_fresh {
            need(self.source.audio_visual_grabber())?.audio_visual()?;
            state.is_sound_fresh = true;
        }
        Ok(())
    }

    fn begin_sound(&self, state: &mut State) -> Result<(), DeviceError> {
        let (source, sink) = (
            need(self.source.audio_grabber())?,
            need(self.sink.audio_render())?,
        );
        if !sink.is_playing()? {
            sink.set_playing(true)?;
            state.began_playing = true;
        }
        if !source.is_recording()? {
            source.set_recording(true)?;
            state.began_recording = true;
        }
        Ok(())
    }
}

/// A chunk of content and the interface that takes it.
enum Chunk<'a> {
    Both(&'a dyn FrameWriterAudioVisual, crate::image::Image, Audio),
    Image(&'a dyn FrameWriterImage, crate::image::Image),
    Sound(&'a dyn AudioRender, Audio),
}

impl Service for DevicePipe {
    fn start_service(&self) -> Result<ServiceStart, DeviceError> {
        let mut state = self.state();
        match self.content {
            PipedContent::Sound => {
                if let Err(error) = self.begin_sound(&mut state) {
                    // The first error says more.
                    let _ = self.end_sound(&mut state);
                    return Err(error);
                }
            }
            PipedContent::AudioVisual => {
                state.is_sound_fresh = false;
                match self.drop_old_sound(&mut state) {
                    // Without an image yet: the first update drops it.
                    Ok(()) | Err(DeviceError::NoDataYet { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
            PipedContent::Images => {}
        }
        Ok(ServiceStart::NeedsUpdates)
    }

    fn update_service(&self) -> Result<ServiceUpdate, DeviceError> {
        let mut state = self.state();
        let chunk = match self.take(&mut state) {
            Ok(chunk) => chunk,
            Err(error) if state.failing => {
                tracing::debug!("the source of the pipe has nothing: {}", chain(&error));
                return Ok(ServiceUpdate::Idle);
            }
            Err(error) => {
                tracing::warn!("the source of the pipe has nothing: {}", chain(&error));
                state.failing = true;
                return Ok(ServiceUpdate::Idle);
            }
        };
        state.failing = false;
        match chunk {
            None => return Ok(ServiceUpdate::Idle),
            Some(Chunk::Both(sink, image, sound)) => sink.put_audio_visual(&image, &sound)?,
            Some(Chunk::Image(sink, image)) => sink.put_image(&image)?,
            Some(Chunk::Sound(sink, sound)) => Self::play(&mut state, sink, &sound)?,
        }
        Ok(ServiceUpdate::Worked)
    }

    fn stop_service(&self) -> Result<(), DeviceError> {
        self.end_sound(&mut self.state())
    }
}

impl Device for DevicePipe {
    crate::offers! { service: Service }
}

/// Chooses the content as stock does.
fn content(source: &dyn Device, sink: &dyn Device) -> Option<PipedContent> {
    let has_both = |device: &dyn Device| {
        let stream = device.audio_visual_stream();
        stream.is_none_or(|stream| stream.has_audio() && stream.has_video())
    };
    let gives_both = source.audio_visual_grabber().is_some() && has_both(source);
    if gives_both && sink.frame_writer_audio_visual().is_some() && has_both(sink) {
        return Some(PipedContent::AudioVisual);
    }
    if source.frame_grabber_image().is_some() && sink.frame_writer_image().is_some() {
        return Some(PipedContent::Images);
    }
    let is_sound = source.audio_grabber().is_some() && sink.audio_render().is_some();
    is_sound.then_some(PipedContent::Sound)
}

fn need<T: ?Sized>(interface: Option<&T>) -> Result<&T, DeviceError> {
    interface.ok_or_else(|| DeviceError::NotSupported {
        what: "the content of the pipe".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;
    use crate::camera::{
        CameraOptions, CameraWithMicrophone, ImageFolderOptions, ImageFolderWriter, SimulatedCamera,
    };
    use crate::fake::{FakeMicrophone, FakeSpeaker, SimulatedBattery};
    use crate::image::{Frame, Image, PixelFormat};
    use crate::{AudioGrabber, AudioVisualGrabber, AudioVisualStream, FrameGrabberImage};

    const TEST_TIMEOUT: Duration = Duration::from_secs(60);

    /// A source of images that a test counts up, and a sink that keeps them; with or without sound.
    #[derive(Default)]
    struct Both {
        number: Mutex<u64>,
        is_failing: Mutex<bool>,
        /// Samples recorded before the first call, which takes them.
        recorded: Mutex<Vec<i16>>,
        taken: Mutex<Vec<(u8, usize)>>,
        lacks_sound: bool,
    }

    impl FrameGrabberImage for Both {
        fn image_size(&self) -> Result<(usize, usize), DeviceError> {
            Ok((1, 1))
        }

        fn image(&self) -> Result<Frame, DeviceError> {
            if *self.is_failing.lock().unwrap() {
                return Err(DeviceError::NoDataYet { what: "image" });
            }
            let number = *self.number.lock().unwrap();
            let image = Image::new(PixelFormat::Mono, 1, 1, vec![number as u8])?;
            Ok(Frame {
                image,
                number,
                time: 0.0,
            })
        }
    }

    impl AudioVisualGrabber for Both {
        fn audio_visual(&self) -> Result<(Frame, Audio), DeviceError> {
            let image = self.image()?;
            let mut samples = std::mem::take(&mut *self.recorded.lock().unwrap());
            samples.extend([1, 2]);
            let sound = Audio {
                channels: 1,
                rate: 10,
                samples,
            };
            Ok((image, sound))
        }
    }

    impl FrameWriterImage for Both {
        fn put_image(&self, image: &Image) -> Result<(), DeviceError> {
            self.put_audio_visual(image, &Audio::default())
        }
    }

    impl FrameWriterAudioVisual for Both {
        fn put_audio_visual(&self, image: &Image, sound: &Audio) -> Result<(), DeviceError> {
            let grey = image.pixels()[0];
            if grey == 99 {
                return Err(DeviceError::NotSupported {
                    what: "99".to_owned(),
                });
            }
            self.taken.lock().unwrap().push((grey, sound.len()));
            Ok(())
        }
    }

    impl AudioVisualStream for Both {
        fn has_audio(&self) -> bool {
            !self.lacks_sound
        }
        fn has_video(&self) -> bool {
            true
        }
    }

    impl Device for Both {
        crate::offers! {
            frame_grabber_image: FrameGrabberImage,
            audio_visual_grabber: AudioVisualGrabber,
            frame_writer_image: FrameWriterImage,
            frame_writer_audio_visual: FrameWriterAudioVisual,
            audio_visual_stream: AudioVisualStream,
        }
    }

    fn both(lacks_sound: bool) -> Arc<Both> {
        Arc::new(Both {
            lacks_sound,
            ..Both::default()
        })
    }

    #[test]
    fn each_image_is_passed_on_once_with_its_sound() {
        let (source, sink) = (both(false), both(false));
        let pipe = DevicePipe::new(source.clone(), sink.clone()).unwrap();
        assert_eq!(pipe.content(), PipedContent::AudioVisual);
        assert_eq!(pipe.start_service().unwrap(), ServiceStart::NeedsUpdates);
        let update = || pipe.update_service().unwrap();
        assert_eq!(
            (update(), update()),
            (ServiceUpdate::Worked, ServiceUpdate::Idle)
        );
        *source.number.lock().unwrap() = 4;
        assert_eq!(
            (update(), update()),
            (ServiceUpdate::Worked, ServiceUpdate::Idle)
        );
        assert_eq!(*sink.taken.lock().unwrap(), [(0, 2), (4, 2)]);
        pipe.stop_service().unwrap();
    }

    #[test]
    fn sound_from_before_the_start_is_dropped() {
        let (source, sink) = (both(false), both(false));
        *source.recorded.lock().unwrap() = vec![7; 100];
        let pipe = DevicePipe::new(source.clone(), sink.clone()).unwrap();
        pipe.start_service().unwrap();
        assert_eq!(pipe.update_service().unwrap(), ServiceUpdate::Worked);
        assert_eq!(*sink.taken.lock().unwrap(), [(0, 2)]);
        pipe.stop_service().unwrap();
        // The same without an image at the start.
        *source.is_failing.lock().unwrap() = true;
        pipe.start_service().unwrap();
        *source.is_failing.lock().unwrap() = false;
        *source.recorded.lock().unwrap() = vec![7; 100];
        *source.number.lock().unwrap() = 1;
        assert_eq!(pipe.update_service().unwrap(), ServiceUpdate::Worked);
        assert_eq!(*sink.taken.lock().unwrap(), [(0, 2), (1, 2)]);
    }

    #[test]
    fn a_device_that_lacks_sound_gets_images_alone() {
        for (source, sink) in [(true, false), (false, true)] {
            let (source, sink) = (both(source), both(sink));
            let pipe = DevicePipe::new(source, sink.clone()).unwrap();
            assert_eq!(pipe.content(), PipedContent::Images);
            assert_eq!(pipe.update_service().unwrap(), ServiceUpdate::Worked);
            assert_eq!(*sink.taken.lock().unwrap(), [(0, 0)]);
        }
    }

    #[test]
    fn a_source_that_fails_is_tried_again_and_a_sink_that_fails_ends_it() {
        for lacks_sound in [true, false] {
            let (source, sink) = (both(lacks_sound), both(false));
            let pipe = DevicePipe::new(source.clone(), sink).unwrap();
            *source.is_failing.lock().unwrap() = true;
            assert_eq!(pipe.update_service().unwrap(), ServiceUpdate::Idle);
            *source.is_failing.lock().unwrap() = false;
            assert_eq!(pipe.update_service().unwrap(), ServiceUpdate::Worked);
            *source.number.lock().unwrap() = 99;
            assert!(pipe.update_service().is_err());
        }
    }

    #[test]
    fn sound_is_passed_on_in_chunks_while_the_service_runs() {
        let (microphone, speaker) = (
            Arc::new(FakeMicrophone::new()),
            Arc::new(FakeSpeaker::new(1, 16_000)),
        );
        let pipe = DevicePipe::new(microphone.clone(), speaker.clone()).unwrap();
        assert_eq!(pipe.content(), PipedContent::Sound);
        pipe.start_service().unwrap();
        assert!(microphone.is_recording().unwrap() && speaker.is_playing().unwrap());
        let begun = Instant::now();
        while pipe.update_service().unwrap() == ServiceUpdate::Idle {
            assert!(begun.elapsed() < TEST_TIMEOUT);
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(
            begun.elapsed() >= Duration::from_millis(270),
            "4410 samples take 276 ms"
        );
        assert!(speaker.unplayed().unwrap().samples > 0);
        pipe.stop_service().unwrap();
        assert!(!microphone.is_recording().unwrap() && !speaker.is_playing().unwrap());
    }

    #[test]
    fn the_rest_of_a_recording_is_passed_on_and_a_full_sink_misses_sound() {
        let (microphone, speaker) = (
            Arc::new(FakeMicrophone::new()),
            Arc::new(FakeSpeaker::new(1, 16_000)),
        );
        let pipe = DevicePipe::new(microphone.clone(), speaker.clone()).unwrap();
        let record_some = || {
            microphone.set_recording(true).unwrap();
            while microphone.recorded().unwrap().samples == 0 {
                std::thread::yield_now();
            }
            microphone.set_recording(false).unwrap();
        };
        record_some();
        let recorded = microphone.recorded().unwrap().samples;
        assert_eq!(pipe.update_service().unwrap(), ServiceUpdate::Worked);
        assert_eq!(
            speaker.unplayed().unwrap().samples,
            recorded.min(MAX_SOUND_CHUNK)
        );
        while pipe.update_service().unwrap() == ServiceUpdate::Worked {}
        speaker.reset_playback().unwrap();
        let silence = |samples| Audio {
            channels: 1,
            rate: 16_000,
            samples: vec![0; samples],
        };
        let capacity = speaker.playback_capacity().unwrap().samples;
        speaker.render(&silence(capacity)).unwrap();
        record_some();
        assert_eq!(pipe.update_service().unwrap(), ServiceUpdate::Worked);
        assert_eq!(speaker.unplayed().unwrap().samples, capacity);
    }

    #[test]
    fn devices_without_anything_in_common_are_refused() {
        let battery = || Arc::new(SimulatedBattery::new(1.0, 1.0));
        assert!(DevicePipe::new(battery(), both(false)).is_err());
        assert!(DevicePipe::new(both(false), battery()).is_err());
        assert!(DevicePipe::new(Arc::new(FakeMicrophone::new()), both(false)).is_err());
    }

    #[test]
    fn a_camera_with_a_microphone_is_written_to_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let camera = SimulatedCamera::start(CameraOptions::new().size(4, 3).rate(100.0)).unwrap();
        let source =
            CameraWithMicrophone::new(Arc::new(camera), Arc::new(FakeMicrophone::new())).unwrap();
        let writer = ImageFolderWriter::open(folder.path(), ImageFolderOptions::new()).unwrap();
        let writer = Arc::new(writer);
        let pipe = DevicePipe::new(Arc::new(source), writer.clone()).unwrap();
        assert_eq!(pipe.content(), PipedContent::AudioVisual);
        let begun = Instant::now();
        while writer.images() < 4 {
            assert!(begun.elapsed() < TEST_TIMEOUT);
            if pipe.update_service().unwrap() == ServiceUpdate::Idle {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        let heard = std::fs::read(folder.path().join("sound.wav")).unwrap();
        assert!(
            heard.len() > 44 + 160 && heard.starts_with(b"RIFF"),
            "{}",
            heard.len()
        );
    }
}
