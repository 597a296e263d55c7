//! Sources of objects.

use crate::item::Item;

/// An error of a detection.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// The source delivers nothing new.
    #[error(
        "the {detector} detector got nothing new from {peer} for {seconds:.1} s; check that it runs and is connected"
    )]
    Stale {
        /// Name of the detector.
        detector: &'static str,
        /// Name of the port or file.
        peer: String,
        /// Age of the newest data, s.
        seconds: f64,
    },
    /// The camera delivers images, but always the same one.
    #[error(
        "the {detector} detector has got the same image from {peer} again and again for {seconds:.1} s; restart its driver"
    )]
    Frozen {
        /// Name of the detector.
        detector: &'static str,
        /// Name of the port or file.
        peer: String,
        /// Time without another image, s.
        seconds: f64,
    },
    /// The camera is not where it was when it was calibrated.
    #[error(
        "the camera has moved by {pixels:.1} pixels since its calibration; calibrate it again with `yarp calibrate`"
    )]
    CameraMoved {
        /// Displacement of the reference marks, pixels.
        pixels: f64,
    },
    /// Somebody asked to halt at once while it was waited for.
    #[error("stopped while objects were detected")]
    Stopped,
    /// The detection failed otherwise.
    #[error("the {detector} detector failed: {source}")]
    Failed {
        /// Name of the detector.
        detector: &'static str,
        /// Reason.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// A source of the objects on the table: label, class, shape with size, and pose.
pub trait Detector {
    /// Returns the name for reports: a claim about objects says which detector made it.
    fn name(&self) -> &'static str;

    /// Returns the objects on the table now.
    ///
    /// Errors: [`DetectError`]; then nothing is known about the table.
    fn detect(&mut self) -> Result<Vec<Item>, DetectError>;

    /// Announces [`finish_detection`](Self::finish_detection): a detector that needs time begins now, in the background.
    ///
    /// One that does not detects at the end.
    fn begin_detection(&mut self) {}

    /// Returns the objects that were on the table when the detection was begun, or later.
    ///
    /// Errors: those of [`detect`](Self::detect).
    fn finish_detection(&mut self) -> Result<Vec<Item>, DetectError> {
        self.detect()
    }
}
