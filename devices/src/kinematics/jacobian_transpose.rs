//! Inverse kinematics with the transposed Jacobian, as in the thesis.

use super::task_space::distances;
use super::{Chain, Joints, Pose, Solution, Task, Unsolved};

/// The transposed Jacobian method of the thesis, section 3.1, equations 1 to 3.
///
/// Where `e = J Δθ` (1) is the required displacement, it steps by `Δθ = α Jᵀ e` (2) instead of `J⁻¹ e` (3), with the
/// α for which `J Δθ` is nearest to `e`: `α = <e, J Jᵀ e> / <J Jᵀ e, J Jᵀ e>`. No matrix is inverted, so singular
/// poses do no harm; but it is steepest descent and needs thousands of steps to be precise, and joint limits only cut
/// its steps short. [`Solver`](super::Solver) is the one for use.
///
/// ```
/// use yarp_devices::kinematics::{Joints, JacobianTranspose};
/// use yarp_devices::wam::WamModel;
///
/// let arm = WamModel::<7>::new().chain;
/// let target = arm.forward(&Joints::<7>::from_column_slice(&[0.3, 0.6, 0.1, 1.2, -0.2, 0.4, 0.5]));
/// let start = Joints::<7>::from_column_slice(&[0.2, 0.5, 0.0, 1.3, 0.0, 0.3, 0.4]);
/// let found = JacobianTranspose::default().solve(&arm, &target, &start).unwrap();
/// assert!(found.position_error < 1e-4);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct JacobianTranspose {
    /// The task.
    pub task: Task,
    /// Tolerance of the position, m.
    pub position_tolerance: f64,
    /// Tolerance of the orientation, rad.
    pub angle_tolerance: f64,
    /// The most steps.
    pub steps: usize,
}

/// 0.1 mm and 0.05 degrees, in at most 10 000 steps.
impl Default for JacobianTranspose {
    fn default() -> Self {
        Self {
            task: Task::Pose,
            position_tolerance: 1e-4,
            angle_tolerance: 0.05_f64.to_radians(),
            steps: 10_000,
        }
    }
}

impl JacobianTranspose {
    /// Returns joint angles near `start` that move the tool to `target`.
    ///
    /// Errors: [`Unsolved`] when the steps are used up.
    pub fn solve<const N: usize>(
        &self,
        chain: &Chain<N>,
        target: &Pose,
        start: &Joints<N>,
    ) -> Result<Solution<N>, Unsolved<N>> {
        let mut joints = chain.clamp(start);
        let mut iterations = 0;
        loop {
            let (pose, jacobian) = chain.forward_and_jacobian(&joints);
            let error = self.task.error(target, &pose);
            let (position_error, angle_error) = distances(&error);
            let solution = Solution {
                joints,
                position_error,
                angle_error,
                iterations,
                attempts: 1,
            };
            if position_error <= self.position_tolerance && angle_error <= self.angle_tolerance {
                return Ok(solution);
            }
            if iterations == self.steps {
                return Err(Unsolved { nearest: solution });
            }
            iterations += 1;
            let jacobian = self.task.select(jacobian);
            let pull = jacobian.transpose() * error;
            let effect = jacobian * pull;
            let alpha = error.dot(&effect) / effect.norm_squared();
            if !alpha.is_finite() {
                // No joint moves the tool that way.
                return Err(Unsolved { nearest: solution });
            }
            joints = chain.clamp(&(joints + pull * alpha));
        }
    }
}
