//! Torques of the joints, and the motion that results from them.
//!
//! * [`Body`]: mass, centre of mass and inertia of a link or a load.
//! * [`Dynamics`]: inverse dynamics by the recursive Newton-Euler method, mass matrix, gravity, energy, and
//!   forward dynamics.
//! * [`GravityCalibration`]: gravity compensation from moments measured on an arm, as libbarrett does it.
//!
//! * [`HeldPose`]: a measurement for such a calibration.
//!
//! Metres, kilograms, radians, seconds and newtons; nothing allocates but the fit of a calibration, no clock, no friction: that is
//! [`simulation`](crate::simulation).

mod gravity_calibration;
mod gravity_fit;
mod newton_euler;
mod rigid_body;

pub use gravity_calibration::GravityCalibration;
pub use gravity_fit::HeldPose;
pub use newton_euler::{Dynamics, MassMatrix};
pub use rigid_body::Body;
