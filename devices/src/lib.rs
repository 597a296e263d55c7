//! Device interfaces and devices: the simulated WAM arm, a simulated camera.
//!
//! * [`iface`]: one trait per device interface, with its contract.
//! * [`Device`]: which of the interfaces a device has.
//! * [`can`]: the CAN bus, and the frames of Barrett's pucks.
//! * [`fake`]: simulated axes, as pure models without clock or thread.
//! * [`wam`]: the seven-joint WAM arm: simulated, ideal or with masses, friction and control; or real, over CAN.
//! * [`kinematics`], [`dynamics`], [`trajectory`], [`simulation`]: the mathematics of an arm, in radians.
//! * [`hand`]: the BarrettHand on its serial line, and a simulated one at the other end of such a line.
//! * [`cartesian`]: a controller of the tool of any such arm.
//! * [`image`], [`camera`]: images, and a camera that shows test patterns or files.
//! * [`embedded`]: the arm behind its embedded PC, driver and server.
//! * [`remapper`]: several devices seen as one control board, or a part of one.
//! * [`sensors`]: simulated sensors of an arm, and sensors of several devices as one.
//! * [`guard`]: limits and a watchdog around any device.
//! * [`clock`]: the time of day.
//! * [`checks`]: behaviours that every device with these interfaces must show.
//!
//! Values are degrees, deg/s and deg/s² for revolute joints, metres, m/s and m/s² for prismatic ones:
//! the convention of the stock interfaces. No radians cross an interface but [`CartesianControl`]; [`wam::units`] is the border. Sockets and
//! buses are known only where a device is behind one.
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
pub mod can;
pub mod cartesian;
pub mod checks;
pub mod clock;
mod device;
pub mod dynamics;
pub mod embedded;
mod error;
pub mod fake;
pub mod guard;
pub mod hand;
pub mod iface;
pub mod image;
pub mod kinematics;
mod pseudo_random;
pub mod remapper;
pub mod sensors;
pub mod simulation;
pub mod trajectory;
pub mod wam;

pub use axes::{Axes, AxisIndex};
pub use device::Device;
pub use error::DeviceError;
pub use iface::*;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
