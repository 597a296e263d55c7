//! Paths of a whole arm, from rest to rest with a trapezoid in speed.
//!
//! * [`SynchronisedMove`]: all joints begin and end together, each in proportion to its way.
//! * [`StraightLine`]: the tool goes straight and turns evenly; planned completely before it begins, and refused if it
//!   needs another posture.
//!
//! Units are those of [`kinematics`](crate::kinematics).

mod joint_travel;
mod straight_line;
mod synchronised_joints;

pub(crate) use joint_travel::largest_joint_change;
pub use joint_travel::{MAX_JOINT_CHANGE_PER_STEP, STEP_ANGLE, STEP_LENGTH};
pub use straight_line::{MAX_TOOL_SPEED, StraightLine, StraightLineError, StraightLineOptions};
pub use synchronised_joints::{JointLimits, SynchronisedMove};
