//! The CAN bus, and what Barrett's pucks say on it.
//!
//! * [`CanBus`]: a bus, as a driver needs it; `SocketCan` is the one of the Linux kernel.
//! * [`puck`]: the frames of pucks and safety module, as values. No bus, no clock.

mod bus;
mod frame;
pub mod puck;
#[cfg(target_os = "linux")]
mod socket;

pub use bus::{BusError, CanBus};
pub use frame::Frame;
#[cfg(target_os = "linux")]
pub use socket::SocketCan;
