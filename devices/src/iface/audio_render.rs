//! Sound to a loudspeaker.

use super::{Audio, AudioBufferSize};
use crate::DeviceError;

/// A loudspeaker (stock: `IAudioRender`).
pub trait AudioRender: Send + Sync {
    /// Queues sound for playback; returns at once (`renderSound`).
    ///
    /// Errors: [`DeviceError::Unsuitable`] for another number of channels, another rate, or more than there is room for.
    fn render(&self, sound: &Audio) -> Result<(), DeviceError>;

    /// Begins to play, or ends it (`startPlayback`, `stopPlayback`).
    fn set_playing(&self, playing: bool) -> Result<(), DeviceError>;

    /// Returns whether it plays (`isPlaying`).
    fn is_playing(&self) -> Result<bool, DeviceError>;

    /// Returns the capacity of the playback buffer (`getPlaybackAudioBufferMaxSize`).
    fn playback_capacity(&self) -> Result<AudioBufferSize, DeviceError>;

    /// Returns the amount of sound still to be played (`getPlaybackAudioBufferCurrentSize`).
    fn unplayed(&self) -> Result<AudioBufferSize, DeviceError>;

    /// Forgets what was to be played (`resetPlaybackAudioBuffer`).
    fn reset_playback(&self) -> Result<(), DeviceError>;
}
