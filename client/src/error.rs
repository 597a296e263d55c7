//! What can go wrong with a robot.

use yarp_devices::DeviceError;
use yarp_ports::PortError;
use yarp_wrappers::OpenError;

/// Why a robot did not do what it was asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The network is not to be had.
    #[error(transparent)]
    Network(#[from] PortError),
    /// The robot could not be reached.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The robot refused, or did not answer.
    #[error(transparent)]
    Device(#[from] DeviceError),
}
