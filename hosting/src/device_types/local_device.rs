//! Devices that run in this process.

use std::sync::Arc;

use yarp_devices::{Device, DeviceError};
use yarp_wire::settings::Parameters;

use crate::{Future, HostError, Hosted, Parts};

/// Starts a device on a thread that may block.
pub(super) async fn start<D: Device + 'static>(
    parameters: &Parameters,
    start: impl FnOnce() -> Result<D, DeviceError> + Send + 'static,
) -> Result<Arc<D>, HostError> {
    run(parameters, start).await.map(Arc::new)
}

/// Starts a device that is shared already, on a thread that may block.
pub(super) async fn start_shared(
    parameters: &Parameters,
    start: impl FnOnce() -> Result<Arc<dyn Device>, DeviceError> + Send + 'static,
) -> Result<Arc<dyn Device>, HostError> {
    run(parameters, start).await
}

async fn run<T: Send + 'static>(
    parameters: &Parameters,
    start: impl FnOnce() -> Result<T, DeviceError> + Send + 'static,
) -> Result<T, HostError> {
    let started = tokio::task::spawn_blocking(start).await;
    let started =
        started.unwrap_or_else(|panicked| std::panic::resume_unwind(panicked.into_panic()));
    started.map_err(|source| HostError::Device {
        origin: parameters.origin().clone(),
        device: parameters.device().to_owned(),
        source: Box::new(source),
    })
}

/// A device with its parts.
pub(super) struct LocalDevice {
    device: Arc<dyn Device>,
    parts: Parts,
    /// True if it is parked before it is closed.
    parks: bool,
}

impl LocalDevice {
    /// Creates a device that offers itself as one part.
    fn new(device: Arc<dyn Device>, part: fn(&mut Parts) -> &mut Option<Arc<dyn Device>>) -> Self {
        let mut parts = Parts::default();
        *part(&mut parts) = Some(device.clone());
        Self {
            device,
            parts,
            parks: false,
        }
    }

    /// Creates a device whose joints are parked before it is closed.
    pub(super) fn machine(device: Arc<dyn Device>) -> Self {
        Self {
            parks: true,
            ..Self::board(device)
        }
    }

    /// Creates a device with joints that another program parks.
    pub(super) fn board(device: Arc<dyn Device>) -> Self {
        Self::new(device, |parts| &mut parts.board)
    }

    /// Creates a camera.
    pub(super) fn camera(device: Arc<dyn Device>) -> Self {
        Self::new(device, |parts| &mut parts.camera)
    }

    /// Creates a device of any other kind.
    pub(super) fn other(device: Arc<dyn Device>) -> Self {
        Self::new(device, |parts| &mut parts.other)
    }

    /// Creates sensors of several kinds.
    pub(super) fn sensors(device: Arc<dyn Device>) -> Self {
        Self::new(device, |parts| &mut parts.sensors)
    }

    /// Creates a sensor of several channels.
    pub(super) fn channels(device: Arc<dyn Device>) -> Self {
        Self::new(device, |parts| &mut parts.channels)
    }

    /// Offers the device as another part, too.
    pub(super) fn also(mut self, part: fn(&mut Parts) -> &mut Option<Arc<dyn Device>>) -> Self {
        *part(&mut self.parts) = Some(self.device.clone());
        self
    }

    /// Creates a controller of a tool.
    pub(super) fn tool(device: Arc<dyn Device>) -> Self {
        Self::new(device, |parts| &mut parts.tool)
    }
}

impl Hosted for LocalDevice {
    fn parts(&self) -> Parts {
        self.parts.clone()
    }

    fn machine(&self) -> Option<Arc<dyn Device>> {
        self.parks.then(|| self.device.clone())
    }

    fn service(&self) -> Option<Arc<dyn Device>> {
        self.device.service().map(|_| self.device.clone())
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async {
            // Dropping a device joins its threads and closes its remote ports, which blocks.
            let _ = tokio::task::spawn_blocking(move || drop(self)).await;
        })
    }
}
