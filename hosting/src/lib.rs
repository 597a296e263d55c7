//! Hosting: opens devices by name from configuration files, and robots made of several devices.
//!
//! * [`device_types`]: the table of device types. A new one is one line there.
//! * [`Hosted`]: an open device, with the parts it offers to others and what it can attach to.
//! * [`open`], [`open_wrapped`]: open a device from its parameters, like stock's `yarpdev`.
//! * [`robot`]: descriptions of robots in XML and TOML, and the phases of a robot's life, like
//!   stock's `yarprobotinterface`.
//!
//! A missing or invalid parameter is an error with file and line, and with the expected value.

mod arm_configuration;
mod device_bundle;
pub mod device_types;
mod error;
mod hosted_device;
mod park_device;
pub mod robot;
mod simulator_configuration;

pub use arm_configuration::ArmConfiguration;
pub use device_bundle::{open, open_wrapped, opened_types};
pub use error::HostError;
pub use hosted_device::{Attached, Future, Hosted, Parts};
pub use park_device::park;
