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
