//! An open device.

use std::pin::Pin;
use std::sync::Arc;

use yarp_devices::Device;

use crate::HostError;
use crate::robot::DeviceDescription;

/// A boxed future.
pub type Future<'a, T> = Pin<Box<dyn std::future::Future<Output = T> + Send + 'a>>;

/// Parts that a device offers to devices that attach to it. A new kind of part is a new field.
#[derive(Clone, Default)]
#[non_exhaustive]
pub struct Parts {
    /// Control board.
    pub board: Option<Arc<dyn Device>>,
    /// Camera.
    pub camera: Option<Arc<dyn Device>>,
    /// Controller of a tool.
    pub tool: Option<Arc<dyn Device>>,
    /// Any other device; what attaches to it checks its interface.
    pub other: Option<Arc<dyn Device>>,
    /// Sensors of several kinds.
    pub sensors: Option<Arc<dyn Device>>,
    /// One sensor of several channels.
    pub channels: Option<Arc<dyn Device>>,
    /// Devices of the robot.
    pub robot: Option<Arc<[DeviceDescription]>>,
}

impl Parts {
    /// Returns true if the device offers nothing.
    pub fn is_empty(&self) -> bool {
        self.devices().next().is_none() && self.robot.is_none()
    }

    /// Returns the devices among them, each kind of part once.
    pub(crate) fn devices(&self) -> impl Iterator<Item = &Arc<dyn Device>> {
        let Self {
            board,
            camera,
            tool,
            other,
            sensors,
            channels,
            robot: _,
        } = self;
        [camera, other, sensors, channels, board, tool]
            .into_iter()
            .flatten()
    }
}

/// A device that another one attaches to.
#[derive(Clone)]
pub struct Attached {
    /// Name of the device.
    pub device: String,
    /// Name that the attaching device uses for it.
    pub network: String,
    /// Parts that it offers.
    pub parts: Parts,
}

/// An open device, closed with [`close`](Self::close).
pub trait Hosted: Send {
    /// Returns the parts it offers to others; none by default.
    fn parts(&self) -> Parts {
        Parts::default()
    }

    /// Returns the device to park before closing, if it runs in this process.
    fn machine(&self) -> Option<Arc<dyn Device>> {
        None
    }

    /// Returns the device with a [service](yarp_devices::Service) that the host starts, updates and stops.
    fn service(&self) -> Option<Arc<dyn Device>> {
        None
    }

    /// Returns true if it calibrates and parks other devices.
    fn is_calibrator(&self) -> bool {
        false
    }

    /// Attaches to other devices, like a network wrapper.
    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        drop(others);
        Box::pin(async { Err(HostError::NoWrapper) })
    }

    /// Detaches from the other devices.
    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async { Err(HostError::NoWrapper) })
    }

    /// Closes the device, in bounded time.
    fn close(self: Box<Self>) -> Future<'static, ()>;
}
