//! Images with sound.

use super::{Audio, FrameGrabberImage};
use crate::DeviceError;
use crate::image::Frame;

/// A camera with a microphone (stock: `IAudioVisualGrabber`).
///
/// The images alone are those of [`FrameGrabberImage`]; reading them takes no sound.
pub trait AudioVisualGrabber: FrameGrabberImage {
    /// Returns the newest image, and takes the sound that was recorded since the last call (`getAudioVisual`).
    ///
    /// Does not wait: the image may be that of the last call, and the sound may be empty. Its length is bounded by the recording buffer of
    /// the device.
    ///
    /// * Errors: [`DeviceError::NoDataYet`] before the first image; then no sound is taken.
    fn audio_visual(&self) -> Result<(Frame, Audio), DeviceError>;
}
