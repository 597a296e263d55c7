//! A camera and a microphone as one device.

use std::sync::Arc;
use std::time::Duration;

use crate::image::{Crop, Frame};
use crate::{
    Audio, AudioGrabber, AudioVisualGrabber, AudioVisualStream, Device, DeviceError,
    FirewireControls, FrameGrabberControls, FrameGrabberImage, FrameGrabberImageRaw,
    RgbVisualParams,
};

/// A camera and a microphone, seen as one device of images and sound.
///
/// The microphone records while this device is there. What is not fetched is lost as the microphone loses it, the oldest first.
///
/// ```
/// use std::sync::Arc;
/// use yarp_devices::AudioVisualGrabber;
/// use yarp_devices::camera::{CameraOptions, CameraWithMicrophone, SimulatedCamera};
/// use yarp_devices::fake::FakeMicrophone;
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let camera = Arc::new(SimulatedCamera::start(CameraOptions::new())?);
/// let device = CameraWithMicrophone::new(camera, Arc::new(FakeMicrophone::new()))?;
/// let (frame, sound) = device.audio_visual()?;
/// assert_eq!((frame.image.width(), sound.rate), (320, 16_000));
/// # Ok(())
/// # }
/// ```
pub struct CameraWithMicrophone {
    camera: Arc<dyn Device>,
    microphone: Arc<dyn Device>,
    /// True if the microphone did not record before.
    began_recording: bool,
}

impl std::fmt::Debug for CameraWithMicrophone {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CameraWithMicrophone")
            .field("began_recording", &self.began_recording)
            .finish_non_exhaustive()
    }
}

impl CameraWithMicrophone {
    /// Combines a camera and a microphone, which records from now on.
    ///
    /// * Errors: [`DeviceError::NotSupported`] for devices without images in colour, or without sound, and those of the microphone.
    pub fn new(camera: Arc<dyn Device>, microphone: Arc<dyn Device>) -> Result<Self, DeviceError> {
        if camera.frame_grabber_image().is_none() {
            return Err(missing("images"));
        }
        let sound = microphone.audio_grabber().ok_or_else(|| missing("sound"))?;
        let began_recording = !sound.is_recording()?;
        if began_recording {
            sound.set_recording(true)?;
        }
        Ok(Self {
            camera,
            microphone,
            began_recording,
        })
    }

    fn images(&self) -> Result<&dyn FrameGrabberImage, DeviceError> {
        let images = self.camera.frame_grabber_image();
        images.ok_or_else(|| missing("images"))
    }
}

impl Drop for CameraWithMicrophone {
    fn drop(&mut self) {
        let sound = self.microphone.audio_grabber();
        if let Some(sound) = sound.filter(|_| self.began_recording)
            && let Err(error) = sound.set_recording(false)
        {
            tracing::warn!("the microphone goes on recording: {error}");
        }
    }
}

impl FrameGrabberImage for CameraWithMicrophone {
    fn image_size(&self) -> Result<(usize, usize), DeviceError> {
        self.images()?.image_size()
    }

    fn image(&self) -> Result<Frame, DeviceError> {
        self.images()?.image()
    }

    fn image_crop(&self, crop: &Crop) -> Result<Frame, DeviceError> {
        self.images()?.image_crop(crop)
    }
}

impl AudioVisualGrabber for CameraWithMicrophone {
    fn audio_visual(&self) -> Result<(Frame, Audio), DeviceError> {
        let frame = self.image()?;
        let sound = self.microphone.audio_grabber();
        let sound = sound.ok_or_else(|| missing("sound"))?;
        let heard = sound.sound(0, usize::MAX, Duration::ZERO)?;
        Ok((frame, heard))
    }
}

impl AudioVisualStream for CameraWithMicrophone {
    fn has_audio(&self) -> bool {
        true
    }

    fn has_video(&self) -> bool {
        true
    }

    fn has_raw_video(&self) -> bool {
        self.camera.frame_grabber_image_raw().is_some()
    }
}

impl Device for CameraWithMicrophone {
    crate::offers! {
        frame_grabber_image: FrameGrabberImage,
        audio_visual_grabber: AudioVisualGrabber,
        audio_visual_stream: AudioVisualStream,
    }

    fn frame_grabber_image_raw(&self) -> Option<&dyn FrameGrabberImageRaw> {
        self.camera.frame_grabber_image_raw()
    }

    fn frame_grabber_controls(&self) -> Option<&dyn FrameGrabberControls> {
        self.camera.frame_grabber_controls()
    }

    fn firewire_controls(&self) -> Option<&dyn FirewireControls> {
        self.camera.firewire_controls()
    }

    fn rgb_visual_params(&self) -> Option<&dyn RgbVisualParams> {
        self.camera.rgb_visual_params()
    }

    fn audio_grabber(&self) -> Option<&dyn AudioGrabber> {
        self.microphone.audio_grabber()
    }
}

fn missing(what: &str) -> DeviceError {
    DeviceError::NotSupported {
        what: what.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;
    use crate::camera::{CameraOptions, SimulatedCamera};
    use crate::fake::FakeMicrophone;

    const TEST_TIMEOUT: Duration = Duration::from_secs(60);

    fn camera() -> Arc<SimulatedCamera> {
        let options = CameraOptions::new().size(8, 4).rate(200.0);
        Arc::new(SimulatedCamera::start(options).unwrap())
    }

    #[test]
    fn each_call_takes_the_newest_image_and_the_sound_since_the_last() {
        let microphone = Arc::new(FakeMicrophone::new());
        let device = CameraWithMicrophone::new(camera(), microphone.clone()).unwrap();
        assert!(microphone.is_recording().unwrap());
        let begun = Instant::now();
        let (mut frames, mut heard) = (Vec::new(), Vec::new());
        while heard.len() < 1_600 {
            assert!(begun.elapsed() < TEST_TIMEOUT);
            let (frame, sound) = device.audio_visual().unwrap();
            assert_eq!((sound.channels, sound.rate), (1, 16_000));
            frames.push(frame.number);
            heard.extend(sound.samples);
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(frames.is_sorted() && frames.first() < frames.last());
        // A sample is no further from the one a period later than rounding makes it: nothing is missing in between.
        let period = 16_000 / 40;
        let repeats = heard.iter().zip(&heard[period..]);
        assert!(
            repeats
                .into_iter()
                .all(|(one, other)| one.abs_diff(*other) <= 1)
        );
        let before = microphone.recorded().unwrap().samples;
        device.image().unwrap();
        assert!(
            microphone.recorded().unwrap().samples >= before,
            "an image alone takes no sound"
        );
        drop(device);
        assert!(!microphone.is_recording().unwrap());
    }

    #[test]
    fn a_microphone_that_records_already_goes_on() {
        let microphone = Arc::new(FakeMicrophone::new());
        microphone.set_recording(true).unwrap();
        drop(CameraWithMicrophone::new(camera(), microphone.clone()).unwrap());
        assert!(microphone.is_recording().unwrap());
    }

    #[test]
    fn devices_without_images_or_sound_are_refused() {
        let microphone = || Arc::new(FakeMicrophone::new());
        assert!(CameraWithMicrophone::new(microphone(), microphone()).is_err());
        assert!(CameraWithMicrophone::new(camera(), camera()).is_err());
    }
}
