//! Paths of a whole arm, from rest to rest with a trapezoid in speed.
//!
//! * [`SynchronisedMove`]: all joints begin and end together, each in proportion to its way.
//! * [`StraightLine`]: the tool goes straight and turns evenly; planned completely before it begins.
//!
//! Units are those of [`kinematics`](crate::kinematics).

mod straight_line;
mod synchronised_joints;

pub use straight_line::{MAX_TOOL_SPEED, StraightLine, StraightLineError, StraightLineOptions};
pub use synchronised_joints::{JointLimits, SynchronisedMove};
