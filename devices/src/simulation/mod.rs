//! The arm as a machine: torques in, encoder counts out.
//!
//! * [`Simulator`]: motors, friction, stops, outside forces, encoders and the [`SafetyModule`], stepped
//!   by its owner at the control rate; with the [`ArmEffects`] of a real arm, if its options have them.
//! * [`JointControllers`]: joint PID with gravity compensation, from counts to torques.
//! * [`SimulatedPucks`]: the same arm as its computer sees it, at the end of a CAN bus.
//! * [`SimulatedArm`]: both in a loop, with synchronised joint moves and straight lines of the tool.
//!
//! Nothing here has a clock or a thread: the same steps with the same seed give the same numbers, as fast as the
//! machine allows. [`DynamicWam`](crate::wam::DynamicWam) runs it in real time. Units are those of
//! [`kinematics`](crate::kinematics).

mod arm_effects;
mod arm_mechanics;
mod command_delay;
mod controlled_arm;
mod elastic_cables;
mod joint_controllers;
mod joint_pid;
mod motor_windings;
mod pucks;
mod safety_module;
mod simulator;
mod thermal;

pub use arm_effects::{
    ArmEffects, CableElasticity, CommandLatency, Stiction, TorqueVariation, Winding,
};
pub use controlled_arm::{MoveError, SimulatedArm};
pub use joint_controllers::{JointCommand, JointControllers};
pub use joint_pid::{Gains, Pid};
pub use pucks::{SimulatedPucks, WakeUp, serve_pucks};
pub use safety_module::{
    Fault, SafetyLimits, SafetyMode, SafetyModule, SafetyWarnings, VoltageLimits,
};
pub use simulator::{Simulator, SimulatorOptions};
pub(crate) use thermal::{MAX_TEMPERATURE, REST_TEMPERATURE, SUPPLY_VOLTAGE};
