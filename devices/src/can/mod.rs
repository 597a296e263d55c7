//! The CAN bus, and the messages of Barrett's pucks on it.
//!
//! * [`CanBus`]: a bus, as a driver needs it; `SocketCan` is the one of the Linux kernel.
//! * [`puck`]: the frames of pucks and safety module, as values. No bus, no clock.

mod can_bus;
mod can_frame;
pub mod puck;
#[cfg(target_os = "linux")]
mod socketcan;

pub use can_bus::{BusError, CanBus};
pub use can_frame::CanFrame;
#[cfg(target_os = "linux")]
pub use socketcan::SocketCan;
