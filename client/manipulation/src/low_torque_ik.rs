//! Inverse kinematics that prefers postures with low gravity torques.

use yarp_devices::dynamics::Dynamics;
use yarp_devices::kinematics::{Joints, Pose, Solver, SolverOptions};
use yarp_devices::wam::WamModel;
use yarp_planning::CollisionModel;

/// Number of starts of the search for postures.
const STARTS: usize = 10;
/// Weight of the joint motion against the gravity torques: Nm per rad.
const MOTION_WEIGHT: f64 = 3.0;
/// Smallest distance from a joint limit, rad: controllers need room.
const LIMIT_MARGIN: f64 = 0.03;
/// Smallest manipulability `sqrt(det(J Jᵀ))` of a posture, m³ rad³: below it the arm cannot follow a straight line.
const MIN_MANIPULABILITY: f64 = 0.002;
/// Largest change of a joint between two points of a straight line, rad.
const MAX_LINE_STEP: f64 = 0.25;

/// An error of the inverse kinematics. Nothing has moved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PostureError {
    /// The pose is out of reach.
    #[error("the pose at ({x:.3}, {y:.3}, {z:.3}) m is out of reach: the nearest posture stays {distance:.3} m away", x = place[0], y = place[1], z = place[2])]
    Unreachable {
        /// Place of the hand, m.
        place: [f64; 3],
        /// Distance that remains, m.
        distance: f64,
    },
    /// Every posture is singular or at a joint limit.
    #[error("every posture for the pose at ({x:.3}, {y:.3}, {z:.3}) m is singular or at a joint limit", x = place[0], y = place[1], z = place[2])]
    Singular {
        /// Place of the hand, m.
        place: [f64; 3],
    },
    /// Every posture collides.
    #[error("every posture for the pose at ({x:.3}, {y:.3}, {z:.3}) m collides", x = place[0], y = place[1], z = place[2])]
    Collides {
        /// Place of the hand, m.
        place: [f64; 3],
    },
}

/// Inverse kinematics of the arm that chooses among several postures.
#[derive(Clone, Debug)]
pub struct PostureSolver {
    solver: Solver<7>,
    local: Solver<7>,
    dynamics: Dynamics<7>,
}

impl PostureSolver {
    /// Returns the solver for an arm, whose model includes the hand as a load.
    pub fn new(model: &WamModel<7>) -> Self {
        let options = SolverOptions {
            attempts: 1,
            position_tolerance: 1e-5,
            angle_tolerance: 1e-4,
            ..SolverOptions::default()
        };
        let local = Solver::with_options(model.chain.clone(), options);
        let all = SolverOptions {
            attempts: 20,
            ..options
        };
        Self {
            solver: Solver::with_options(model.chain.clone(), all),
            local,
            dynamics: model.dynamics(),
        }
    }

    /// Returns the norm of the gravity torques of a posture, Nm.
    pub fn gravity_torque(&self, joints: &Joints<7>) -> f64 {
        self.dynamics.gravity(joints).norm()
    }

    /// Returns free postures for a pose of the hand, that with the lowest gravity torques and motion from `near` first.
    ///
    /// Errors: [`PostureError`].
    pub fn postures(
        &self,
        target: &Pose,
        near: &Joints<7>,
        model: &CollisionModel,
    ) -> Result<Vec<Joints<7>>, PostureError> {
        let place: [f64; 3] = target.translation.vector.into();
        let mut found: Vec<Joints<7>> = Vec::new();
        let (mut singular, mut colliding) = (0, 0);
        let solved = match self.solver.solve(target, near) {
            Ok(solution) => solution.joints,
            Err(unsolved) => {
                return Err(PostureError::Unreachable {
                    place,
                    distance: unsolved.nearest.position_error,
                });
            }
        };
        let starts = std::iter::once(solved).chain((0..STARTS).map(|index| start(target, index)));
        for start in starts {
            let Ok(solution) = self.local.solve(target, &start) else {
                continue;
            };
            let joints = solution.joints;
            if found.iter().any(|other| (other - joints).amax() < 0.02) {
                continue;
            }
            if self.is_singular(&joints) {
                singular += 1;
            } else if model.is_free(&joints) {
                found.push(joints);
            } else {
                colliding += 1;
            }
        }
        if found.is_empty() {
            return Err(match colliding >= singular.min(1) && colliding > 0 {
                true => PostureError::Collides { place },
                false => PostureError::Singular { place },
            });
        }
        let cost = |joints: &Joints<7>| {
            self.gravity_torque(joints) + MOTION_WEIGHT * (joints - near).norm()
        };
        found.sort_by(|one, other| cost(one).total_cmp(&cost(other)));
        Ok(found)
    }

    /// Returns postures along a straight line of the hand from the pose of `from` to `target`, without `from`.
    ///
    /// `None` if the arm cannot follow the line.
    pub fn line(&self, from: &Joints<7>, target: &Pose, steps: usize) -> Option<Vec<Joints<7>>> {
        let begin = self.local.chain().forward(from);
        let turn = begin.rotation.inverse() * target.rotation;
        let mut postures = Vec::with_capacity(steps);
        let mut last = *from;
        for step in 1..=steps {
            let part = step as f64 / steps as f64;
            let place = begin
                .translation
                .vector
                .lerp(&target.translation.vector, part);
            let pose = Pose::from_parts(place.into(), begin.rotation * turn.powf(part));
            let joints = self.local.solve(&pose, &last).ok()?.joints;
            if (joints - last).amax() > MAX_LINE_STEP {
                return None;
            }
            last = joints;
            postures.push(joints);
        }
        Some(postures)
    }

    fn is_singular(&self, joints: &Joints<7>) -> bool {
        let chain = self.local.chain();
        let at_limit = (0..7).any(|joint| {
            let range = chain.limits()[joint];
            joints[joint] < range.min + LIMIT_MARGIN || joints[joint] > range.max - LIMIT_MARGIN
        });
        let (_, jacobian) = chain.forward_and_jacobian(joints);
        let square = (jacobian * jacobian.transpose()).determinant();
        at_limit || square.max(0.0).sqrt() < MIN_MANIPULABILITY
    }
}

/// Returns a start of the search: elbow up, at different angles of the upper arm about itself.
fn start(target: &Pose, index: usize) -> Joints<7> {
    let place = target.translation.vector;
    let towards = place.y.atan2(place.x);
    let twist = [0.0, 0.4, -0.4, 0.9, -0.9][index % 5];
    let wrist = if index < 5 { 0.0 } else { 2.2 };
    Joints::<7>::from([towards - 0.8 * twist, 0.6, twist, 2.0, 0.0, 0.5, wrist])
}
