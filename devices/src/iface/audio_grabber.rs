//! Sound from a microphone.

use std::time::Duration;

use super::{Audio, AudioBufferSize};
use crate::DeviceError;

/// A microphone (stock: `IAudioGrabberSound`).
pub trait AudioGrabber: Send + Sync {
    /// What was recorded and not fetched yet: at least `at_least` moments and at most `at_most` (`getSound`).
    ///
    /// Blocks until there is enough, for `timeout` at the most, and then gives what there is.
    ///
    /// Errors: [`DeviceError::Unsuitable`] when `at_least` is more than `at_most` or than the buffer holds.
    fn sound(
        &self,
        at_least: usize,
        at_most: usize,
        timeout: Duration,
    ) -> Result<Audio, DeviceError>;

    /// Begins to record, or ends it (`startRecording`, `stopRecording`).
    fn set_recording(&self, recording: bool) -> Result<(), DeviceError>;

    /// Whether it records (`isRecording`).
    fn is_recording(&self) -> Result<bool, DeviceError>;

    /// How much it can hold (`getRecordingAudioBufferMaxSize`).
    fn recording_capacity(&self) -> Result<AudioBufferSize, DeviceError>;

    /// How much it holds (`getRecordingAudioBufferCurrentSize`).
    fn recorded(&self) -> Result<AudioBufferSize, DeviceError>;

    /// Forgets what was recorded (`resetRecordingAudioBuffer`).
    fn reset_recording(&self) -> Result<(), DeviceError>;

    /// By how much samples are multiplied (`setSWGain`).
    fn set_software_gain(&self, gain: f64) -> Result<(), DeviceError>;

    /// How sensitive the microphone is (`setHWGain`).
    fn set_hardware_gain(&self, gain: f64) -> Result<(), DeviceError>;
}
