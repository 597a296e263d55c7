//! A controller of the tool of an arm, for any arm that follows positions.
//!
//! Does in essence what iCub's controller does, on the kinematics of this crate:
//!
//! 1. A target becomes joints: damped least squares from the present joints; an unused joint is fixed, the
//!    a rest posture uses the freedom that the target leaves. **Out of reach**: the nearest pose that is found; where
//!    only the whole pose is, what has priority is reached and the rest is as near as the search left it.
//! 2. The tool goes there on a straight line, turning the shortest way, with the time law of minimum jerk. A new target
//!    takes over from the old one with its velocity and acceleration.
//!    A motion that would turn a joint by more than 0.5 rad for each 5 cm of its way is refused, and so is a step of up
//!    to 5 cm that the tool cannot make straight, unless
//!    [`allow_posture_changes`](CartesianOptions::allow_posture_changes).
//! 3. Each period the next pose becomes joints, searched near a way of the joints to the same end, no joint faster than
//!    its limit: where the line leaves the workspace, or a joint is too slow, the tool leaves the line and still
//!    arrives, later if needed.
//! 4. Neither tool nor elbow is sent faster than [`MAX_TOOL_SPEED`](crate::trajectory::MAX_TOOL_SPEED), however short the
//!    time that was asked for: beyond that the arm's safety module warns, and at twice that it takes the power off.
//! 5. The motion waits for an arm that lags, on the line; an arm at rest that does not follow ends the motion.
//!
//! **Invariant:** a motion ends for good when a joint is set to another mode, has a fault, or cannot be read or
//! commanded; nothing resumes it. Changes of settings apply from the next target on; a held target is approached
//! again.
//!
//! | file | content |
//! | --- | --- |
//! | `arm_adapter` | the device, in rad |
//! | `pose_conversion` | poses of the interface, checked |
//! | `minimum_jerk_path` | the line and its time law |
//! | `cartesian_settings` | settings; joints for a target |
//! | `tool_motion` | the motion in progress |
//! | `cartesian_controller` | commands, and the thread that executes them |
//! | `controller_interface` | the interface of the controller |

mod arm_adapter;
mod cartesian_controller;
mod cartesian_settings;
mod controller_interface;
mod minimum_jerk_path;
mod pose_conversion;
mod tool_motion;

pub use cartesian_controller::{CartesianController, CartesianOptions};
