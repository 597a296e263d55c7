//! Moves of the simulated arm under its controller: all joints together, and the tool on a straight line.

use std::time::Duration;

use nalgebra::Rotation3;
use yarp_devices::dynamics::Body;
use yarp_devices::kinematics::{Joints, Pose};
use yarp_devices::simulation::{MoveError, SimulatedArm, SimulatorOptions};
use yarp_devices::trajectory::{JointLimits, StraightLineOptions};
use yarp_devices::wam::WamModel;

const START: [f64; 7] = [0.2, 0.8, 0.0, 1.6, 0.0, 0.3, 0.0];

fn arm() -> SimulatedArm<7> {
    let mut arm = SimulatedArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    arm.place(&START.into());
    arm
}

#[test]
fn joints_arrive_together_near_their_targets() {
    let mut arm = arm();
    let start = arm.measured();
    let target = Joints::<7>::from([-0.4, 0.4, 0.3, 1.9, -0.6, -0.3, 0.8]);
    let limits = JointLimits::uniform(0.75, 0.5);
    arm.move_joints(&target, &limits).unwrap();
    while arm.is_moving() {
        arm.tick();
        // Low gains and friction let joints lag; the planned ones share every moment.
        let shares = (arm.set_point() - start).component_div(&(target - start));
        assert!(shares.max() - shares.min() < 1e-9);
        assert!((arm.measured() - arm.set_point()).amax() < 0.1);
    }
    arm.run(Duration::from_secs(1));
    let off = (arm.measured() - target).abs();
    assert!(off.amax() < 0.03, "{off}");
}

#[test]
fn the_tool_stays_near_its_line() {
    let mut arm = arm();
    let from = arm.measured_tool();
    let mut target = from;
    target.translation.vector += nalgebra::Vector3::new(0.05, -0.25, 0.1);
    target.rotation = Rotation3::new(nalgebra::Vector3::x() * 0.2) * target.rotation;
    let options = StraightLineOptions {
        speed: 0.2,
        ..StraightLineOptions::default()
    };
    arm.move_line(&target, &options).unwrap();
    let way = (target.translation.vector - from.translation.vector).normalize();
    let mut worst = 0.0_f64;
    while arm.is_moving() {
        arm.tick();
        let place = arm.simulator().tool().translation.vector - from.translation.vector;
        worst = worst.max((place - way * place.dot(&way)).norm());
    }
    arm.run(Duration::from_secs(1));
    assert!(worst < 0.02, "{worst} m beside the line");
    let end = arm.simulator().tool().translation.vector;
    let off = (end - target.translation.vector).norm();
    assert!(off < 0.015, "{off} m from the target");
}

#[test]
fn lines_that_return_to_a_pose_return_to_their_posture() {
    let mut arm = arm();
    let start = arm.set_point();
    let home = WamModel::<7>::new().chain.forward(&start);
    for corner in [
        [0.1, 0.0, 0.1],
        [0.1, -0.15, 0.2],
        [0.0, -0.15, 0.1],
        [0.0; 3],
    ] {
        let mut target = home;
        target.translation.vector += nalgebra::Vector3::from(corner);
        arm.move_line(&target, &StraightLineOptions::default())
            .unwrap();
        arm.finish(Duration::ZERO);
    }
    let off = arm.set_point() - start;
    assert!(off.amax() < 1e-3, "{off}");
    // Whatever else moves the joints changes the posture that the next lines keep.
    let others = [
        [0.1, 1.0, 0.1, 1.5, -0.2, 0.3, 0.0],
        [0.1, 1.0, 0.3, 1.5, -0.3, 0.3, 0.1],
        [0.1, 1.0, -0.1, 1.5, 0.2, 0.3, 0.2],
    ];
    for (way, other) in others.map(Joints::from).iter().enumerate() {
        match way {
            0 => {
                let limits = JointLimits::uniform(0.75, 0.5);
                arm.move_joints(other, &limits).unwrap();
                arm.finish(Duration::ZERO);
            }
            1 => {
                let from = arm.set_point();
                for step in 1..=1000 {
                    arm.follow(&from.lerp(other, f64::from(step) / 1000.0))
                        .unwrap();
                    arm.tick();
                }
            }
            _ => arm.place(other),
        }
        let here = arm.set_point();
        let mut target = WamModel::<7>::new().chain.forward(&here);
        // Back and forth, so that a posture of before would be returned to.
        for by in [0.05, -0.05] {
            target.translation.x += by;
            arm.move_line(&target, &StraightLineOptions::default())
                .unwrap();
            arm.finish(Duration::ZERO);
        }
        let off = arm.set_point() - here;
        assert!(off.amax() < 2e-3, "{way}: {off}");
    }
}

#[test]
fn a_new_move_takes_the_place_of_a_running_one() {
    let mut arm = arm();
    let limits = JointLimits::uniform(0.75, 0.5);
    arm.move_joints(&[0.8, 0.8, 0.0, 1.6, 0.0, 0.3, 0.0].into(), &limits)
        .unwrap();
    arm.run(Duration::from_millis(300));
    let on_the_way = arm.set_point();
    assert!(on_the_way[0] > 0.2 && on_the_way[0] < 0.8);
    arm.move_joints(&START.into(), &limits).unwrap();
    assert_eq!(arm.set_point(), on_the_way);
    arm.finish(Duration::from_secs(1));
    assert!((arm.measured() - Joints::<7>::from(START)).amax() < 0.02);
}

#[test]
fn a_refused_move_leaves_the_running_one_alone() {
    let mut arm = arm();
    let limits = JointLimits::uniform(0.75, 0.5);
    let target = Joints::<7>::from([0.8, 0.8, 0.0, 1.6, 0.0, 0.3, 0.0]);
    arm.move_joints(&target, &limits).unwrap();
    let mut outside = target;
    outside[5] = 1.7;
    let refused = arm.move_joints(&outside, &limits).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "joint 5 asked for 1.700 rad, allowed -1.6 to 1.6 rad"
    );
    outside[5] = f64::NAN;
    assert!(arm.move_joints(&outside, &limits).is_err());
    let far = Pose::translation(0.0, 0.0, 3.0);
    let refused = arm
        .move_line(&far, &StraightLineOptions::default())
        .unwrap_err();
    assert!(matches!(refused, MoveError::StraightLine(_)));
    arm.finish(Duration::ZERO);
    assert_eq!(arm.set_point(), target);
}

#[test]
fn an_arm_with_four_joints_moves_and_holds() {
    let mut arm = SimulatedArm::new(WamModel::<4>::new(), SimulatorOptions::default());
    let target = Joints::<4>::from([0.4, -0.8, 0.2, 1.5]);
    arm.move_joints(&target, &JointLimits::uniform(0.75, 0.5))
        .unwrap();
    arm.finish(Duration::from_secs(1));
    let off = (arm.measured() - target).abs();
    assert!(off.amax() < 0.02, "{off}");
    assert_eq!(arm.simulator().safety().fault(), None);
}

#[test]
fn an_arm_carries_a_load_it_was_calibrated_with() {
    let load = Body::point(2.0, nalgebra::Vector3::new(0.0, 0.0, 0.08));
    let model = WamModel::<7>::new().with_load(load);
    let mut arm = SimulatedArm::new(model, SimulatorOptions::default());
    arm.place(&[0.0, 1.0, 0.0, 0.8, 0.0, 0.2, 0.0].into());
    let held = arm.measured();
    arm.run(Duration::from_secs(2));
    assert!((arm.measured() - held).amax() < 0.01);
}
