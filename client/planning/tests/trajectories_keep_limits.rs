//! Trajectories keep velocity and acceleration limits, follow their path, and are not needlessly slow.

use yarp_devices::kinematics::{Joints, Pose};
use yarp_devices::trajectory::JointLimits;
use yarp_devices::wam::WamModel;
use yarp_planning::{
    Obstacle, Path, Planner, PlannerOptions, Scene, Shape, Trajectory, TrajectoryError,
};

const SPEED: f64 = 1.5;
const ACCELERATION: f64 = 4.0;

fn planner(scene: Scene) -> Planner {
    let mut options = PlannerOptions::default();
    options.limits = JointLimits::uniform(SPEED, ACCELERATION);
    Planner::new(&WamModel::<7>::new(), scene).with_options(options)
}

/// Checks limits by differences of the joints alone.
#[track_caller]
fn check_limits(trajectory: &Trajectory) {
    let step = 0.002;
    let count = (trajectory.duration() / step).ceil() as usize + 2;
    let at = |index: usize| trajectory.joints_at(index as f64 * step);
    let mut velocity = Joints::<7>::zeros();
    for index in 0..count {
        let next = (at(index + 1) - at(index)) / step;
        assert!(next.amax() <= SPEED * 1.001, "velocity {}", next.amax());
        let acceleration = (next - velocity).amax() / step;
        assert!(
            acceleration <= ACCELERATION * 1.1,
            "acceleration {acceleration} at {index}"
        );
        velocity = next;
    }
    assert_eq!(velocity, Joints::<7>::zeros());
}

#[test]
fn a_straight_motion_takes_the_time_of_a_trapezoid() {
    let mut planner = planner(Scene::default());
    let start: Joints<7> = [-1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0].into();
    let goal: Joints<7> = [1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0].into();
    let path = planner.plan(&start, &[goal]).unwrap();
    let trajectory = planner.trajectory(&path).unwrap();
    check_limits(&trajectory);
    // 2 rad at 1.5 rad/s and 4 rad/s²: 2 / 1.5 + 1.5 / 4.
    let best = 2.0 / SPEED + SPEED / ACCELERATION;
    assert!(
        (trajectory.duration() - best).abs() < 0.02 * best,
        "{}",
        trajectory.duration()
    );
    assert_eq!(trajectory.joints_at(-1.0), start);
    assert!((trajectory.joints_at(1e9) - goal).amax() < 1e-9);
    assert_eq!(trajectory.velocities_at(1e9), Joints::<7>::zeros());
}

#[test]
fn a_detour_keeps_the_limits_and_the_path() {
    let mut scene = Scene::default();
    let wall = Shape::cuboid([0.8, 0.04, 1.0]);
    scene.add(Obstacle::new(
        "wall",
        wall,
        Pose::translation(0.75, 0.0, 0.0),
    ));
    let mut planner = planner(scene);
    let start: Joints<7> = [-0.6, 1.2, 0.0, 0.6, 0.0, 0.0, 0.0].into();
    let goal: Joints<7> = [0.6, 1.2, 0.0, 0.6, 0.0, 0.0, 0.0].into();
    let path = planner.plan(&start, &[goal]).unwrap();
    assert!(path.postures().len() > 2);
    let trajectory = planner.trajectory(&path).unwrap();
    check_limits(&trajectory);
    let mut worst = 0.0_f64;
    for index in 0..=2000 {
        let joints = trajectory.joints_at(trajectory.duration() * f64::from(index) / 2000.0);
        let distance = path.postures().windows(2).map(|pair| {
            let along = pair[1] - pair[0];
            let part = ((joints - pair[0]).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (joints - pair[0].lerp(&pair[1], part)).amax()
        });
        worst = worst.max(distance.fold(f64::INFINITY, f64::min));
    }
    assert!(worst < 0.0025, "{worst} rad from the path");
}

#[test]
fn limits_must_be_positive() {
    let mut planner = planner(Scene::default());
    let start: Joints<7> = [0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0].into();
    let path = planner.plan(&start, &[start]).unwrap();
    let trajectory = planner.trajectory(&path).unwrap();
    assert_eq!(trajectory.duration(), 0.0);
    assert_eq!(trajectory.joints_at(0.5), start);
    let mut limits = JointLimits::uniform(1.0, 1.0);
    limits.accelerations[2] = 0.0;
    let refused = Trajectory::new(&path, &limits).expect_err("a joint without acceleration");
    let expected = TrajectoryError::Limit {
        what: "acceleration",
        joint: 2,
        limit: 0.0,
    };
    assert_eq!(refused, expected);
}

/// The arm never arrived: a path of one grid interval had the velocity 0 at both of its ends.
#[test]
fn a_tiny_motion_takes_a_short_time() {
    let start: Joints<7> = [-1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0].into();
    for distance in [0.0, 1e-12, 1e-6, 1e-3, 0.009, 0.011] {
        let mut goal = start;
        goal[3] += distance;
        let path = Path::through(vec![start, goal]).unwrap();
        let limits = JointLimits::uniform(SPEED, ACCELERATION);
        let trajectory = Trajectory::new(&path, &limits).unwrap();
        // From rest to rest, at the acceleration alone.
        let fastest = 2.0 * (distance / ACCELERATION).sqrt();
        let duration = trajectory.duration();
        assert!(
            (fastest * 0.999 - 1e-5..=2.0 * fastest + 1e-3).contains(&duration),
            "{distance} rad in {duration} s"
        );
    }
}

/// Corners that meet left straight pieces of 1e-17 rad between them, and the whole motion was slowed down because of them.
#[test]
fn a_curve_of_short_pieces_is_not_slow() {
    let limits = JointLimits::uniform(SPEED, ACCELERATION);
    for number in 1..200 {
        // An arc of 60 degrees in two joints, and another joint that moves along.
        let radius = 0.2 + 0.01 * f64::from(number);
        let posture = |step: i32| {
            let angle = f64::from(step) / 20.0;
            let mut joints = Joints::<7>::zeros();
            joints[1] = radius * angle.sin();
            joints[3] = 1.0 + radius * (1.0 - angle.cos());
            joints[5] = angle / 3.0;
            joints
        };
        let path = Path::through((0..=20).map(posture).collect()).unwrap();
        let trajectory = Trajectory::new(&path, &limits).unwrap();
        // Half of the acceleration is for the bends, whose radius of curvature is that of the rounded corners.
        let slow = 2.0 * path.length() / SPEED + 2.0 * SPEED / ACCELERATION;
        let duration = trajectory.duration();
        assert!(duration < slow, "radius {radius}: {duration} s, {slow} s");
        // Exactly: a goal may be at the limit of a joint.
        assert_eq!(trajectory.joints_at(duration), path.goal());
        check_limits(&trajectory);
    }
}
