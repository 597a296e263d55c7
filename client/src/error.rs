//! Error of a robot.

use yarp_devices::DeviceError;
use yarp_ports::PortError;
use yarp_wrappers::OpenError;

/// Error of a robot.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The network could not be reached.
    #[error(transparent)]
    Network(#[from] PortError),
    /// The robot could not be reached.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The robot refused, or did not answer.
    #[error(transparent)]
    Device(#[from] DeviceError),
}
