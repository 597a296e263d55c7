//! The controller of a tool on the simulated arm, and what it does when the arm is taken from it.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::wam::{SimulatedWam, WamModel};
use yarp_devices::{
    Axes, CartesianControl, CartesianEvent, ControlMode, Device, DeviceError, Encoders, Mode,
    Target, checks,
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
