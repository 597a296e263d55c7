//! The way of a tool, with minimum jerk (T. Flash, N. Hogan, *The coordination of arm movements*, 1985).

use nalgebra::{Rotation3, SVector, Translation3, Vector3};

use crate::kinematics::{Joints, Pose, rotation_vector};

/// For velocities of the path that is left, s.
const DIFFERENCE_STEP: f64 = 1e-3;
/// Two rotations that differ by more within [`DIFFERENCE_STEP`] are one rotation with the axis flipped.
const ROTATION_FLIP_THRESHOLD: f64 = 1.0;

/// The polynomial of least jerk from a moving start to rest.
#[derive(Clone, Debug, PartialEq)]
struct Quintic<const D: usize> {
    coefficients: [SVector<f64, D>; 6],
    duration: f64,
}

impl<const D: usize> Quintic<D> {
    /// From place, velocity and acceleration to rest at `end`.
    fn new(start: [SVector<f64, D>; 3], end: SVector<f64, D>, duration: f64) -> Self {
        let [place, velocity, acceleration] = start;
        let t = duration;
        let way = end - place - velocity * t - acceleration * (t * t / 2.0);
        let speed = (-velocity - acceleration * t) * t;
        let push = -acceleration * (t * t);
        let coefficients = [
            place,
            velocity,
            acceleration / 2.0,
            (way * 10.0 - speed * 4.0 + push / 2.0) / t.powi(3),
            (way * -15.0 + speed * 7.0 - push) / t.powi(4),
            (way * 6.0 - speed * 3.0 + push / 2.0) / t.powi(5),
        ];
        Self {
            coefficients,
            duration,
        }
    }

    fn at(&self, time: f64) -> SVector<f64, D> {
        // A hair before the beginning too, where velocities are taken.
        let time = time.min(self.duration);
        let last_first = self.coefficients.iter().rev();
        last_first.fold(SVector::zeros(), |sum, coefficient| {
            sum * time + coefficient
        })
    }
}

/// A straight line to a pose, the rotation along the shortest way; beside it a path of the joints to the same end.
///
/// From rest it is a straight line with minimum jerk; a path that replaces another one continues with its velocity
/// and acceleration, so that targets may follow one another quickly.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Path<const N: usize> {
    place: Quintic<3>,
    turn: Quintic<3>,
    joints: Quintic<N>,
    goal: Pose,
    goal_joints: Joints<N>,
    duration: f64,
}

/// A pose of the tool and approximate joint positions.
pub(super) type PathPoint<const N: usize> = (Pose, Joints<N>);

impl<const N: usize> Path<N> {
    /// * `before`: the path that is left, and where on it, s.
    /// * `duration`: above 0, s.
    pub(super) fn new(
        (from, from_joints): PathPoint<N>,
        (goal, goal_joints): PathPoint<N>,
        duration: f64,
        before: Option<(&Self, f64)>,
    ) -> Self {
        let turned = |pose: &Pose| rotation_vector(&(goal.rotation.inverse() * pose.rotation));
        let mut place = [from.translation.vector, Vector3::zeros(), Vector3::zeros()];
        let mut turn = [turned(&from), Vector3::zeros(), Vector3::zeros()];
        let mut joints = [from_joints, Joints::zeros(), Joints::zeros()];
        if let Some((path, time)) = before {
            let [one, two, three] =
                [-DIFFERENCE_STEP, 0.0, DIFFERENCE_STEP].map(|step| path.at(time + step));
            let of = |place: &PathPoint<N>| place.0.translation.vector;
            derive(&mut place, [of(&one), of(&two), of(&three)]);
            derive(
                &mut turn,
                [turned(&one.0), turned(&two.0), turned(&three.0)],
            );
            derive(&mut joints, [one.1, two.1, three.1]);
        }
        Self {
            place: Quintic::new(place, goal.translation.vector, duration),
            turn: Quintic::new(turn, Vector3::zeros(), duration),
            joints: Quintic::new(joints, goal_joints, duration),
            goal,
            goal_joints,
            duration,
        }
    }

    /// Returns the pose of the tool `time` seconds after the start.
    pub(super) fn at(&self, time: f64) -> PathPoint<N> {
        if time >= self.duration {
            return self.goal();
        }
        let rotation = self.goal.rotation * Rotation3::new(self.turn.at(time));
        let pose = Pose::from_parts(Translation3::from(self.place.at(time)), rotation);
        (pose, self.joints.at(time))
    }

    /// Returns the end of the path.
    pub(super) fn goal(&self) -> PathPoint<N> {
        (self.goal, self.goal_joints)
    }

    /// Returns the fraction of the path that is covered, from rest.
    pub(super) fn fraction(&self, time: f64) -> f64 {
        let t = (time / self.duration).clamp(0.0, 1.0);
        t * t * t * (10.0 + t * (6.0 * t - 15.0))
    }

    pub(super) fn has_ended(&self, time: f64) -> bool {
        time >= self.duration
    }
}

/// Velocity and acceleration out of three places.
fn derive<const D: usize>(
    start: &mut [SVector<f64, D>; 3],
    [one, two, three]: [SVector<f64, D>; 3],
) {
    if (three - one).norm() < ROTATION_FLIP_THRESHOLD {
        start[1] = (three - one) / (2.0 * DIFFERENCE_STEP);
        start[2] = (three - two * 2.0 + one) / (DIFFERENCE_STEP * DIFFERENCE_STEP);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(x: f64, y: f64, angle: f64) -> Pose {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
        Pose::from_parts(Translation3::new(x, y, 0.0), turn)
    }

    fn path(before: Option<(&Path<4>, f64)>, from: Pose, to: Pose) -> Path<4> {
        let joints = (Joints::zeros(), Joints::repeat(1.0));
        Path::new((from, joints.0), (to, joints.1), 2.0, before)
    }

    #[test]
    fn it_is_a_straight_line_with_the_law_of_minimum_jerk() {
        let path = path(None, pose(0.0, 0.0, 0.0), pose(0.4, 0.2, 1.0));
        for step in 0..=20 {
            let time = f64::from(step) / 10.0;
            let part = path.fraction(time);
            let (at, joints) = path.at(time);
            assert!((at.translation.x - 0.4 * part).abs() < 1e-12);
            assert!((at.translation.y - 0.2 * part).abs() < 1e-12);
            assert!((at.rotation.angle() - part).abs() < 1e-9);
            assert!((joints - Joints::repeat(part)).norm() < 1e-12);
        }
        assert_eq!(path.fraction(1.0), 0.5);
        assert!(path.has_ended(2.0) && !path.has_ended(1.9));
    }

    #[test]
    fn a_target_on_the_way_is_taken_up_without_a_jerk() {
        let first = path(None, pose(0.0, 0.0, 0.0), pose(0.4, 0.0, 1.0));
        let left = first.at(0.8);
        let second = Path::new(
            left,
            (pose(0.0, 0.4, -1.0), Joints::zeros()),
            2.0,
            Some((&first, 0.8)),
        );
        let speed = |path: &Path<4>, time: f64| {
            let (one, two) = (path.at(time).0, path.at(time + 1e-5).0);
            (
                (two.translation.x - one.translation.x) / 1e-5,
                one.rotation.angle_to(&two.rotation) / 1e-5,
            )
        };
        let (before, after) = (speed(&first, 0.8), speed(&second, 0.0));
        assert!((before.0 - after.0).abs() < 1e-3, "{before:?} {after:?}");
        assert!((before.1 - after.1).abs() < 1e-3, "{before:?} {after:?}");
        assert!(before.0 > 0.1);
        assert_eq!(second.at(9.0).0, pose(0.0, 0.4, -1.0));
    }
}
