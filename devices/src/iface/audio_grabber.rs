//! Sound from a microphone.

use std::time::Duration;

use super::{Audio, AudioBufferSize};
use crate::DeviceError;

/// A microphone (stock: `IAudioGrabberSound`).
pub trait AudioGrabber: Send + Sync {
    /// Takes recorded sound that was not fetched yet: at least `at_least` samples and at most `at_most` (`getSound`).
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

    /// Returns whether it records (`isRecording`).
    fn is_recording(&self) -> Result<bool, DeviceError>;

    /// Returns the capacity of the recording buffer (`getRecordingAudioBufferMaxSize`).
    fn recording_capacity(&self) -> Result<AudioBufferSize, DeviceError>;

    /// Returns the amount of recorded sound (`getRecordingAudioBufferCurrentSize`).
    fn recorded(&self) -> Result<AudioBufferSize, DeviceError>;

    /// Forgets what was recorded (`resetRecordingAudioBuffer`).
    fn reset_recording(&self) -> Result<(), DeviceError>;

    /// By how much samples are multiplied (`setSWGain`).
    fn set_software_gain(&self, gain: f64) -> Result<(), DeviceError>;

    /// Sets the sensitivity of the microphone (`setHWGain`).
    fn set_hardware_gain(&self, gain: f64) -> Result<(), DeviceError>;
}
