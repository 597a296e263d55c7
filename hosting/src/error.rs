//! Why a device could not be hosted.

use yarp_devices::DeviceError;
use yarp_devices::remapper::RemapError;
use yarp_wire::settings::{Origin, ParameterError};
use yarp_wrappers::OpenError;

/// Why a device could not be opened or attached.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HostError {
    /// A parameter is missing or wrong.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// There is no device of this kind.
    #[error(
        "{origin}: device {device}: there is no device {kind}{hint}; `yarp dev --list` shows all"
    )]
    UnknownDeviceType {
        /// Where it is asked for.
        origin: Origin,
        /// Its name.
        device: String,
        /// What it should be.
        kind: String,
        /// What may have been meant.
        hint: String,
    },
    /// The device did not start.
    #[error("{origin}: device {device} did not start")]
    Device {
        /// Where it is described.
        origin: Origin,
        /// Its name.
        device: String,
        /// Why not.
        #[source]
        source: Box<DeviceError>,
    },
    /// Its ports did not open.
    #[error("{origin}: device {device} did not open")]
    Open {
        /// Where it is described.
        origin: Origin,
        /// Its name.
        device: String,
        /// Why not.
        #[source]
        source: Box<OpenError>,
    },
    /// The device attaches to nothing.
    #[error("it is no device that attaches to others")]
    NoWrapper,
    /// The device cannot attach to this one.
    #[error("it cannot attach to {device}, expected {expected}")]
    Unsuitable {
        /// What it should attach to.
        device: String,
        /// What it attaches to.
        expected: &'static str,
    },
    /// The device cannot attach to so many.
    #[error(
        "it attaches to one device, got {got}; attach a controlboardremapper to them, and it to that"
    )]
    Several {
        /// How many were asked for.
        got: usize,
    },
    /// The server of a camera cannot attach to so many.
    #[error("it attaches to one camera, got {got}; give each a server of its own")]
    SeveralCameras {
        /// How many were asked for.
        got: usize,
    },
    /// Devices do not make one board.
    #[error("{origin}: device {device}: the devices do not make one board")]
    Remap {
        /// Where the board is described.
        origin: Origin,
        /// Its name.
        device: String,
        /// Why not.
        #[source]
        source: Box<RemapError>,
    },
    /// No device was attached as this network.
    #[error(
        "{origin}: device {device}: no device is attached as {network}, expected one for each of its networks"
    )]
    NoNetwork {
        /// Where the board is described.
        origin: Origin,
        /// Its name.
        device: String,
        /// The network.
        network: String,
    },
    /// The device is attached already.
    #[error("it is attached already")]
    Attached,
}
