//! The user's crate: robots, ports and bottles.
//!
//! ```no_run
//! use std::time::Duration;
//! use yarp_client::{Axes, ControlMode, Mode, PositionControl, Robot};
//!
//! # fn main() -> Result<(), yarp_client::Error> {
//! let arm = Robot::connect("/wam")?;
//! let elbow = Axes::One(3.into());
//! arm.set_control_modes(elbow, &[Mode::Position])?;
//! arm.set_reference_speeds(elbow, &[20.0])?; // deg/s
//! arm.position_move(elbow, &[120.0])?; // deg
//! let arrived = arm.wait_motion_done(elbow, Duration::from_secs(10))?;
//! println!("{arrived}: {:?}", arm.positions()?);
//! # Ok(()) }
//! ```
//!
//! * [`Robot`]: a control board on the network, with the interfaces of [`yarp_devices`].
//! * [`Network`], [`Port`], [`PortOptions`]: ports with blocking calls; [`yarp_ports`] has the
//!   async ones.
//! * [`Bottle`], [`Value`]: messages between ports.

mod error;
mod robot;

pub use error::Error;
pub use robot::Robot;
pub use yarp_devices::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointType, Limits, Mode, MotionControl, PositionControl, VelocityControl,
};
pub use yarp_ports::blocking::Port;
pub use yarp_ports::{Network, PortError, PortOptions, Queue};
pub use yarp_wire::{Bottle, Value};
pub use yarp_wrappers::{OpenError, RemoteControlBoard, RemoteControlBoardOptions};

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// Compiles the example of the project's README.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct ProjectReadme;
