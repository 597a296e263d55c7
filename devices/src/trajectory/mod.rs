//! Paths of a whole arm, from rest to rest with a trapezoid in speed.
//!
//! * [`Synchronised`]: all joints begin and end together, each in proportion to its way.
//! * [`Line`]: the tool goes straight and turns evenly; planned completely before it begins.
//!
//! Units are those of [`kinematics`](crate::kinematics).

mod line;
mod synchronised;

pub use line::{Line, LineOptions, LineRefused, MAX_TOOL_SPEED};
pub use synchronised::{JointLimits, Synchronised};
