//! The WAM arm, with four or with seven joints.
//!
//! [`WamModel`] holds the parameters of the arm. [`SimulatedWam`] and [`DynamicWam`] need no hardware: the first
//! moves exactly as commanded, the second has masses, friction, motors and a controller. [`can::CanWam`] is a real
//! arm on its bus. The last two have the same control: [`ArmControl`]. [`SimulatedCanWam`] is the driver of the bus with a
//! simulated arm at its other end.

mod arm_control;
mod arm_device;
mod arm_device_forces;
mod arm_device_maintenance;
mod arm_device_motors;
mod arm_variables;
mod axis_parameters;
pub mod can;
mod dynamic_arm;
mod dynamic_variables;
mod dynamic_wam;
mod gravity_procedure;
mod simulated_can_wam;
mod simulated_wam;
mod simulated_wam_motors;
mod transmission;
mod wam_model;
pub mod wam_units;

pub(crate) use arm_control::UNITS_PER_AMPERE;
pub use arm_control::{ArmControl, ArmError};
pub use arm_device::{ArmDevice, ControlledArm, count_word};
pub use axis_parameters::{AXES, parameters, parameters_of};
pub use dynamic_arm::DynamicArm;
pub use dynamic_wam::DynamicWam;
pub use gravity_procedure::{GravityResult, MeasuredArm, calibrate_gravity, gravity_poses};
pub use simulated_can_wam::{PendantButton, SimulatedCanWam};
pub use simulated_wam::SimulatedWam;
pub use transmission::{MAGNETIC_COUNTS, OPTICAL_COUNTS, Transmission};
pub use wam_model::{Friction, Motor, StallLimits, WamModel};
