//! The tool of an arm somewhere on the network.

use std::ops::Deref;
use std::time::Duration;

use yarp_devices::CartesianControl;
use yarp_ports::Network;
use yarp_wrappers::{RemoteCartesianControl, RemoteCartesianOptions, wait_first_value};

use crate::{Result, local_name, time};

/// Maximum wait for the first pose of a tool.
const FIRST_POSE_TIMEOUT: Duration = Duration::from_secs(5);

/// The tool of an arm somewhere on the network, moved in space.
///
/// The interface [`CartesianControl`] can be called on it directly: positions in metres, orientations as axis and angle
/// in radians.
#[derive(Debug)]
pub struct CartesianTool {
    remote: RemoteCartesianControl,
}

impl CartesianTool {
    /// Connects to the Cartesian controller `remote`, such as `/cartController/wam`, on the network that the environment
    /// and the configuration files name.
    ///
    /// Waits for the first pose, at most 5 s.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network), [`Error::Open`](crate::Error::Open), and
    /// [`Error::Device`](crate::Error::Device) with
    /// [`DeviceError::NoDataYet`](crate::DeviceError::NoDataYet) when the controller replies but publishes nothing.
    pub fn connect(remote: &str) -> Result<Self> {
        Self::connect_on(&Network::from_process()?, remote)
    }

    /// Connects on the given network.
    pub fn connect_on(network: &Network, remote: &str) -> Result<Self> {
        let options = RemoteCartesianOptions::new(remote, local_name::unique(remote));
        Self::open(network, options)
    }

    /// Connects with explicit options.
    pub fn open(network: &Network, options: RemoteCartesianOptions) -> Result<Self> {
        time::follow(network)?;
        let remote = RemoteCartesianControl::open(network, options)?;
        wait_first_value(FIRST_POSE_TIMEOUT, || remote.pose())?;
        Ok(Self { remote })
    }
}

impl Deref for CartesianTool {
    type Target = RemoteCartesianControl;

    fn deref(&self) -> &RemoteCartesianControl {
        &self.remote
    }
}
