//! The seven-joint WAM arm.
//!
//! [`parameters`] holds what the arm is built like, [`SimulatedWam`] is one that needs no hardware.

mod model;
mod parameters;
mod simulated;
mod transmission;
pub mod units;

pub use model::{Friction, Motor, WamModel};
pub use parameters::{AXES, parameters};
pub use simulated::SimulatedWam;
pub use transmission::{MAGNETIC_COUNTS, OPTICAL_COUNTS, Transmission};
