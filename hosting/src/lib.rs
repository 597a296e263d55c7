//! Hosting: opens devices by name from configuration files, and robots made of several devices.
//!
//! * [`device_types`]: the table of device types. A new one is one line there.
//! * [`Hosted`]: an open device, with the parts it offers to others and what it can attach to.
//! * [`open`], [`open_wrapped`]: open a device from its parameters, like stock's `yarpdev`.
//! * [`RunningService`]: the service of a device, started, updated and stopped.
//! * [`robot`]: descriptions of robots in XML and TOML, and the phases of a robot's life, like
//!   stock's `yarprobotinterface`.
//! * [`application`]: files of stock's `yarpmanager`: programs and connections.
//!
//! A missing or invalid parameter is an error with file and line, and with the expected value.

pub mod application;
mod arm_configuration;
mod configured_arm;
mod device_bundle;
pub mod device_types;
mod error;
mod hosted_device;
mod park_device;
pub mod robot;
mod service_runner;
mod shared_parameters;
mod simulator_configuration;
mod text_file;
mod tolerant_xml;

pub use arm_configuration::ArmConfiguration;
pub use configured_arm::{ArmKind, ConfiguredArm};
pub use device_bundle::{open, open_wrapped, opened_types};
pub use error::HostError;
pub use hosted_device::{Attached, Future, Hosted, Parts};
pub use park_device::park;
pub use service_runner::RunningService;
