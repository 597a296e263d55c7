//! The tool on a straight line.

use std::time::Duration;

use nalgebra::{Rotation3, Translation3};

use super::MAX_JOINT_CHANGE_PER_STEP;
use super::synchronised_joints::share;
use crate::kinematics::{Joints, Pose, Solver, Unsolved, rotation_vector};

/// Maximum commanded speed of a tool, m/s: the speed that the thesis assumes (1 cm in 20 ms).
pub const MAX_TOOL_SPEED: f64 = 0.5;

/// Speeds and accelerations of the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StraightLineOptions {
    /// m/s, above zero, at most [`MAX_TOOL_SPEED`].
    pub speed: f64,
    /// m/s², above zero.
    pub acceleration: f64,
    /// rad/s, above zero.
    pub turn_speed: f64,
    /// rad/s², above zero.
    pub turn_acceleration: f64,
    /// Maximum speed of any joint on the way, rad/s.
    pub joint_speed: f64,
    /// Maximum change of any joint for each [`STEP_LENGTH`](super::STEP_LENGTH) of the way or
    /// [`STEP_ANGLE`](super::STEP_ANGLE) of the rotation that has begun, rad; infinite to allow every posture.
    pub joint_change_per_step: f64,
}

/// The tool's defaults of libbarrett (`systems/wam.h`) and the joints' largest speed of owd.
impl Default for StraightLineOptions {
    fn default() -> Self {
        Self {
            speed: 0.1,
            acceleration: 0.2,
            turn_speed: 0.5,
            turn_acceleration: 0.5,
            joint_speed: 2.5,
            joint_change_per_step: MAX_JOINT_CHANGE_PER_STEP,
        }
    }
}

/// Reasons why a line cannot be followed; detected before anything moves.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum StraightLineError<const N: usize> {
    /// An option is out of its range.
    #[error("the line asks for {quantity} {asked}, allowed are values above 0 up to {most}")]
    Option {
        /// The quantity, with its unit.
        quantity: &'static str,
        /// The value refused.
        asked: f64,
        /// The largest allowed.
        most: f64,
    },
    /// A position on the line is out of reach, or can only be reached by a jump into another posture.
    #[error(
        "the line cannot be followed beyond {percent:.0} % of its way; try another start or another orientation"
    )]
    Unreachable {
        /// Share of the path that can be followed.
        percent: f64,
        /// The failed solution.
        #[source]
        source: Unsolved<N>,
    },
    /// A joint would have to be faster than it can, near a singular pose.
    #[error(
        "the line needs {speed:.1} rad/s of joint {joint} at {percent:.0} % of its way, allowed are {most} rad/s; try a lower speed"
    )]
    TooFast {
        /// The joint, counted from 0.
        joint: usize,
        /// rad/s.
        speed: f64,
        /// rad/s.
        most: f64,
        /// Position on the path.
        percent: f64,
    },
    /// A joint would turn far although the tool does not: the arm would change its posture.
    #[error(
        "the line turns joint {joint} by {change:.2} rad at {percent:.0} % of its way, allowed are {most:.2} rad for a way of this length; move the joints to another posture first"
    )]
    PostureChange {
        /// The joint, counted from 0.
        joint: usize,
        /// rad, from the start of the line.
        change: f64,
        /// rad.
        most: f64,
        /// Position on the path.
        percent: f64,
    },
}

/// A straight way of the tool, as joint angles for every control period.
///
/// Place and orientation move together with a trapezoid in speed. The joints are found period by period with the solver, each
/// time from where they were before, so that they change smoothly; all of it before the move begins.
#[derive(Clone, Debug)]
pub struct StraightLine<const N: usize> {
    joints: Vec<Joints<N>>,
    next: usize,
}

impl<const N: usize> StraightLine<N> {
    /// Plans the line from the tool position with the joints at `start` to `target`, in steps of `period`.
    ///
    /// `solver`: with one attempt per step, otherwise the joints jump where the way is blocked.
    ///
    /// Errors: [`StraightLineError`].
    pub fn plan(
        solver: &Solver<N>,
        start: &Joints<N>,
        target: &Pose,
        options: &StraightLineOptions,
        period: Duration,
    ) -> Result<Self, StraightLineError<N>> {
        Self::plan_with(solver, start, target, None, options, period)
    }

    /// Plans like [`plan`](Self::plan) a line that ends as near to `posture` as the target allows.
    ///
    /// The freedom that seven joints have beyond the pose of the tool changes evenly along the line. Lines that return to a
    /// target return to the same joint angles, however many others were between. A line that would turn a
    /// joint too far or too fast for that is planned without `posture`.
    ///
    /// Errors: [`StraightLineError`].
    pub fn plan_near(
        solver: &Solver<N>,
        start: &Joints<N>,
        target: &Pose,
        posture: &Joints<N>,
        options: &StraightLineOptions,
        period: Duration,
    ) -> Result<Self, StraightLineError<N>> {
        Self::plan_with(solver, start, target, Some(posture), options, period)
            .or_else(|_| Self::plan(solver, start, target, options, period))
    }

    fn plan_with(
        solver: &Solver<N>,
        start: &Joints<N>,
        target: &Pose,
        posture: Option<&Joints<N>>,
        options: &StraightLineOptions,
        period: Duration,
    ) -> Result<Self, StraightLineError<N>> {
        options.check()?;
        let seconds = period.as_secs_f64();
        let from = solver.chain().forward(start);
        let way = target.translation.vector - from.translation.vector;
        let turn = rotation_vector(&(target.rotation * from.rotation.inverse()));
        let (distance, angle) = (way.norm(), turn.norm());
        let mut share = share(
            (options.speed / distance).min(options.turn_speed / angle),
            (options.acceleration / distance).min(options.turn_acceleration / angle),
        );
        let most = options.largest_joint_change(distance, angle);
        let mut joints = Vec::new();
        let mut before = *start;
        loop {
            let done_before = share.state().position;
            share.advance(seconds);
            let done = share.state().position;
            let percent = done * 100.0;
            let pose = Pose::from_parts(
                Translation3::from(from.translation.vector + way * done),
                Rotation3::new(turn * done) * from.rotation,
            );
            let solved = match posture {
                None => solver.solve(&pose, &before),
                // The part of what is left that this period has of the rest of the line: nothing is left at its end.
                Some(posture) => {
                    let part = (done - done_before) / (1.0 - done_before);
                    solver.solve_near(&pose, &before, &before.lerp(posture, part))
                }
            };
            let now = solved
                .map_err(|source| StraightLineError::Unreachable { percent, source })?
                .joints;
            let velocities = (now - before) / seconds;
            let joint = velocities.iamax();
            if velocities[joint].abs() > options.joint_speed {
                return Err(StraightLineError::TooFast {
                    joint,
                    speed: velocities[joint].abs(),
                    most: options.joint_speed,
                    percent,
                });
            }
            let changes = now - start;
            let joint = changes.iamax();
            if changes[joint].abs() > most {
                return Err(StraightLineError::PostureChange {
                    joint,
                    change: changes[joint].abs(),
                    most,
                    percent,
                });
            }
            joints.push(now);
            before = now;
            if share.is_done() {
                return Ok(Self { joints, next: 0 });
            }
        }
    }

    /// The joint angles at the end of the next period; `None` after the last.
    pub fn next_joints(&mut self) -> Option<Joints<N>> {
        let joints = self.joints.get(self.next).copied();
        self.next += 1;
        joints
    }

    /// Returns the joint angles at the end of the line.
    pub fn last_joints(&self) -> Option<&Joints<N>> {
        self.joints.last()
    }

    /// Returns the number of periods.
    pub fn periods(&self) -> usize {
        self.joints.len()
    }
}

impl StraightLineOptions {
    fn check<const N: usize>(&self) -> Result<(), StraightLineError<N>> {
        let rows = [
            ("speed in m/s", self.speed, MAX_TOOL_SPEED),
            ("acceleration in m/s²", self.acceleration, 10.0),
            ("turn speed in rad/s", self.turn_speed, 10.0),
            ("turn acceleration in rad/s²", self.turn_acceleration, 100.0),
        ];
        // Slower than this, and a line would take hours and its plan all memory.
        const LEAST: f64 = 1e-3;
        match rows
            .into_iter()
            .find(|(_, asked, most)| !(LEAST..=*most).contains(asked))
        {
            Some((quantity, asked, most)) => Err(StraightLineError::Option {
                quantity,
                asked,
                most,
            }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::SolverOptions;
    use crate::wam::WamModel;

    const PERIOD: Duration = Duration::from_millis(2);

    fn solver() -> Solver<7> {
        let options = SolverOptions {
            attempts: 1,
            ..SolverOptions::default()
        };
        Solver::with_options(WamModel::<7>::new().chain, options)
    }

    fn start() -> Joints<7> {
        Joints::from([0.2, 0.8, 0.0, 1.6, 0.0, 0.3, 0.0])
    }

    fn shifted(x: f64, y: f64, z: f64, turn: f64) -> Pose {
        let mut pose = solver().chain().forward(&start());
        pose.translation.vector += nalgebra::Vector3::new(x, y, z);
        pose.rotation = Rotation3::new(nalgebra::Vector3::z() * turn) * pose.rotation;
        pose
    }

    #[test]
    fn the_tool_stays_on_the_line_and_keeps_its_speed_and_acceleration() {
        let options = StraightLineOptions {
            speed: 0.5,
            acceleration: 1.0,
            ..StraightLineOptions::default()
        };
        let target = shifted(0.1, -0.3, 0.1, 0.2);
        let solver = solver();
        let mut line = StraightLine::plan(&solver, &start(), &target, &options, PERIOD).unwrap();
        let from = solver.chain().forward(&start()).translation.vector;
        let way = target.translation.vector - from;
        let (mut before, mut velocity) = (from, nalgebra::Vector3::zeros());
        let mut fastest = 0.0_f64;
        while let Some(joints) = line.next_joints() {
            assert!(solver.chain().contains(&joints));
            let place = solver.chain().forward(&joints).translation.vector;
            let along = way * ((place - from).dot(&way) / way.norm_squared());
            assert!((place - from - along).norm() < 3e-6, "beside the line");
            let next = (place - before) / PERIOD.as_secs_f64();
            fastest = fastest.max(next.norm());
            // A micrometre of tolerance at either end of a period.
            assert!(next.norm() < 0.5 + 2e-3);
            assert!((next - velocity).norm() / PERIOD.as_secs_f64() < 1.0 + 2.0);
            (before, velocity) = (place, next);
        }
        assert!((before - target.translation.vector).norm() < 2e-6);
        assert!(fastest > 0.45, "it reached its speed: {fastest}");
    }

    #[test]
    fn refusals_say_why() {
        let check = |target: Pose, options: StraightLineOptions, expected: &str| {
            let refused =
                StraightLine::plan(&solver(), &start(), &target, &options, PERIOD).unwrap_err();
            let message = refused.to_string();
            assert!(message.starts_with(expected), "{message}");
        };
        let fast = StraightLineOptions {
            speed: 0.6,
            ..StraightLineOptions::default()
        };
        check(
            shifted(0.1, 0.0, 0.0, 0.0),
            fast,
            "the line asks for speed in m/s 0.6, allowed are values above 0 up to 0.5",
        );
        // The elbow stretches faster and faster towards the end of its reach.
        let any_joint_speed = StraightLineOptions {
            joint_speed: f64::INFINITY,
            ..StraightLineOptions::default()
        };
        check(
            shifted(2.0, 0.0, 0.0, 0.0),
            any_joint_speed,
            "the line cannot be followed beyond",
        );
        let slow_joints = StraightLineOptions {
            joint_speed: 0.05,
            ..StraightLineOptions::default()
        };
        check(
            shifted(0.1, 0.1, 0.0, 0.0),
            slow_joints,
            "the line needs 0.1 rad/s of joint",
        );
    }

    /// libbarrett's speeds of the tool, owd's of the joints; and how far each may be changed.
    #[test]
    fn options_have_their_defaults_and_ends() {
        let options = StraightLineOptions::default();
        assert_eq!((options.speed, options.acceleration), (0.1, 0.2));
        assert_eq!((options.turn_speed, options.turn_acceleration), (0.5, 0.5));
        assert_eq!(options.joint_speed, 2.5);
        for (field, most) in [0.5, 10.0, 10.0, 100.0].into_iter().enumerate() {
            for (asked, fits) in [
                (most, true),
                (most * 1.01, false),
                (0.001, true),
                (0.0009, false),
                (f64::NAN, false),
            ] {
                let mut changed = options;
                *[
                    &mut changed.speed,
                    &mut changed.acceleration,
                    &mut changed.turn_speed,
                    &mut changed.turn_acceleration,
                ][field] = asked;
                assert_eq!(changed.check::<7>().is_ok(), fits, "{changed:?}");
            }
        }
    }

    #[test]
    fn no_way_takes_one_period() {
        let here = shifted(0.0, 0.0, 0.0, 0.0);
        let line = StraightLine::plan(
            &solver(),
            &start(),
            &here,
            &StraightLineOptions::default(),
            PERIOD,
        )
        .unwrap();
        assert_eq!(line.periods(), 1);
    }

    /// Moves the tool around a rectangle of lines that end near `start`; returns the joints after each round.
    fn rounds(near: Option<Joints<7>>) -> Vec<Joints<7>> {
        let solver = solver();
        let options = StraightLineOptions::default();
        let corners = [
            shifted(0.1, 0.0, 0.1, 0.0),
            shifted(0.1, -0.15, 0.2, 0.0),
            shifted(0.0, -0.15, 0.1, 0.0),
            shifted(0.0, 0.0, 0.0, 0.0),
        ];
        let mut joints = start();
        let mut round = || {
            for corner in &corners {
                let line = match &near {
                    None => StraightLine::plan(&solver, &joints, corner, &options, PERIOD),
                    Some(posture) => {
                        StraightLine::plan_near(&solver, &joints, corner, posture, &options, PERIOD)
                    }
                };
                joints = *line.unwrap().last_joints().unwrap();
            }
            joints
        };
        (0..3).map(|_| round()).collect()
    }

    #[test]
    fn lines_that_return_to_a_pose_return_to_their_posture() {
        for joints in rounds(Some(start())) {
            assert!((joints - start()).amax() < 1e-3, "{joints}");
        }
        let drifted = rounds(None)[2];
        assert!((drifted - start()).amax() > 0.05, "{drifted}");
    }

    #[test]
    fn the_tool_stays_on_a_line_to_another_posture() {
        let solver = solver();
        let options = StraightLineOptions::default();
        let target = shifted(0.1, -0.2, 0.1, 0.0);
        let posture = start() + Joints::from([0.0, 0.0, 0.4, 0.0, -0.3, 0.0, 0.0]);
        let mut line =
            StraightLine::plan_near(&solver, &start(), &target, &posture, &options, PERIOD)
                .unwrap();
        let plain = StraightLine::plan(&solver, &start(), &target, &options, PERIOD).unwrap();
        let from = solver.chain().forward(&start()).translation.vector;
        let way = target.translation.vector - from;
        let (mut before, mut velocity) = (start(), Joints::zeros());
        while let Some(joints) = line.next_joints() {
            let pose = solver.chain().forward(&joints);
            let along = way * ((pose.translation.vector - from).dot(&way) / way.norm_squared());
            assert!((pose.translation.vector - from - along).norm() < 3e-6);
            let turned = rotation_vector(&(target.rotation * pose.rotation.inverse()));
            assert!(turned.norm() < 3e-6, "{turned}");
            let now = (joints - before) / PERIOD.as_secs_f64();
            // The acceleration of the line, in joints: no joint is thrown into the posture.
            let most = 3.0 * PERIOD.as_secs_f64();
            assert!((now - velocity).amax() < most, "{}", now - velocity);
            (before, velocity) = (joints, now);
        }
        // As near as the pose at the end allows.
        let off = |joints: &Joints<7>| (joints - posture).norm();
        let plain = plain.last_joints().unwrap();
        let nearest = solver.solve_near(&target, plain, &posture).unwrap().joints;
        assert!(off(&nearest) < off(plain) - 0.05);
        assert!(off(&before) < off(&nearest) + 1e-3, "{}", off(&before));
    }

    #[test]
    fn a_short_line_to_a_far_posture_keeps_its_own() {
        let solver = solver();
        let options = StraightLineOptions::default();
        let target = shifted(0.001, 0.0, 0.0, 0.0);
        let far = start() + Joints::from([0.0, 0.0, 1.5, 0.0, -1.5, 0.0, 0.0]);
        let near = StraightLine::plan_near(&solver, &start(), &target, &far, &options, PERIOD);
        let plain = StraightLine::plan(&solver, &start(), &target, &options, PERIOD);
        assert_eq!(near.unwrap().last_joints(), plain.unwrap().last_joints());
    }
}
