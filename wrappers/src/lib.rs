//! Network wrappers: devices served on ports, and remote devices cast back.
//!
//! For each interface there is a server, which offers a device of [`yarp_devices`] on the ports that stock clients
//! expect, and a client, which is that device again in another program. Both support YARP 3.5 to 3.12 and 4.0: a
//! server both at once, a client the wire version of the server.
//!
//! * [`battery`]: batteries. [`BatteryServer`], [`RemoteBattery`].
//! * [`control_board`]: joints that move. [`ControlBoardServer`], [`RemoteControlBoard`].
//! * [`cartesian`]: tools that move in space. [`CartesianServer`], [`RemoteCartesianControl`].
//! * [`frame_grabber`]: cameras. [`FrameGrabberServer`], [`RemoteFrameGrabber`].
//! * [`gaze`]: gaze controllers of iCub. [`RemoteGazeControl`].
//! * [`analog_sensors`]: sensors of several kinds. [`AnalogSensorsServer`], [`RemoteAnalogSensors`].
//! * [`analog_sensor`]: one sensor of several channels, of YARP 3.x. [`AnalogSensorServer`], [`RemoteAnalogSensor`].
//! * [`inertial`]: an inertial sensor on one port, of YARP 3.x. [`InertialServer`].
//! * [`virtual_sensor`]: torques that another program computes. [`VirtualSensorServer`].
//! * [`hand`]: a hand as a whole, with grasps. [`HandServer`], [`RemoteHand`].
//! * [`network_time`]: the time of a clock on the network, for programs with `YARP_CLOCK`.
//! * [`software_stop`]: stops a device, whatever else is asked of it. [`StopServer`].
//! * [`thrift`]: calls of services as 4.0 puts them on the wire.
//!
//! Units are those of the interfaces: degrees and metres; radians for the orientation of a tool alone.

pub mod analog_sensor;
pub mod analog_sensors;
pub mod battery;
pub mod cartesian;
pub mod control_board;
mod device_ports;
mod first_value;
pub mod frame_grabber;
pub mod gaze;
pub mod hand;
pub mod inertial;
pub mod network_time;
mod open_ports;
mod page_request;
mod periodic_thread;
mod reconnect;
pub mod software_stop;
pub mod thrift;
pub mod virtual_sensor;

pub use analog_sensor::{
    AnalogSensorOptions, AnalogSensorServer, RemoteAnalogSensor, RemoteAnalogSensorOptions,
};
pub use analog_sensors::{
    AnalogSensorsOptions, AnalogSensorsServer, RemoteAnalogSensors, RemoteAnalogSensorsOptions,
};
pub use battery::{BatteryLayout, BatteryServer, BatteryServerOptions, RemoteBattery};
pub use cartesian::{
    CartesianServer, CartesianServerOptions, CartesianVersion, RemoteCartesianControl,
    RemoteCartesianOptions,
};
pub use control_board::{
    ControlBoardOptions, ControlBoardServer, OpenError, RemoteControlBoard,
    RemoteControlBoardOptions, RemoteMotion,
};
pub use device_ports::RemoteOptions;
pub use first_value::wait_first_value;
pub use frame_grabber::{
    FrameGrabberOptions, FrameGrabberServer, RemoteFrameGrabber, RemoteFrameGrabberOptions,
    SoundPort,
};
pub use gaze::{RemoteGazeControl, RemoteGazeOptions};
pub use hand::{HandServer, RemoteHand, RemoteHandOptions};
pub use inertial::{InertialOptions, InertialServer};
pub use software_stop::StopServer;
pub use virtual_sensor::{VirtualNetwork, VirtualSensorServer};

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
