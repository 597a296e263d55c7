//! Ports and remote devices for robot programs on a YARP network.
//!
//! ```no_run
//! use std::time::Duration;
//! use yarp_client::prelude::*;
//!
//! fn main() -> Result<()> {
//!     let arm = Robot::connect("/wam")?;
//!     let elbow = Axes::One(3.into());
//!     arm.set_reference_speeds(elbow, &[20.0])?; // deg/s
//!     arm.position_move(elbow, &[120.0])?; // deg
//!     let done = arm.wait_motion_done(elbow, Duration::from_secs(10))?;
//!     println!("{done}: {:?}", arm.positions()?);
//!     Ok(())
//! }
//! ```
//!
//! | type | use |
//! | --- | --- |
//! | [`Publisher`], [`Subscriber`], [`CallbackSubscriber`] | messages one way |
//! | [`RpcClient`], [`RpcServer`] | requests and replies |
//! | [`Robot`], [`Hand`], [`CartesianTool`], [`Camera`] | remote devices, with the interfaces of [`yarp_devices`] |
//! | [`module::Module`] | a program with a name, parameters, an RPC port and a periodic update |
//! | [`time`] | the time of the machine, or of the clock that `YARP_CLOCK` names |
//! | [`RemoteClock`] | another clock, such as that of a simulator |
//! | [`Message`] (derive), [`bottle!`] | typed and untyped messages |
//! | [`asynchronous`] | the same for programs that run on tokio |
//!
//! Calls block and have timeouts; no asynchronous code is needed. Everything else of the layers below is in [`ports`],
//! [`wire`], [`devices`] and [`wrappers`].

pub mod asynchronous;
mod camera;
mod cartesian_tool;
mod error;
mod local_name;
mod message_bounds;
pub mod module;
pub mod prelude;
mod publisher;
mod received;
mod remote_clock;
mod robot;
mod robot_hand;
mod rpc;
mod subscriber;
pub mod time;

use std::time::Duration;

pub use camera::Camera;
pub use cartesian_tool::CartesianTool;
pub use error::{Error, Result};
pub use message_bounds::{Reply, Request};
pub use publisher::Publisher;
pub use received::Received;
pub use remote_clock::RemoteClock;
pub use robot::Robot;
pub use robot_hand::Hand;
pub use rpc::{RpcClient, RpcServer};
pub use subscriber::{CallbackSubscriber, Messages, Subscriber};

pub use yarp_client_derive::Message;
pub use yarp_devices as devices;
pub use yarp_devices::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointType, Limits, Mode, MotionControl, PositionControl, VelocityControl,
};
pub use yarp_ports as ports;
pub use yarp_ports::blocking::Port;
pub use yarp_ports::{Network, PortError, PortOptions, Queue};
pub use yarp_wire as wire;
pub use yarp_wire::{Bottle, Stamp, Value, bottle};
pub use yarp_wrappers as wrappers;
pub use yarp_wrappers::{OpenError, RemoteControlBoard, RemoteControlBoardOptions};

/// Maximum number of messages that a reader may be behind before a publisher skips it.
const MAX_BACKLOG: usize = 16;
/// Default timeout of a call.
const RPC_TIMEOUT: Duration = Duration::from_secs(5);
/// Interval between two reads of something that is waited for.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// Compiles the example of the project's README.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct ProjectReadme;
