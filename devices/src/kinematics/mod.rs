//! Forward and inverse kinematics of the arm.
//!
//! * [`Chain`]: links, joint limits and a tool; forward kinematics and the Jacobian.
//! * [`Solver`]: inverse kinematics for use, by damped least squares.
//! * [`JacobianTranspose`]: inverse kinematics as the thesis describes it, to compare with.
//! * [`EulerXyz`]: orientations as three angles, in the thesis's convention.
//!
//! Everything here is pure mathematics in metres, **radians** and seconds, and nothing allocates; degrees are
//! for the device interfaces, and [`wam::units`](crate::wam::wam_units) is the border.

mod damped_least_squares;
mod euler_angles;
mod jacobian_transpose;
mod kinematic_chain;
mod rotation_vector;
mod task_space;

pub use damped_least_squares::{Redundancy, Solution, Solver, SolverOptions, Unsolved};
pub use euler_angles::EulerXyz;
pub use jacobian_transpose::JacobianTranspose;
pub use kinematic_chain::{Chain, DhRow, Jacobian, Joints, Pose};
pub use rotation_vector::rotation_vector;
pub use task_space::Task;
pub(crate) use task_space::distances;
