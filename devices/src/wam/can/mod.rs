//! The WAM arm on its CAN bus.
//!
//! After libbarrett (`low_level_wam`, `puck_group`, `safety_module`) and Barrett's support wiki
//! (`WAM/CANbusSpecifications`, `WAM/SafetyFeaturesPrecautions`). A thread of its own:
//!
//! 1. `arm_startup.rs`: finds the pucks, wakes them, checks what they are and in which units they speak, sets the limits of
//!    the safety module and tells the pucks where the folded arm stands;
//! 2. `control_cycle.rs`: every period asks all pucks at once where they are and sends packed torques, which
//!    [`ArmControl`](super::ArmControl) makes of it; asks the safety module every few periods;
//! 3. `can_wam.rs`: when the bus or a puck fails, has the safety module brake the arm, says which step failed and with
//!    whom, and begins again.
//!
//! What waits for the bus holds no lock: calls of the device wait for the mathematics of a period at most.

mod arm_startup;
mod can_error;
mod can_options;
mod can_variables;
mod can_wam;
mod control_cycle;
mod property_request;
mod puck_bus;

pub use can_error::{CanError, CanErrorKind, CanStep};
pub use can_options::CanOptions;
pub use can_wam::{CanArm, CanStatus, CanWam, OpenBus};
