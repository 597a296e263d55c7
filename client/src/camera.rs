//! A camera somewhere on the network.

use std::ops::Deref;
use std::time::Duration;

use yarp_devices::{DeviceError, FrameGrabberImage};
use yarp_ports::Network;
use yarp_wrappers::{RemoteFrameGrabber, RemoteFrameGrabberOptions, wait_first_value};

use crate::{Error, Result, local_name, time};

/// Maximum wait for the first image of a camera.
const FIRST_IMAGE_TIMEOUT: Duration = Duration::from_secs(5);

/// A camera somewhere on the network that has delivered at least one image.
///
/// All interfaces of a camera can be called on it directly, see [`RemoteFrameGrabber`].
#[derive(Debug)]
pub struct Camera {
    grabber: RemoteFrameGrabber,
}

impl Camera {
    /// Connects to the camera `remote`, such as `/grabber`, on the network that the environment and the configuration
    /// files name.
    ///
    /// Waits for the first image, at most 5 s.
    ///
    /// Errors: [`Error::Network`], [`Error::Open`], [`Error::NoImage`].
    pub fn connect(remote: &str) -> Result<Self> {
        Self::connect_on(&Network::from_process()?, remote)
    }

    /// Connects on the given network.
    pub fn connect_on(network: &Network, remote: &str) -> Result<Self> {
        let options = RemoteFrameGrabberOptions::new(remote, local_name::unique(remote));
        Self::open(network, options)
    }

    /// Connects with explicit options.
    pub fn open(network: &Network, options: RemoteFrameGrabberOptions) -> Result<Self> {
        time::follow(network)?;
        let grabber = RemoteFrameGrabber::open(network, options)?;
        match wait_first_value(FIRST_IMAGE_TIMEOUT, || grabber.image()) {
            Ok(_) => Ok(Self { grabber }),
            Err(DeviceError::NoDataYet { .. }) => Err(Error::NoImage {
                remote: grabber.remote().to_owned(),
                seconds: FIRST_IMAGE_TIMEOUT.as_secs_f64(),
            }),
            Err(error) => Err(error.into()),
        }
    }
}

impl Deref for Camera {
    type Target = RemoteFrameGrabber;

    fn deref(&self) -> &RemoteFrameGrabber {
        &self.grabber
    }
}
