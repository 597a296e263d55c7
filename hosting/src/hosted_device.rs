//! A device that is open.

use std::pin::Pin;
use std::sync::Arc;

use yarp_devices::Device;

use crate::HostError;

/// Work that is waited for.
pub type Future<'a, T> = Pin<Box<dyn std::future::Future<Output = T> + Send + 'a>>;

/// What a device offers to those that attach to it. A new kind of thing to offer is a new field.
#[derive(Clone, Default)]
#[non_exhaustive]
pub struct Parts {
    /// Joints that move.
    pub board: Option<Arc<dyn Device>>,
    /// Images.
    pub camera: Option<Arc<dyn Device>>,
}

/// A device that another one attaches to.
#[derive(Clone)]
pub struct Attached {
    /// The name of the device.
    pub device: String,
    /// What the one that attaches calls it.
    pub network: String,
    /// What it offers.
    pub parts: Parts,
}

/// A device that is open. It is closed with [`close`](Self::close).
pub trait Hosted: Send {
    /// What it offers to others; nothing unless told otherwise.
    fn parts(&self) -> Parts {
        Parts::default()
    }

    /// What is parked before the device is closed: the machine behind it, if it is ours.
    fn machine(&self) -> Option<Arc<dyn Device>> {
        None
    }

    /// Whether it calibrates and parks others.
    fn is_calibrator(&self) -> bool {
        false
    }

    /// Attaches to others, as a network wrapper does.
    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        drop(others);
        Box::pin(async { Err(HostError::NoWrapper) })
    }

    /// Lets go of the others.
    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async { Err(HostError::NoWrapper) })
    }

    /// Ends it, in bounded time.
    fn close(self: Box<Self>) -> Future<'static, ()>;
}
