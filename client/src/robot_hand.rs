//! A hand somewhere on the network.

use std::ops::Deref;

use yarp_ports::Network;
use yarp_wrappers::{RemoteHand, RemoteHandOptions};

use crate::{Result, local_name, time};

/// A hand somewhere on the network: named grasps, finger motions, abort.
///
/// The interfaces [`Hand`](yarp_devices::Hand) and [`Grasp`](yarp_devices::Grasp) can be called on it directly.
#[derive(Debug)]
pub struct Hand {
    remote: RemoteHand,
}

impl Hand {
    /// Connects to the hand `remote`, such as `/hand`, on the network that the environment and the configuration files
    /// name.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network), [`Error::Open`](crate::Error::Open).
    pub fn connect(remote: &str) -> Result<Self> {
        Self::connect_on(&Network::from_process()?, remote)
    }

    /// Connects on the given network.
    pub fn connect_on(network: &Network, remote: &str) -> Result<Self> {
        let options = RemoteHandOptions::new(remote, local_name::unique(remote));
        Self::open(network, options)
    }

    /// Connects with explicit options.
    pub fn open(network: &Network, options: RemoteHandOptions) -> Result<Self> {
        time::follow(network)?;
        Ok(Self {
            remote: RemoteHand::open(network, options)?,
        })
    }
}

impl Deref for Hand {
    type Target = RemoteHand;

    fn deref(&self) -> &RemoteHand {
        &self.remote
    }
}
