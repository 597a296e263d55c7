//! Content of a stream of images and sound.

/// Tells which of its interfaces a device of images and sound really fills (stock: `IAudioVisualStream`).
///
/// A device without this interface fills all that it has.
pub trait AudioVisualStream: Send + Sync {
    /// Returns true if it has sound (`hasAudio`).
    fn has_audio(&self) -> bool;

    /// Returns true if it has images in colour (`hasVideo`).
    fn has_video(&self) -> bool;

    /// Returns true if it has images in one channel (`hasRawVideo`); by default if it has images at all.
    fn has_raw_video(&self) -> bool {
        self.has_video()
    }
}
