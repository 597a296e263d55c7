//! Settings of a controller, which can be stored as a context.

use nalgebra::{Rotation3, Translation3};

use crate::kinematics::{
    Chain, Joints, Pose, Redundancy, Solution, Solver, SolverOptions, Task, distances,
    rotation_vector,
};
use crate::trajectory::{
    MAX_JOINT_CHANGE_PER_STEP, MAX_TOOL_SPEED, STEP_ANGLE, STEP_LENGTH, largest_joint_change,
};
use crate::{Limits, Priority};

/// Number of starts tried for a target, and for each step on the way to it.
const SOLVER_ATTEMPTS: usize = 30;
/// Stock's defaults: 2 s, and 1 cm.
const DEFAULT_TRAJECTORY_TIME: f64 = 2.0;
const DEFAULT_TOLERANCE: f64 = 0.01;

/// Distance (m) and rotation (rad) between two checked places of a line.
const WAYPOINT_DISTANCE: f64 = 0.005;
const WAYPOINT_ANGLE: f64 = 0.04;
/// Number of places between two such, on a step.
const STEP_RESOLUTION: f64 = 5.0;
/// Tolerance of the length of a step, because of rounding.
const STEP_TOLERANCE: f64 = 1.0 + 1e-6;
/// Change of a joint between two places of a line that counts as a jump to another posture, rad. An arm that bends from
/// its full length changes its elbow by 0.2 rad.
const MAX_WAYPOINT_CHANGE: f64 = 0.25;

/// A straight line of the tool that the joints can follow.
#[derive(Clone, Debug)]
pub(super) struct Way<const N: usize> {
    /// The joint positions at its end, rad.
    pub(super) joints: Joints<N>,
    /// The task that can be followed on the whole line.
    pub(super) task: Task,
    /// Minimum mean time for a step, s, in which every joint and every link keeps up: the whole line at the rate of its
    /// steepest part.
    /// 0 for a longer way, on which the tool may leave the line rather than wait for a joint.
    pub(super) time: f64,
    /// The joint positions along a step, evenly spaced from its start to its end, rad: the arm goes exactly there. None for
    /// a longer way.
    pub(super) places: Option<Vec<Joints<N>>>,
    /// Maximum change of a joint on a way of this length, rad.
    most: f64,
}

/// Reasons why the tool cannot go straight to a target in the posture that the arm has.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(super) enum WayError {
    #[error("the tool cannot go straight beyond {percent:.0} % of the way")]
    Blocked {
        percent: f64,
        /// Maximum change of a joint on a way of this length, rad.
        most: f64,
        /// A step of the tool, which is straight or not made at all.
        is_step: bool,
    },
    #[error(
        "joint {joint} would turn by {change:.2} rad, allowed are {most:.2} rad for a way of this length"
    )]
    PostureChange {
        joint: usize,
        change: f64,
        most: f64,
    },
}

impl WayError {
    /// Returns whether the arm may go to these joint positions although the tool cannot go straight: far targets only,
    /// and only as far as the posture is kept.
    pub(super) fn permits<const N: usize>(&self, start: &Joints<N>, goal: &Joints<N>) -> bool {
        match self {
            Self::Blocked { most, is_step, .. } => !is_step && (goal - start).abs().max() <= *most,
            Self::PostureChange { .. } => false,
        }
    }
}

/// Joint positions for a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach<const N: usize> {
    /// The joint positions, rad.
    pub(super) joints: Joints<N>,
    /// Distance (m) and angle (rad) by which they miss what has priority; none within the tolerance of arrival.
    pub(super) missed_by: Option<(f64, f64)>,
    /// True if the whole target is solved, not only what has priority.
    is_exact: bool,
}

impl<const N: usize> Reach<N> {
    fn exact(joints: Joints<N>) -> Self {
        Self {
            joints,
            missed_by: None,
            is_exact: true,
        }
    }
}

/// All settings, joints in rad.
#[derive(Clone, Debug)]
pub(super) struct Settings<const N: usize> {
    pub(super) tracking: bool,
    pub(super) reference: bool,
    pub(super) priority: Priority,
    pub(super) time: f64,
    pub(super) tolerance: f64,
    pub(super) dof: [bool; N],
    pub(super) rest: Joints<N>,
    pub(super) weights: Joints<N>,
    pub(super) limits: [Limits; N],
    pub(super) tip: Pose,
    pub(super) solver_tolerance: f64,
    pub(super) iterations: usize,
}

impl<const N: usize> Settings<N> {
    /// All joints are used, and drawn to the middle of their limits where the target leaves a choice, as iKin does by
    /// default.
    pub(super) fn new(limits: [Limits; N]) -> Self {
        let solver = SolverOptions::<N>::default();
        Self {
            tracking: false,
            reference: false,
            priority: Priority::default(),
            time: DEFAULT_TRAJECTORY_TIME,
            tolerance: DEFAULT_TOLERANCE,
            dof: [true; N],
            rest: Joints::from_fn(|joint, _| (limits[joint].min + limits[joint].max) / 2.0),
            weights: Joints::zeros(),
            limits,
            tip: Pose::identity(),
            solver_tolerance: solver.position_tolerance,
            iterations: solver.iterations,
        }
    }

    /// Returns the arm with its tip; unused joints are fixed at their present positions.
    pub(super) fn chain(&self, bare: &Chain<N>, stand: &Joints<N>) -> Chain<N> {
        let limits = std::array::from_fn(|joint| match self.dof[joint] {
            true => self.limits[joint],
            false => Limits::new(stand[joint], stand[joint]),
        });
        let tool = bare.tool() * self.tip;
        bare.clone().with_tool(tool).with_limits(limits)
    }

    fn solver(&self, chain: &Chain<N>, task: Task, attempts: usize, rest: bool) -> Solver<N> {
        let weights = Joints::from_fn(|joint, _| match self.dof[joint] && rest {
            true => self.weights[joint],
            false => 0.0,
        });
        let to = self.rest;
        Solver::with_options(
            chain.clone(),
            SolverOptions {
                task,
                attempts,
                position_tolerance: self.solver_tolerance,
                angle_tolerance: self.solver_tolerance,
                iterations: self.iterations,
                redundancy: Redundancy::PreferPosture { to, weights },
                ..SolverOptions::default()
            },
        )
    }

    /// Computes the joint positions for a target. Out of reach: what has priority as near as it gets, then the rest.
    pub(super) fn reach(
        &self,
        chain: &Chain<N>,
        target: &Pose,
        task: Task,
        start: &Joints<N>,
    ) -> Reach<N> {
        let nearest = match self
            .solver(chain, task, SOLVER_ATTEMPTS, true)
            .solve(target, start)
        {
            Ok(found) => return Reach::exact(found.joints),
            Err(unsolved) => unsolved.nearest,
        };
        let (first, joints) = match (task, self.priority) {
            (Task::Pose, Priority::Position) => (Task::Position, None),
            (Task::Pose, Priority::Orientation) => (Task::Orientation, None),
            _ => (task, Some(nearest.joints)),
        };
        let joints = joints.unwrap_or_else(|| {
            let found = self
                .solver(chain, first, SOLVER_ATTEMPTS, false)
                .solve(target, &nearest.joints);
            either(found.map_err(|unsolved| unsolved.nearest)).joints
        });
        let (distance, angle) = distances(&first.error(target, &chain.forward(&joints)));
        let is_missed = distance > self.tolerance || angle > self.tolerance;
        Reach {
            joints,
            missed_by: is_missed.then_some((distance, angle)),
            is_exact: false,
        }
    }

    /// Follows the straight line from `start` to `target` place by place, always to the joints nearest to those before.
    ///
    /// A pose that the arm cannot have continues with what has priority, as [`reach`](Self::reach) does. Without
    /// priority an arm of four joints would leave the line.
    pub(super) fn follow(
        &self,
        chain: &Chain<N>,
        target: &Pose,
        task: Task,
        start: &Joints<N>,
        max_velocities: &Joints<N>,
    ) -> Result<Way<N>, WayError> {
        let followed = self.follow_task(chain, target, task, start, max_velocities);
        if task != Task::Pose || !matches!(followed, Err(WayError::Blocked { .. })) {
            return followed;
        }
        let reach = self.reach(chain, target, task, start);
        if reach.is_exact {
            return followed;
        }
        let first = match self.priority {
            Priority::Position => Task::Position,
            Priority::Orientation => Task::Orientation,
        };
        let mut way = self.follow_task(chain, target, first, start, max_velocities)?;
        // The rest as near as it gets, unless that takes the tool off the line of a step.
        if way.places.is_none()
            && reach.missed_by.is_none()
            && (reach.joints - start).abs().max() <= way.most
        {
            way.joints = reach.joints;
        }
        Ok(way)
    }

    fn follow_task(
        &self,
        chain: &Chain<N>,
        target: &Pose,
        task: Task,
        start: &Joints<N>,
        max_velocities: &Joints<N>,
    ) -> Result<Way<N>, WayError> {
        let from = chain.forward(start);
        let way = target.translation.vector - from.translation.vector;
        let turn = rotation_vector(&(target.rotation * from.rotation.inverse()));
        let (distance, angle) = match task {
            Task::Pose => (way.norm(), turn.norm()),
            Task::Position => (way.norm(), 0.0),
            Task::Orientation => (0.0, turn.norm()),
        };
        let most = largest_joint_change(MAX_JOINT_CHANGE_PER_STEP, distance, angle);
        let is_step = distance <= STEP_LENGTH * STEP_TOLERANCE && angle <= STEP_ANGLE;
        let resolution = if is_step { STEP_RESOLUTION } else { 1.0 };
        let places = (distance / WAYPOINT_DISTANCE).max(angle / WAYPOINT_ANGLE) * resolution;
        let places = places.ceil().max(1.0);
        let mut kept = is_step.then(|| vec![*start]);
        let mut before = *start;
        let mut time = 0.0_f64;
        for place in 1..=places as usize {
            let share = place as f64 / places;
            let pose = Pose::from_parts(
                Translation3::from(from.translation.vector + way * share),
                Rotation3::new(turn * share) * from.rotation,
            );
            let (now, gets_there) = self.step(chain, &pose, task, &before);
            let steps = (now - before).abs();
            if !gets_there || steps.max() > MAX_WAYPOINT_CHANGE / resolution {
                return Err(WayError::Blocked {
                    percent: share * 100.0,
                    most,
                    is_step,
                });
            }
            let changes = (now - start).abs();
            let joint = changes.imax();
            let change = changes[joint];
            if change > most {
                return Err(WayError::PostureChange {
                    joint,
                    change,
                    most,
                });
            }
            for (step, speed) in steps.iter().zip(max_velocities.iter()) {
                if *speed > 0.0 {
                    time = time.max(step * places / speed);
                }
            }
            time = time.max(swept(chain, &before, &now) * places / MAX_TOOL_SPEED);
            if let Some(kept) = &mut kept {
                kept.push(now);
            }
            before = now;
        }
        let drawn = self.solver(chain, task, 1, true).solve(target, &before);
        let joints = match drawn {
            // The rest posture draws no farther than the way allows.
            Ok(drawn) if (drawn.joints - start).abs().max() <= most => drawn.joints,
            _ => before,
        };
        Ok(Way {
            joints,
            task,
            time: if is_step { time } else { 0.0 },
            places: kept,
            most,
        })
    }

    /// Returns the next step on a path: the joints nearest to `guess` that move the tool to `target`, or as near as
    /// possible; and whether it is reached.
    pub(super) fn step(
        &self,
        chain: &Chain<N>,
        target: &Pose,
        task: Task,
        guess: &Joints<N>,
    ) -> (Joints<N>, bool) {
        let found = self.solver(chain, task, 1, false).solve(target, guess);
        let gets_there = found.is_ok();
        let nearest = either(found.map_err(|unsolved| unsolved.nearest));
        (nearest.joints, gets_there)
    }
}

/// Returns the largest displacement of elbow, wrist or tool between two places, m.
pub(super) fn swept<const N: usize>(chain: &Chain<N>, one: &Joints<N>, other: &Joints<N>) -> f64 {
    let places = |joints: &Joints<N>| {
        let frames = chain.frames(joints);
        let tool = frames[N - 1] * chain.tool();
        (
            frames.map(|frame| frame.translation.vector),
            tool.translation.vector,
        )
    };
    let (before, after) = (places(one), places(other));
    let links = before.0.iter().zip(&after.0);
    let tool = (after.1 - before.1).norm();
    links
        .map(|(one, other)| (other - one).norm())
        .fold(tool, f64::max)
}

fn either<const N: usize>(found: Result<Solution<N>, Solution<N>>) -> Solution<N> {
    found.unwrap_or_else(|nearest| nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pseudo_random::Random;
    use crate::wam::WamModel;

    fn bent() -> Joints<7> {
        Joints::<7>::from_column_slice(&[0.3, 0.6, 0.1, 1.2, -0.2, 0.4, 0.5])
    }

    /// Returns the largest change of a joint between two places of a line of 5 mm apart, rad, if the solver follows it.
    fn largest_jump(
        settings: &Settings<7>,
        chain: &Chain<7>,
        start: &Joints<7>,
        way: nalgebra::Vector3<f64>,
    ) -> Option<f64> {
        let from = chain.forward(start);
        let places = (way.norm() / 0.005).ceil() as usize;
        let (mut before, mut largest) = (*start, 0.0_f64);
        for place in 1..=places {
            let mut pose = from;
            pose.translation.vector += way * (place as f64 / places as f64);
            let (now, gets_there) = settings.step(chain, &pose, Task::Pose, &before);
            if !gets_there || (now - start).abs().max() > 2.5 {
                return None;
            }
            largest = largest.max((now - before).abs().max());
            before = now;
        }
        Some(largest)
    }

    /// Past a singular pose the joints nearest to those before may be in another posture. A way of 0.3 m may turn joints by
    /// 3 rad in all, yet never by more than 0.25 rad between two places.
    #[test]
    fn a_jump_between_two_places_of_a_line_blocks_it() {
        let arm = WamModel::<7>::new().chain;
        let settings = Settings::new(*arm.limits());
        let fast = Joints::<7>::repeat(100.0);
        let mut random = Random::new(7);
        let (mut small, mut large) = (0, 0);
        for _ in 0..3000 {
            let start = Joints::<7>::from_fn(|joint, _| {
                let limits = arm.limits()[joint];
                random.between(limits.min, limits.max)
            });

            let way =
                nalgebra::Vector3::from_fn(|_, _| random.between(-0.5, 0.5)).normalize() * 0.3;
            let chain = settings.chain(&arm, &start);
            let Some(jump) = largest_jump(&settings, &chain, &start, way) else {
                continue;
            };
            let mut target = chain.forward(&start);
            target.translation.vector += way;
            let followed = settings.follow_task(&chain, &target, Task::Pose, &start, &fast);
            match jump {
                _ if jump > 0.251 => {
                    large += 1;
                    let blocked = matches!(followed, Err(WayError::Blocked { .. }));
                    assert!(blocked, "{jump} rad at once from {start}");
                }
                _ if jump > 0.2 && jump < 0.249 => {
                    small += 1;
                    assert!(followed.is_ok(), "{jump} rad from {start}: {followed:?}");
                }
                _ => {}
            }
            if small > 0 && large > 0 {
                return;
            }
        }
        panic!("{small} lines just below the limit and {large} beyond it in the sample");
    }

    /// The joint positions of a step alone are kept, to be followed exactly.
    #[test]
    fn a_step_is_no_longer_than_5_cm_and_turns_no_farther_than_a_quarter_radian() {
        let arm = WamModel::<7>::new().chain;
        let settings = Settings::new(*arm.limits());
        let chain = settings.chain(&arm, &bent());
        let fast = Joints::<7>::repeat(100.0);
        for (distance, angle, is_step) in [
            (0.05, 0.0, true),
            (0.0501, 0.0, false),
            (0.0, 0.249, true),
            (0.0, 0.251, false),
        ] {
            let mut target = chain.forward(&bent());
            target.translation.vector.z -= distance;
            let turn = nalgebra::Vector3::x() * angle;
            target.rotation = Rotation3::new(turn) * target.rotation;
            let way = settings.follow(&chain, &target, Task::Pose, &bent(), &fast);
            let way = way.expect("the arm is bent");
            assert_eq!(way.places.is_some(), is_step, "{distance} m, {angle} rad");
        }
    }

    #[test]
    fn joints_that_are_not_used_stay() {
        let arm = WamModel::<7>::new().chain;
        let mut settings = Settings::new(*arm.limits());
        settings.dof[2] = false;
        let start = bent().add_scalar(0.1);
        let chain = settings.chain(&arm, &start);
        let target = chain.forward(&bent());
        let found = settings
            .reach(&chain, &target, Task::Position, &start)
            .joints;
        assert_eq!(found[2], start[2]);
        let off = chain.forward(&found).translation.vector - target.translation.vector;
        assert!(off.norm() < 1e-5);
    }

    #[test]
    fn what_has_priority_is_reached_where_a_pose_is_not() {
        let arm = WamModel::<4>::new().chain;
        let stand = Joints::<4>::new(0.2, 0.5, 0.1, 1.0);
        let mut settings = Settings::new(*arm.limits());
        let chain = settings.chain(&arm, &stand);
        let mut target = chain.forward(&stand);
        // Four joints cannot turn the tool about its own axis and keep its place.
        target.rotation *= nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::x_axis(), 0.3);
        let off = |found: &Joints<4>| {
            crate::kinematics::distances(&Task::Pose.error(&target, &chain.forward(found)))
        };
        let reach = settings.reach(&chain, &target, Task::Pose, &stand);
        assert!(reach.missed_by.is_none(), "the place is reached");
        let place_first = reach.joints;
        assert!(off(&place_first).0 < 1e-5);
        assert!(off(&place_first).1 > 1e-3);
        settings.priority = Priority::Orientation;
        let turn_first = settings.reach(&chain, &target, Task::Pose, &stand).joints;
        assert!(off(&turn_first).1 < 1e-5);
        assert!(off(&turn_first).0 > 1e-3);
    }

    #[test]
    fn a_place_out_of_reach_is_approached_as_far_as_the_arm_is_long() {
        let arm = WamModel::<7>::new().chain;
        let settings = Settings::new(*arm.limits());
        let chain = settings.chain(&arm, &bent());
        let target = Pose::translation(2.0, 0.0, 0.5);
        let reach = settings.reach(&chain, &target, Task::Position, &bent());
        let found = chain.forward(&reach.joints);
        let (distance, _) = reach.missed_by.unwrap();
        let left = target.translation.vector - found.translation.vector;
        assert!((distance - left.norm()).abs() < 1e-6, "{distance}");
        let direction = target.translation.vector.normalize();
        let towards = found.translation.vector.normalize().dot(&direction);
        assert!(towards > 0.999, "{found}");
        assert!(found.translation.vector.norm() > 0.85);
    }

    #[test]
    fn the_rest_posture_draws_where_there_is_a_choice() {
        let arm = WamModel::<7>::new().chain;
        let mut settings = Settings::new(*arm.limits());
        let chain = settings.chain(&arm, &bent());
        let target = chain.forward(&bent());
        let free = settings
            .reach(&chain, &target, Task::Position, &bent())
            .joints;
        settings.rest = bent().add_scalar(0.3);
        settings.weights = Joints::repeat(1.0);
        let drawn = settings
            .reach(&chain, &target, Task::Position, &bent())
            .joints;
        assert!((drawn - settings.rest).norm() < (free - settings.rest).norm() - 0.01);
    }

    /// A step is checked at five places for each 0.04 rad that the tool turns, and for each 5 mm that it moves, whichever are more.
    #[test]
    fn a_step_is_checked_in_proportion_to_its_rotation_and_its_length() {
        let arm = WamModel::<7>::new().chain;
        let settings = Settings::new(*arm.limits());
        let fast = Joints::<7>::repeat(100.0);
        let start = bent();
        let chain = settings.chain(&arm, &start);
        for (turn, distance, places) in [
            (0.19, 0.0, 24),
            (0.19, 0.0185, 24),
            (0.1, 0.0185, 19),
            (0.0, 0.0185, 19),
        ] {
            let mut target = chain.forward(&start);
            target.translation.vector.z += distance;
            target.rotation =
                Rotation3::new(nalgebra::Vector3::new(0.0, 0.0, turn)) * target.rotation;
            let followed = settings.follow_task(&chain, &target, Task::Pose, &start, &fast);
            let way = followed.expect("the arm can turn its tool");
            let checked = way.places.expect("it is a step").len() - 1;
            assert_eq!(checked, places, "{turn} rad, {distance} m");
        }
    }
}
