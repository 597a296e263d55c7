//! The errors of this crate.

use std::path::PathBuf;

use yarp_devices::DeviceError;

/// An error of vision.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VisionError {
    /// OpenCV refused a call.
    #[error("{step}: OpenCV refused: {source}")]
    OpenCv {
        /// Step that failed.
        step: &'static str,
        /// OpenCV's own text.
        source: opencv::Error,
    },
    /// A file or folder could not be read or written.
    #[error("{path}: cannot {step}: {source}", path = path.display())]
    File {
        /// Step that failed, as a verb with its object.
        step: &'static str,
        /// Path of the file or folder.
        path: PathBuf,
        /// Reason.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// An image, a device or a network answered with an error.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A camera on the network could not be reached.
    #[error(transparent)]
    Client(#[from] yarp_client::Error),
    /// A camera has delivered no image so far.
    #[error("{source_name} has delivered no image so far; check that the camera runs")]
    NoImageYet {
        /// Name of the image source.
        source_name: String,
    },
    /// A camera delivers no new images any more.
    #[error(
        "{source_name} has delivered no new image for {timeout:?}; check camera and network, then connect again"
    )]
    StreamStopped {
        /// Name of the image source.
        source_name: String,
        /// Maximum time without a new image.
        timeout: std::time::Duration,
    },
    /// A recorded sequence has no further images.
    #[error("{folder}: no image after the {images} of this sequence", folder = folder.display())]
    EndOfSequence {
        /// Folder of the sequence.
        folder: PathBuf,
        /// Number of its images.
        images: usize,
    },
    /// The system started no thread.
    #[error("cannot start a thread for images: {0}")]
    Thread(std::io::Error),
    /// An image shows nothing.
    #[error(
        "the image shows nothing (mean {mean:.0}, standard deviation {deviation:.1} of 255); check lens cover, light and exposure"
    )]
    NoContrast {
        /// Mean of the grey values.
        mean: f64,
        /// Standard deviation of the grey values.
        deviation: f64,
    },
    /// A depth image shows neither objects nor anything below them.
    #[error(
        "the depth image shows no table ({percent:.0} % of it are no nearer than objects on the table); check whether something is in front of the sensor, and its calibration", percent = 100.0 * share
    )]
    NoTable {
        /// Share of the image that is no nearer than objects on the table.
        share: f64,
    },
    /// An input does not have the expected form.
    #[error("{what}: expected {expected}, got {actual}")]
    Unsuitable {
        /// Input that was examined.
        what: String,
        /// Expected form.
        expected: String,
        /// Form that came instead.
        actual: String,
    },
}

impl VisionError {
    /// Returns a closure that turns an error of OpenCV into one of this crate.
    pub(crate) fn cv(step: &'static str) -> impl FnOnce(opencv::Error) -> Self {
        move |source| Self::OpenCv { step, source }
    }

    /// Returns a closure that turns an error about a file into one of this crate.
    pub(crate) fn file<E>(step: &'static str, path: &std::path::Path) -> impl FnOnce(E) -> Self
    where
        E: Into<Box<dyn std::error::Error + Send + Sync>>,
    {
        let path = path.to_owned();
        move |source| Self::File {
            step,
            path,
            source: source.into(),
        }
    }
}
