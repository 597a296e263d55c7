//! The controller of a tool on the simulated arm, and what it does when the arm is taken from it.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::wam::{SimulatedWam, WamModel};
use yarp_devices::{
    Axes, CartesianControl, CartesianEvent, ControlLimits, ControlMode, Device, DeviceError,
    Encoders, Limits, Mode, Target, TweakChange, checks,
};
use yarp_testing::eventually;

/// Longer than anything here takes on a busy machine.
const TEST_TIMEOUT: Duration = Duration::from_secs(60);
const PLACE: Target = Target::Position([0.4, 0.1, 0.4]);

fn controller() -> (Arc<SimulatedWam>, CartesianController<7>) {
    let arm = Arc::new(SimulatedWam::new());
    let chain = WamModel::<7>::new().chain;
    let options = CartesianOptions::new().part_type("wam7");
    let tool = CartesianController::start(arm.clone(), chain, options).expect("it is an arm");
    (arm, tool)
}

fn positions(arm: &SimulatedWam) -> Vec<f64> {
    let readings = arm.encoder_readings(Axes::All).expect("it is here");
    readings.iter().map(|reading| reading.position).collect()
}

#[test]
fn every_check_passes() {
    let (_arm, tool) = controller();
    for (name, check) in checks::TOOL {
        println!("{name}");
        check(&tool, TEST_TIMEOUT);
    }
}

#[test]
fn a_motion_ends_for_good_when_a_joint_is_taken() {
    let (arm, tool) = controller();
    let events = tool.events().expect("somebody listens");
    tool.set_tracking(true).expect("it can");
    let start = positions(&arm);
    tool.go_to(PLACE, Some(20.0)).expect("it goes");
    eventually("a motion", || {
        let moved = positions(&arm);
        moved
            .iter()
            .zip(&start)
            .any(|(now, then)| (now - then).abs() > 0.1)
    });
    let elbow = Axes::One(3.into());
    arm.set_control_modes(elbow, &[Mode::Position])
        .expect("it has this mode");
    eventually("the end", || tool.motion_done().expect("it answers"));
    assert!(matches!(
        events.recv_timeout(TEST_TIMEOUT),
        Ok(CartesianEvent::Onset { .. })
    ));
    assert!(matches!(
        events.recv_timeout(TEST_TIMEOUT),
        Ok(CartesianEvent::Done { .. })
    ));
    // Given back, it stays where it is.
    arm.set_control_modes(elbow, &[Mode::PositionDirect])
        .expect("it has this mode");
    let at = |arm: &SimulatedWam| arm.encoder_readings(elbow).expect("it is here")[0];
    let given_back = at(&arm).time;
    eventually("rest", || {
        at(&arm).time > given_back + 0.5 && at(&arm).speed == 0.0
    });
    let (here, since) = (positions(&arm), at(&arm).time);
    eventually("time", || at(&arm).time > since + 0.3);
    assert_eq!(positions(&arm), here);
    assert!(tool.motion_done().expect("it answers"));
    // A new command is a new motion.
    tool.go_to(PLACE, Some(0.5)).expect("it goes");
    assert!(
        tool.wait_motion_done(Duration::from_millis(5), TEST_TIMEOUT)
            .expect("it answers")
    );
}

#[test]
fn a_target_that_is_kept_is_gone_to_anew_with_another_tip() {
    let (_arm, tool) = controller();
    tool.set_tracking(true).expect("it can");
    tool.set_trajectory_time(0.3).expect("it can");
    tool.go_to(PLACE, None).expect("it goes");
    eventually("the target", || tool.motion_done().expect("it answers"));
    let bare = tool.desired().expect("it has one").joints;
    let tip = yarp_devices::TaskPose::from_array([0.0, 0.0, 0.1, 0.0, 0.0, 1.0, 0.0]);
    tool.attach_tip(tip).expect("it is a pose");
    eventually("the target again", || {
        let now = tool.pose().expect("it is here").pose.position;
        let off = now
            .iter()
            .zip([0.4, 0.1, 0.4])
            .map(|(now, then)| (now - then).abs());
        tool.motion_done().expect("it answers") && off.fold(0.0, f64::max) < 0.011
    });
    assert_ne!(tool.desired().expect("it has one").joints, bare);
}

#[test]
fn targets_that_follow_one_another_quickly_move_the_tool() {
    let (_arm, tool) = controller();
    tool.go_to(PLACE, Some(0.5)).expect("it goes");
    assert!(
        tool.wait_motion_done(Duration::from_millis(5), TEST_TIMEOUT)
            .expect("it answers")
    );
    let place = || tool.pose().expect("it is here").pose.position;
    let start = place();
    // Each would take a second; one comes whenever the pose is a new one.
    let goal = [0.4, -0.1, 0.45];
    eventually("the way", || {
        tool.go_to(Target::Position(goal), Some(1.0))
            .expect("it goes");
        let now = place();
        now[1] < start[1] - 0.1
    });
}

#[test]
fn joints_that_are_not_used_stay() {
    let (arm, tool) = controller();
    let before = positions(&arm);
    let dof = tool
        .set_dof(&[None, None, Some(false)])
        .expect("it has these");
    assert!(!dof[2]);
    tool.go_to(PLACE, Some(0.5)).expect("it goes");
    assert!(
        tool.wait_motion_done(Duration::from_millis(5), TEST_TIMEOUT)
            .expect("it answers")
    );
    let after = positions(&arm);
    assert_eq!(after[2], before[2]);
    assert!((after[1] - before[1]).abs() > 1.0);
    let modes = arm.control_modes(Axes::One(2.into())).expect("it is here");
    assert_ne!(modes, [Mode::PositionDirect]);
}

#[test]
fn an_arm_with_four_joints_brings_its_tool_to_places() {
    let parameters = yarp_devices::wam::parameters();
    let arm = SimulatedWam::with_axes(parameters.into_iter().take(4));
    let chain = WamModel::<4>::new().chain;
    let tool = CartesianController::start(Arc::new(arm), chain, CartesianOptions::new());
    let tool = tool.expect("it is an arm");
    tool.go_to(PLACE, Some(0.5)).expect("it goes");
    assert!(
        tool.wait_motion_done(Duration::from_millis(5), TEST_TIMEOUT)
            .expect("it answers")
    );
    let reached = tool.desired().expect("it has a target").pose.position;
    let off = reached
        .iter()
        .zip([0.4, 0.1, 0.4])
        .map(|(now, then)| (now - then).abs());
    assert!(off.fold(0.0, f64::max) < 1e-4, "{reached:?}");
}

#[test]
fn what_is_no_arm_of_that_kind_is_refused() {
    struct Nothing;
    impl Device for Nothing {}
    let start = |device: Arc<dyn Device>| {
        let chain = WamModel::<4>::new().chain;
        CartesianController::start(device, chain, CartesianOptions::new()).map(drop)
    };
    assert!(matches!(
        start(Arc::new(Nothing)),
        Err(DeviceError::NotSupported { .. })
    ));
    let seven = Arc::new(SimulatedWam::new());
    assert!(matches!(start(seven), Err(DeviceError::WrongCount { .. })));
}

/// Checks the documented defaults: 2 s for a motion, 1 cm, and the middles of the joints' ranges as rest posture.
#[test]
fn the_settings_at_the_start_are_those_documented() {
    let (_arm, tool) = controller();
    assert_eq!(tool.trajectory_time().unwrap(), 2.0);
    assert_eq!(tool.tolerance().unwrap(), 0.01);
    assert!(!tool.tracking().unwrap() && !tool.reference_mode().unwrap());
    let rest = tool.rest_positions().unwrap();
    let middles = [0.0, 0.0, 0.0, 1.115, -1.76, 0.0, 0.0].map(f64::to_degrees);
    for (rest, middle) in rest.iter().zip(middles) {
        assert!((rest - middle).abs() < 1e-9, "{rest}, not {middle}");
    }
}

#[test]
fn a_time_out_of_its_range_is_refused() {
    let (arm, tool) = controller();
    let before = positions(&arm);
    for time in [0.04, 601.0] {
        assert!(tool.go_to(PLACE, Some(time)).is_err(), "{time} s");
        assert!(tool.set_trajectory_time(time).is_err(), "{time} s");
    }
    assert!(tool.motion_done().unwrap());
    assert_eq!(positions(&arm), before);
    for time in [0.05, 600.0] {
        tool.set_trajectory_time(time).unwrap();
    }
}

/// A metre is no tolerance any more; that of the solver is at most a centimetre.
#[test]
fn tolerances_and_iterations_out_of_their_ranges_are_refused() {
    let (_arm, tool) = controller();
    for (tolerance, fits) in [(1e-6, true), (9e-7, false), (1.0, true), (1.01, false)] {
        assert_eq!(tool.set_tolerance(tolerance).is_ok(), fits, "{tolerance}");
    }
    for (tolerance, fits) in [(1e-9, true), (9e-10, false), (0.01, true), (0.0101, false)] {
        let change = TweakChange {
            tolerance: Some(tolerance),
            ..TweakChange::default()
        };
        assert_eq!(tool.tweak(change).is_ok(), fits, "{tolerance}");
    }
    for (iterations, fits) in [(1, true), (0, false), (1000, true), (1001, false)] {
        let change = TweakChange {
            iterations: Some(iterations),
            ..TweakChange::default()
        };
        assert_eq!(tool.tweak(change).is_ok(), fits, "{iterations}");
    }
}

/// A rest posture outside the limits would draw the arm onto its stops.
#[test]
fn a_rest_posture_is_within_the_limits() {
    let (_arm, tool) = controller();
    let limits: Vec<_> = (0..7)
        .map(|joint: usize| tool.joint_limits(joint.into()).unwrap())
        .collect();
    for asked in [400.0, -400.0] {
        let kept = tool.set_rest_positions(&[asked; 7]).unwrap();
        for (kept, limits) in kept.iter().zip(&limits) {
            let end = if asked > 0.0 { limits.max } else { limits.min };
            assert!((kept - end).abs() < 1e-9, "{kept} of {limits:?}");
        }
    }
    tool.set_joint_limits(1.into(), Limits::new(-20.0, 30.0))
        .unwrap();
    let rest = tool.rest_positions().unwrap()[1];
    assert!((rest + 20.0).abs() < 1e-9, "{rest}");
}

/// Limits of the device that are closer than those of the model count, at both ends.
#[test]
fn the_limits_of_the_arm_are_those_of_the_controller() {
    let arm = Arc::new(SimulatedWam::new());
    let narrow = Limits::new(-10.0, 15.0);
    arm.set_position_limits(0.into(), narrow).unwrap();
    let chain = WamModel::<7>::new().chain;
    let tool = CartesianController::start(arm, chain, CartesianOptions::new()).unwrap();
    let found = tool.joint_limits(0.into()).unwrap();
    assert!((found.min + 10.0).abs() < 1e-9 && (found.max - 15.0).abs() < 1e-9);
    for wider in [Limits::new(-11.0, 15.0), Limits::new(-10.0, 16.0)] {
        assert!(tool.set_joint_limits(0.into(), wider).is_err(), "{wider:?}");
    }
    tool.go_to(Target::Position([0.1, 0.4, 0.4]), Some(0.5))
        .expect("it is within reach");
    let base = tool.desired().unwrap().joints[0];
    assert!((-10.0 - 1e-6..=15.0 + 1e-6).contains(&base), "{base}");
}

#[test]
fn a_checkpoint_at_the_end_is_told_before_the_end() {
    let (_arm, tool) = controller();
    tool.register_checkpoint(1.0).unwrap();
    let events = tool.events().unwrap();
    tool.go_to(PLACE, Some(0.3)).unwrap();
    let mut told = false;
    loop {
        match events.recv_timeout(TEST_TIMEOUT).expect("an event") {
            CartesianEvent::Ongoing { checkpoint, .. } => told |= checkpoint == 1.0,
            CartesianEvent::Done { .. } => break,
            _ => {}
        }
    }
    assert!(told);
}
