//! The seven-joint WAM arm.
//!
//! [`WamModel`] holds what the arm is built like. [`SimulatedWam`] and [`DynamicWam`] need no hardware: the first moves exactly
//! as it is told, the second has masses, friction, motors and a controller. [`can::CanWam`] is a real arm on its bus. The
//! last two have the same control: [`ArmControl`].

mod arm_control;
mod arm_device;
mod arm_device_forces;
mod arm_device_motors;
mod arm_device_upkeep;
pub mod can;
mod dynamic;
mod dynamic_arm;
mod dynamic_variables;
mod model;
mod motors;
pub(crate) mod pace;
mod parameters;
mod simulated;
mod transmission;
pub mod units;
mod variables;

pub(crate) use arm_control::UNITS_PER_AMPERE;
pub use arm_control::{ArmControl, Trouble};
pub use arm_device::{ArmDevice, SteeredArm};
pub use dynamic::DynamicWam;
pub use dynamic_arm::DynamicArm;
pub use model::{Friction, Motor, WamModel};
pub use parameters::{AXES, parameters};
pub use simulated::SimulatedWam;
pub use transmission::{MAGNETIC_COUNTS, OPTICAL_COUNTS, Transmission};
