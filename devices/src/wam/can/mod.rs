//! The WAM arm on its CAN bus.
//!
//! After libbarrett (`low_level_wam`, `puck_group`, `safety_module`) and Barrett's support wiki
//! (`WAM/CANbusSpecifications`, `WAM/SafetyFeaturesPrecautions`). A thread of its own:
//!
//! 1. `arm_startup.rs`: finds the pucks, wakes them, checks their roles and units, sets the limits of
//!    the safety module and writes the positions of the folded arm to the pucks;
//! 2. `control_cycle.rs`: every period queries the positions of all pucks at once and sends packed torques, which
//!    [`ArmControl`](super::ArmControl) computes; queries the safety module every few periods;
//! 3. `can_wam.rs`: when the bus or a puck fails, commands the safety module to brake the arm, names the failed step
//!    and the node, and reconnects.
//!
//! 4. `position_file.rs`: keeps the last known position in a file, with which the next start compares that of the pucks.
//!
//! No lock is held while waiting for the bus: calls of the device wait for the computation of a period at most.

mod arm_startup;
mod can_error;
mod can_options;
mod can_variables;
mod can_wam;
mod control_cycle;
mod position_file;
mod property_request;
mod puck_bus;
mod puck_health;
mod zero_calibration;

pub use can_error::{CanError, CanErrorKind, CanStep};
pub use can_options::CanOptions;
pub use can_wam::{CanArm, CanStatus, CanWam, OpenBus};
pub use zero_calibration::{CalibrationError, ZeroCalibration};

/// The position of the pucks when the driver last knew it.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
struct PositionRecord<const N: usize> {
    counts: [i32; N],
    /// Position minus absolute angle of the rotor, within a turn; `None` without an absolute encoder.
    origins: [Option<i32>; N],
}
