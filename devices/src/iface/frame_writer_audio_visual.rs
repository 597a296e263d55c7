//! Receivers of images with sound.

use super::Audio;
use crate::DeviceError;
use crate::image::Image;

/// A device that images with sound are written to (stock: `IFrameWriterAudioVisual`).
pub trait FrameWriterAudioVisual: Send + Sync {
    /// Writes an image and the sound that belongs to it, which may be empty (`putAudioVisual`).
    ///
    /// * Errors: those of [`FrameWriterImage::put_image`](super::FrameWriterImage::put_image), and [`DeviceError::Unsuitable`] for sound of
    ///   another rate or number of channels than before.
    fn put_audio_visual(&self, image: &Image, sound: &Audio) -> Result<(), DeviceError>;
}
