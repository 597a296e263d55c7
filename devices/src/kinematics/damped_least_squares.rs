//! Inverse kinematics by damped least squares.

use nalgebra::{Matrix6, SMatrix, Vector6};

use super::task_space::distances;
use super::{Chain, Jacobian, Joints, Pose, Task};
use crate::pseudo_random::Random;

/// Weight of a rotation of one rad relative to a distance of one metre: about the size of the arm's wrist and
/// forearm, so that neither dominates the other.
const METRES_PER_RADIAN: f64 = 0.3;
/// Damping that stays when the error vanishes: below the square of a tenth of a per mille, hardly felt, and enough
/// that the matrix of a singular pose is inverted safely.
const MIN_DAMPING: f64 = 1e-9;
/// Fraction of the error that must disappear within [`STALL_WINDOW`] iterations, or the attempt is given up.
const MIN_STALL_PROGRESS: f64 = 0.7;
/// See [`MIN_STALL_PROGRESS`].
const STALL_WINDOW: usize = 6;
/// The damping of the projector that moves joints without the tool.
const PROJECTOR_DAMPING: f64 = 1e-8;

/// Use of the freedom that a target leaves: seven joints have one freedom more than a pose needs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Redundancy<const N: usize> {
    /// Not used: the solution is near the start if there is one near it.
    #[default]
    Free,
    /// Joints stay away from their limits, towards the middle of their ranges.
    AwayFromLimits,
    /// Joints stay near these angles, rad.
    Near(Joints<N>),
    /// Each joint is drawn to an angle, rad, according to its weight, 0 for not at all.
    PreferPosture {
        /// To where, rad.
        to: Joints<N>,
        /// Weight, 0 or more.
        weights: Joints<N>,
    },
}

/// Task, tolerances and limits of a [`Solver`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions<const N: usize> {
    /// The task.
    pub task: Task,
    /// Tolerance of the position, m.
    pub position_tolerance: f64,
    /// Tolerance of the orientation, rad.
    pub angle_tolerance: f64,
    /// The most iterations from one start.
    pub iterations: usize,
    /// The most starts: the given one, then random ones. 1 for a solution near the start or none.
    pub attempts: usize,
    /// Use of the remaining freedom.
    pub redundancy: Redundancy<N>,
    /// Seed of the random starts: the same seed gives the same solutions.
    pub seed: u64,
}

/// A micrometre, a microradian, 60 iterations from each of up to 100 starts.
impl<const N: usize> Default for SolverOptions<N> {
    fn default() -> Self {
        Self {
            task: Task::Pose,
            position_tolerance: 1e-6,
            angle_tolerance: 1e-6,
            iterations: 60,
            attempts: 100,
            redundancy: Redundancy::Free,
            seed: 0,
        }
    }
}

/// Joint angles that solve a task.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution<const N: usize> {
    /// The angles, rad, inside the limits.
    pub joints: Joints<N>,
    /// Error of the position, m.
    pub position_error: f64,
    /// Error of the orientation, rad; 0 if the task does not include it.
    pub angle_error: f64,
    /// Number of iterations of all attempts together.
    pub iterations: usize,
    /// Number of starts tried.
    pub attempts: usize,
}

/// No joint angles were found: the target is out of reach, or hard to find.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "no joint angles found for the pose: the nearest of {} attempts stays {:.1} mm and {:.2} degrees away",
    nearest.attempts,
    nearest.position_error * 1e3,
    nearest.angle_error.to_degrees()
)]
pub struct Unsolved<const N: usize> {
    /// The best that was found.
    pub nearest: Solution<N>,
}

/// Inverse kinematics by damped least squares, with joint limits, redundancy and restarts.
///
/// Each iteration solves `(Jᵀ W J + λ) Δq = Jᵀ W e` with a damping λ that is the weighted error itself: large far
/// away and at targets out of reach, vanishing at the solution, where convergence is quadratic (the
/// Levenberg-Marquardt form of T. Sugihara, *Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt
/// method*, IEEE Transactions on Robotics 27, 2011). A joint that would pass its limit is fixed at it and taken out
/// of the equation as long as it is pushed outward. When an attempt stalls, the next begins at random angles. Nothing
/// allocates.
///
/// ```
/// use yarp_devices::kinematics::{Joints, Solver};
/// use yarp_devices::wam::WamModel;
///
/// let arm = WamModel::<7>::new();
/// let target = arm.chain.forward(&Joints::<7>::from_column_slice(&[0.3, 0.6, 0.1, 1.2, -0.2, 0.4, 0.5]));
/// let solver = Solver::new(arm.chain);
/// let found = solver.solve(&target, &Joints::<7>::zeros()).unwrap();
/// assert!(found.position_error < 1e-6 && found.angle_error < 1e-6);
/// ```
#[derive(Clone, Debug)]
pub struct Solver<const N: usize> {
    chain: Chain<N>,
    options: SolverOptions<N>,
}

/// The state of one attempt.
struct Iterate<const N: usize> {
    joints: Joints<N>,
    error: Vector6<f64>,
    jacobian: Jacobian<N>,
}

impl<const N: usize> Solver<N> {
    /// A solver with the default options.
    pub fn new(chain: Chain<N>) -> Self {
        Self::with_options(chain, SolverOptions::default())
    }

    /// A solver with these options.
    pub fn with_options(chain: Chain<N>, options: SolverOptions<N>) -> Self {
        Self { chain, options }
    }

    /// The arm it solves for.
    pub fn chain(&self) -> &Chain<N> {
        &self.chain
    }

    /// Returns joint angles inside the limits that move the tool to `target`, tried first from `start`.
    ///
    /// Errors: [`Unsolved`] with the nearest that was found.
    pub fn solve(&self, target: &Pose, start: &Joints<N>) -> Result<Solution<N>, Unsolved<N>> {
        let found = self.solve_freely(target, start)?;
        Ok(self.resolve_redundancy(target, found, &self.options.redundancy))
    }

    /// Solves like [`solve`](Self::solve), with [`Redundancy::Near`] these angles.
    ///
    /// Errors: [`Unsolved`] with the nearest that was found.
    pub fn solve_near(
        &self,
        target: &Pose,
        start: &Joints<N>,
        posture: &Joints<N>,
    ) -> Result<Solution<N>, Unsolved<N>> {
        let found = self.solve_freely(target, start)?;
        Ok(self.resolve_redundancy(target, found, &Redundancy::Near(*posture)))
    }

    /// Solves without use of the remaining freedom.
    fn solve_freely(&self, target: &Pose, start: &Joints<N>) -> Result<Solution<N>, Unsolved<N>> {
        let mut random = Random::new(self.options.seed);
        let mut iterations = 0;
        let mut nearest: Option<(f64, Solution<N>)> = None;
        for attempt in 1..=self.options.attempts.max(1) {
            let joints = if attempt == 1 {
                self.chain.clamp(start)
            } else {
                Joints::from_fn(|joint, _| {
                    let limits = self.chain.limits()[joint];
                    random.between(limits.min, limits.max)
                })
            };
            let end = self.attempt(target, joints, &mut iterations);
            let (position_error, angle_error) = distances(&end.error);
            let solution = Solution {
                joints: end.joints,
                position_error,
                angle_error,
                iterations,
                attempts: attempt,
            };
            if self.is_solved(&end.error) {
                return Ok(solution);
            }
            let size = weighted(&end.error);
            if nearest.is_none_or(|(before, _)| size < before) {
                nearest = Some((size, solution));
            }
        }
        let (_, mut nearest) = nearest.expect("there was at least one attempt");
        (nearest.iterations, nearest.attempts) = (iterations, self.options.attempts.max(1));
        Err(Unsolved { nearest })
    }

    /// Returns the joint angles that turn no joint farther from `start` than necessary: the nearest among the solutions
    /// of all attempts, by the joint that turns farthest.
    ///
    /// Errors: [`Unsolved`] with the nearest that was found.
    pub fn solve_nearest(
        &self,
        target: &Pose,
        start: &Joints<N>,
    ) -> Result<Solution<N>, Unsolved<N>> {
        let options = SolverOptions {
            attempts: 1,
            ..self.options
        };
        let solver = Self::with_options(self.chain.clone(), options);
        let mut nearest = self.solve(target, start)?;
        let turned = |joints: &Joints<N>| (joints - start).abs().max();
        let mut random = Random::new(self.options.seed);
        for attempt in 2..=self.options.attempts.max(1) {
            // Starts spread around the present posture, wider with each attempt.
            let spread = attempt as f64 / self.options.attempts as f64;
            let guess = Joints::from_fn(|joint, _| {
                let limits = self.chain.limits()[joint];
                let anywhere = random.between(limits.min, limits.max);
                start[joint] + spread * (anywhere - start[joint])
            });
            if let Ok(found) = solver.solve(target, &guess)
                && turned(&found.joints) < turned(&nearest.joints)
            {
                nearest = found;
            }
        }
        Ok(nearest)
    }

    fn is_solved(&self, error: &Vector6<f64>) -> bool {
        let (position, angle) = distances(error);
        position <= self.options.position_tolerance && angle <= self.options.angle_tolerance
    }

    fn at(&self, target: &Pose, joints: Joints<N>) -> Iterate<N> {
        let (pose, jacobian) = self.chain.forward_and_jacobian(&joints);
        Iterate {
            joints,
            error: self.options.task.error(target, &pose),
            jacobian: self.options.task.select(jacobian),
        }
    }

    /// Iterates from `joints` until solved, stalled, or out of iterations.
    fn attempt(&self, target: &Pose, joints: Joints<N>, iterations: &mut usize) -> Iterate<N> {
        let mut now = self.at(target, joints);
        let mut size = weighted(&now.error);
        let mut milestone = size;
        for iteration in 1..=self.options.iterations {
            if self.is_solved(&now.error) {
                break;
            }
            *iterations += 1;
            let step = self.step(&now, size);
            now = self.at(target, self.chain.clamp(&(now.joints + step)));
            size = weighted(&now.error);
            if iteration % STALL_WINDOW == 0 {
                if size > MIN_STALL_PROGRESS * milestone {
                    break;
                }
                milestone = size;
            }
        }
        now
    }

    /// One damped step, joints at their limits held there as long as they are pushed outward.
    fn step(&self, now: &Iterate<N>, size: f64) -> Joints<N> {
        let weights = weights();
        let mut weighted_jacobian = now.jacobian;
        for (mut row, weight) in weighted_jacobian.row_iter_mut().zip(weights.iter()) {
            row *= *weight;
        }
        let pull = weighted_jacobian.transpose() * now.error;
        let mut system = weighted_jacobian.transpose() * now.jacobian;
        let mut right = pull;
        for joint in 0..N {
            system[(joint, joint)] += size + MIN_DAMPING;
            let limits = self.chain.limits()[joint];
            let angle = now.joints[joint];
            let pressed = (angle >= limits.max && pull[joint] > 0.0)
                || (angle <= limits.min && pull[joint] < 0.0);
            if pressed {
                system.row_mut(joint).fill(0.0);
                system.column_mut(joint).fill(0.0);
                system[(joint, joint)] = 1.0;
                right[joint] = 0.0;
            }
        }
        solve_positive(system, right).unwrap_or_else(Joints::zeros)
    }

    /// Moves the joints of a solution towards the preference while the tool stays; never makes it worse.
    fn resolve_redundancy(
        &self,
        target: &Pose,
        solution: Solution<N>,
        redundancy: &Redundancy<N>,
    ) -> Solution<N> {
        const STEPS: usize = 8;
        let (preferred, scale): (Joints<N>, Joints<N>) = match redundancy {
            Redundancy::Free => return solution,
            Redundancy::Near(joints) => (*joints, Joints::repeat(1.0)),
            Redundancy::PreferPosture { weights, .. } if weights.max() <= 0.0 => return solution,
            Redundancy::PreferPosture { to, weights } => {
                (*to, weights.map(|weight| weight.max(0.0).sqrt()))
            }
            Redundancy::AwayFromLimits => {
                let limits = self.chain.limits();
                (
                    Joints::from_fn(|joint, _| (limits[joint].min + limits[joint].max) / 2.0),
                    Joints::from_fn(|joint, _| 2.0 / (limits[joint].max - limits[joint].min)),
                )
            }
        };
        let scale = scale / scale.max();
        let distance = |joints: &Joints<N>| (joints - preferred).component_mul(&scale).norm();
        let mut best = solution;
        let mut rate = 0.5;
        for _ in 0..STEPS {
            let downhill =
                (preferred - best.joints).component_mul(&scale.component_mul(&scale)) * rate;
            match self.move_in_place(target, &best.joints, downhill) {
                Some(now) if distance(&now.joints) < distance(&best.joints) => {
                    (best.position_error, best.angle_error) = distances(&now.error);
                    best.joints = now.joints;
                }
                _ => rate /= 2.0,
            }
        }
        best
    }

    /// Moves the joints by what of `wish` leaves the tool alone, `(1 - J⁺ J) wish`, and makes good what a
    /// straight step on a curved way costs; `None` if that fails.
    fn move_in_place(
        &self,
        target: &Pose,
        joints: &Joints<N>,
        mut wish: Joints<N>,
    ) -> Option<Iterate<N>> {
        const CORRECTIONS: usize = 4;
        let mut now = self.at(target, *joints);
        for _ in 0..=CORRECTIONS {
            let system = now.jacobian * now.jacobian.transpose()
                + Matrix6::from_diagonal_element(PROJECTOR_DAMPING);
            let correction = system.cholesky()?.solve(&(now.error - now.jacobian * wish));
            let step = wish + now.jacobian.transpose() * correction;
            wish = Joints::zeros();
            now = self.at(target, self.chain.clamp(&(now.joints + step)));
            if self.is_solved(&now.error) {
                return Some(now);
            }
        }
        None
    }
}

fn weights() -> Vector6<f64> {
    let turn = METRES_PER_RADIAN * METRES_PER_RADIAN;
    Vector6::new(1.0, 1.0, 1.0, turn, turn, turn)
}

/// Half the weighted square of an error, m².
fn weighted(error: &Vector6<f64>) -> f64 {
    error.component_mul(error).dot(&weights()) / 2.0
}

/// Solves a symmetric positive definite system.
fn solve_positive<const N: usize>(
    system: SMatrix<f64, N, N>,
    right: Joints<N>,
) -> Option<Joints<N>> {
    system.cholesky().map(|cholesky| cholesky.solve(&right))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Translation3, Vector3};

    use super::*;
    use crate::Limits;
    use crate::kinematics::DhRow;

    /// A link of 0.3 m, as long as the forearm of the arm between elbow and wrist (libbarrett: `d` of joint 5), turned to a place on
    /// one side and to an orientation as far on the other side: an error of a radian weighs as much as one of 0.3 m, so that
    /// it stays in the middle.
    #[test]
    fn out_of_reach_a_radian_weighs_as_much_as_the_length_of_the_forearm() {
        let row = DhRow {
            a: 0.3,
            alpha: 0.0,
            d: 0.0,
        };
        let chain = Chain::new([row], [Limits::new(-1.0, 1.0)]);
        let at = |angle: f64| Rotation3::new(Vector3::z() * angle);
        let place = at(0.01) * Vector3::new(0.3, 0.0, 0.0);
        let target = Pose::from_parts(Translation3::from(place), at(-0.01));
        let options = SolverOptions {
            attempts: 1,
            ..SolverOptions::default()
        };
        let solver = Solver::with_options(chain, options);
        let nearest = solver
            .solve(&target, &Joints::<1>::repeat(0.005))
            .expect_err("one joint cannot do both")
            .nearest;
        let angle = nearest.joints[0];
        assert!(angle.abs() < 5e-4, "{angle} rad");
    }
}
