//! The seven-joint WAM arm.
//!
//! [`parameters`] holds what the arm is built like, [`SimulatedWam`] is one that needs no hardware.

mod motors;
mod parameters;
mod simulated;

pub use parameters::{AXES, parameters};
pub use simulated::SimulatedWam;
