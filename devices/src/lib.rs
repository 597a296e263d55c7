//! Device interfaces and devices: the simulated WAM arm, a simulated camera.
//!
//! * [`iface`]: one trait per device interface, with its contract.
//! * [`Device`]: which of the interfaces a device has.
//! * [`can`]: the CAN bus, and the frames of Barrett's pucks.
//! * [`fake`]: simulated axes, as pure models without clock or thread.
//! * [`wam`]: the WAM arm: simulated, ideal or with masses, friction and control; or real, over CAN.
//! * [`kinematics`], [`dynamics`], [`trajectory`], [`simulation`]: the mathematics of an arm, in radians.
//! * [`hand`]: the BarrettHand on its serial line, and a simulated one at the other end of such a line.
//! * [`cartesian`]: a controller of the tool of any such arm.
//! * [`image`], [`camera`]: images, and a camera that shows test patterns or files.
//! * [`embedded`]: the arm behind its embedded PC, driver and server.
//! * [`remapper`]: several devices seen as one control board, or a part of one.
//! * [`sensors`]: simulated sensors of an arm, and sensors of several devices as one.
//! * [`services`]: devices that pass images and sound on, or stand for several.
//! * [`guard`]: limits and a watchdog around any device.
//! * [`clock`]: the time of day. [`pseudo_random`]: numbers that are the same for the same seed.
//!   [`periodic_timer`]: deadlines at equal distances.
//! * [`checks`]: behaviours that every device with these interfaces must show.
//!
//! Values are degrees, deg/s and deg/s² for revolute joints, metres, m/s and m/s² for prismatic ones:
//! the convention of the stock interfaces. No radians cross an interface but [`CartesianControl`] and [`GazeControl`];
//! [`wam::wam_units`] is the border. Sockets and buses are known only where a device is behind one.
//!
//! | feature | content |
//! | --- | --- |
//! | `barrett` | [`wam`], [`embedded`], [`can`], the drivers and simulations of [`hand`], and the mathematics of an arm |
//! | `image-files` | PNG and JPEG images for [`camera`], besides PPM and PGM |
//! | `v4l2` | cameras of a Linux machine for [`camera`] |
//! | `dc1394` | IIDC cameras on IEEE 1394 and USB for [`camera`], with the system's libdc1394 |
//!
//! No feature is on by default: then this crate is the interfaces, [`Device`], [`checks`], [`guard`], [`remapper`], and
//! the simulated devices of [`fake`] and [`camera`].
//!
//! ```
//! use yarp_devices::wam::SimulatedWam;
//! use yarp_devices::{Axes, AxisIndex, Device};
//!
//! # fn main() -> Result<(), yarp_devices::DeviceError> {
//! let arm = SimulatedWam::new();
//! let elbow = Axes::One(AxisIndex::from(3));
//! let board = arm.position_control().expect("the arm moves point to point");
//! board.position_move(elbow, &[170.0])?;
//! assert_eq!(board.target_positions(elbow)?, [170.0]);
//! # Ok(())
//! # }
//! ```

mod axes;
pub mod camera;
#[cfg(feature = "barrett")]
pub mod can;
#[cfg(feature = "barrett")]
pub mod cartesian;
pub mod checks;
pub mod clock;
mod device;
#[cfg(feature = "barrett")]
pub mod dynamics;
#[cfg(feature = "barrett")]
pub mod embedded;
mod error;
pub mod fake;
pub mod guard;
pub mod hand;
pub mod iface;
pub mod image;
mod imu_layout;
#[cfg(feature = "barrett")]
mod inheriting_mutex;
#[cfg(feature = "barrett")]
pub mod kinematics;
pub mod periodic_timer;
pub mod pseudo_random;
#[cfg(all(feature = "barrett", target_os = "linux"))]
pub mod real_time;
pub mod remapper;
#[cfg(feature = "barrett")]
pub mod sensors;
pub mod services;
#[cfg(feature = "barrett")]
pub mod simulation;
#[cfg(feature = "barrett")]
pub mod trajectory;
#[cfg(feature = "barrett")]
pub mod wam;

pub use axes::{Axes, AxisIndex};
pub use device::Device;
pub use error::DeviceError;
pub use iface::*;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
