//! Errors of hosting.

use yarp_devices::DeviceError;
use yarp_devices::remapper::RemapError;
use yarp_wire::settings::{Origin, ParameterError};
use yarp_wrappers::OpenError;

/// Error from opening or attaching a device.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HostError {
    /// A parameter is missing or invalid.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The device type is unknown.
    #[error(
        "{origin}: device {device}: there is no device {kind}{hint}; `yarp dev --list` shows all"
    )]
    UnknownDeviceType {
        /// Position of the parameter.
        origin: Origin,
        /// Name of the device.
        device: String,
        /// Requested type.
        kind: String,
        /// Suggestion of a similar type.
        hint: String,
    },
    /// The device did not start.
    #[error("{origin}: device {device} did not start")]
    Device {
        /// Position of its description.
        origin: Origin,
        /// Name of the device.
        device: String,
        /// Cause.
        #[source]
        source: Box<DeviceError>,
    },
    /// The ports of the device could not be opened.
    #[error("{origin}: device {device} did not open")]
    Open {
        /// Position of its description.
        origin: Origin,
        /// Name of the device.
        device: String,
        /// Cause.
        #[source]
        source: Box<OpenError>,
    },
    /// The device cannot attach to others.
    #[error("the device cannot attach to others")]
    NoWrapper,
    /// The device cannot attach to this one.
    #[error("it cannot attach to {device}, expected {expected}")]
    Unsuitable {
        /// Name of the device to attach to.
        device: String,
        /// Kind of device that it can attach to.
        expected: &'static str,
    },
    /// The device cannot attach to several devices.
    #[error(
        "it attaches to one device, got {got}; attach a controlboardremapper to them, and it to that"
    )]
    Several {
        /// Number of devices.
        got: usize,
    },
    /// The server of a camera cannot attach to several cameras.
    #[error("it attaches to one camera, got {got}; give each its own server")]
    SeveralCameras {
        /// Number of devices.
        got: usize,
    },
    /// The devices cannot be combined to one board.
    #[error("{origin}: device {device}: the devices cannot be combined to one board")]
    Remap {
        /// Position of the description of the board.
        origin: Origin,
        /// Name of the board.
        device: String,
        /// Cause.
        #[source]
        source: Box<RemapError>,
    },
    /// No device was attached for this network.
    #[error(
        "{origin}: device {device}: no device is attached as {network}, expected one for each of its networks"
    )]
    NoNetwork {
        /// Position of the description of the board.
        origin: Origin,
        /// Name of the board.
        device: String,
        /// Name of the network.
        network: String,
    },
    /// The service of the device did not start.
    #[error("the service of {device} did not start")]
    Service {
        /// Name of the device.
        device: String,
        /// Cause.
        #[source]
        source: Box<DeviceError>,
    },
    /// Devices are nested too deeply.
    #[error(
        "{origin}: device {device}: devices in devices go {depth} deep, expected at most {most}"
    )]
    Nested {
        /// Position of its description.
        origin: Origin,
        /// Name of the device.
        device: String,
        /// Depth of the device.
        depth: usize,
        /// Maximum depth.
        most: usize,
    },
    /// The device is attached already.
    #[error("it is attached already")]
    Attached,
}
