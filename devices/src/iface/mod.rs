//! The device interfaces, one file each: a trait and the values it speaks of.
//!
//! All traits are object safe, take `&self` and are meant to be called from several threads. Calls return
//! at once; a device behind a network may take as long as its own time-out, and says so. Values are in the
//! unit of the axis (degrees or metres, and per second). The stock overloads for one, several and all joints
//! are one method with an [`Axes`](crate::Axes) selector. A command for several joints is checked completely
//! before anything moves: all of it happens, or none.

mod axis_info;
mod control_limits;
mod control_mode;
mod encoders;
mod motion_control;
mod position_control;
mod velocity_control;

pub use axis_info::{AxisInfo, JointType};
pub use control_limits::{ControlLimits, Limits};
pub use control_mode::{ControlMode, Mode};
pub use encoders::{EncoderReading, Encoders};
pub use motion_control::MotionControl;
pub use position_control::PositionControl;
pub use velocity_control::VelocityControl;
