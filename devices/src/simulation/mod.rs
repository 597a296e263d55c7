//! The arm as a machine: torques in, encoder counts out.
//!
//! * [`Simulator`]: motors, friction, stops, outside forces, encoders and the [`SafetyModule`], stepped
//!   by its owner at the control rate.
//! * [`Controller`]: joint PID with gravity compensation, from counts to torques.
//! * [`SimulatedPucks`]: the same arm as its computer sees it, at the end of a CAN bus.
//! * [`Arm`]: both in a loop, with synchronised joint moves and straight lines of the tool.
//!
//! Nothing here has a clock or a thread: the same steps with the same seed give the same numbers, as fast as the
//! machine allows. [`DynamicWam`](crate::wam::DynamicWam) runs it in real time. Units are those of
//! [`kinematics`](crate::kinematics).

mod arm;
mod controller;
mod pid;
mod plant;
mod pucks;
mod safety;
mod simulator;
mod warmth;

pub use arm::{Arm, MoveRefused};
pub use controller::{Controller, Order};
pub use pid::{Gains, Pid};
pub use pucks::{SimulatedPucks, serve_pucks};
pub use safety::{Fault, SafetyLimits, SafetyMode, SafetyModule};
pub use simulator::{Simulator, SimulatorOptions};
pub(crate) use warmth::{AT_REST, HOT, SUPPLY};
