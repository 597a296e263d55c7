//! Devices that work for remote users on their own.

use crate::DeviceError;

/// A device that does something by itself once it is started, such as passing images on (stock: `IService`).
///
/// The host starts it once after the device is open, calls [`update_service`](Self::update_service) again and again if the start asks for
/// that, and stops it once before the device is closed. All calls come from one thread at a time.
pub trait Service: Send + Sync {
    /// Starts the service (`startService`).
    ///
    /// * Errors: those of the device; then it is not started.
    fn start_service(&self) -> Result<ServiceStart, DeviceError>;

    /// Lets the service work for a moment (`updateService`). Returns in bounded time and does not wait for work: the host waits before
    /// it asks again if there was [nothing to do](ServiceUpdate::Idle).
    ///
    /// * Errors: those that end the service.
    fn update_service(&self) -> Result<ServiceUpdate, DeviceError>;

    /// Stops the service, in bounded time (`stopService`). Called after each start, also when the service has ended by itself.
    ///
    /// * Errors: those of the device; it is stopped as far as possible.
    fn stop_service(&self) -> Result<(), DeviceError>;
}

/// Result of starting a service.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum ServiceStart {
    /// The service runs in the background and needs no updates (stock: true).
    InBackground,
    /// The service works only during updates (stock: false).
    NeedsUpdates,
}

/// Result of an update of a service.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum ServiceUpdate {
    /// It worked; there may be more to do.
    Worked,
    /// There was nothing to do.
    Idle,
    /// It wants to be stopped.
    Ended,
}
