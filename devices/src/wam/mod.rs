//! The seven-joint WAM arm.
//!
//! [`WamModel`] holds what the arm is built like. [`SimulatedWam`] and [`DynamicWam`] need no hardware: the first moves exactly
//! as it is told, the second has masses, friction, motors and a controller.

mod dynamic;
mod dynamic_arm;
mod dynamic_motors;
mod model;
mod motors;
mod parameters;
mod simulated;
mod transmission;
pub mod units;

pub use dynamic::DynamicWam;
pub use dynamic_arm::DynamicArm;
pub use model::{Friction, Motor, WamModel};
pub use parameters::{AXES, parameters};
pub use simulated::SimulatedWam;
pub use transmission::{MAGNETIC_COUNTS, OPTICAL_COUNTS, Transmission};
