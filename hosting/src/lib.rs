//! Hosting: devices by name from configuration files, and robots made of several of them.
//!
//! * [`device_types`]: the table of devices. A new one is one line there.
//! * [`Hosted`]: a device that is open: what it offers to others, and what it can attach to.
//! * [`open`], [`open_wrapped`]: a device from its parameters, as stock's `yarpdev` opens one.
//! * [`robot`]: descriptions of robots in XML and TOML, and the phases of their lives, as stock's
//!   `yarprobotinterface` runs them.
//!
//! A parameter that is missing or wrong is an error with file and line, and says what was expected.

mod device_bundle;
pub mod device_types;
mod error;
mod hosted_device;
mod park_device;
pub mod robot;

pub use device_bundle::{open, open_wrapped};
pub use error::HostError;
pub use hosted_device::{Attached, Future, Hosted, Parts};
pub use park_device::park;
