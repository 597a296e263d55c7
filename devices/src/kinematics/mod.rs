//! Where the tool is, and how the joints must stand to bring it there.
//!
//! * [`Chain`]: links, joint limits and a tool; forward kinematics and the Jacobian.
//! * [`Solver`]: inverse kinematics for use, by damped least squares.
//! * [`TransposedJacobian`]: inverse kinematics as the thesis describes it, to compare with.
//! * [`EulerXyz`]: orientations as three angles, in the thesis's convention.
//!
//! Everything here is pure mathematics in metres, **radians** and seconds, and nothing allocates; degrees are
//! for the device interfaces, and [`wam::units`](crate::wam::units) is the border.

mod chain;
mod damped;
mod euler;
mod rotation;
mod task;
mod transposed;

pub use chain::{Chain, DhRow, Jacobian, Joints, Pose};
pub use damped::{Redundancy, Solution, Solver, SolverOptions, Unsolved};
pub use euler::EulerXyz;
pub use rotation::rotation_vector;
pub use task::Task;
pub(crate) use task::distances;
pub use transposed::TransposedJacobian;
