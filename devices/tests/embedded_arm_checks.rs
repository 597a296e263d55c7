//! An arm behind its embedded PC, over real TCP and with either end listening, behaves as an arm must.

use crate::embedded;

use embedded::{Listens, TEST_TIMEOUT, at_rest, connected, driver, eventually, ideal_arm, place};
use yarp_devices::checks::{self, Check};
use yarp_devices::embedded::{CartesianPose, LinkMode, LinkState, NodeOptions, WamNode};
use yarp_devices::{
    Axes, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, Limits, Mode, MotionControl,
    PositionControl, RemoteCalibrator, RemoteVariables, VariableValue,
};

fn over_tcp(listens: Listens, checks: &[Check]) {
    let (driver, node) = connected(ideal_arm(), listens);
    for check in checks {
        check(&driver, TEST_TIMEOUT);
        at_rest(&driver);
    }
    drop(driver);
    eventually("a goodbye", || {
        node.status().last_end.as_deref() == Some("closed as agreed (shu)")
    });
}

#[test]
fn joints_move_and_stop_when_the_driver_listens() {
    over_tcp(
        Listens::Driver,
        &[
            checks::axes_have_names,
            checks::readings_carry_fresh_times,
            checks::limits_are_kept,
            checks::a_move_ends_at_its_target,
            checks::a_relative_move_adds_up,
        ],
    );
}

#[test]
fn groups_move_and_bad_commands_do_not_when_the_node_listens() {
    over_tcp(
        Listens::Node,
        &[
            checks::a_group_move_leaves_the_others_alone,
            checks::a_new_target_replaces_the_old,
            checks::a_stop_ends_a_move,
            checks::a_bad_target_for_one_moves_none,
            checks::a_malformed_command_is_refused,
        ],
    );
}

#[test]
fn the_end_of_a_move_is_told_and_the_tool_is_where_the_joints_say() {
    let arm = ideal_arm();
    let (driver, _node) = connected(arm.clone(), Listens::Driver);
    driver
        .position_move(Axes::All, &[5.0, -100.0, 5.0, 150.0, 5.0, 5.0, 5.0])
        .unwrap();
    at_rest(&driver);
    assert!((place(arm.as_ref(), 1) + 100.0).abs() < 1e-9);

    let start = driver.pose().unwrap();
    let [x, y, z] = start.place;
    let target = CartesianPose {
        place: [x + 0.02, y, z - 0.03],
        turn: start.turn,
    };
    driver.move_to(target).unwrap();
    at_rest(&driver);
    let end = driver.pose().unwrap();
    for (end, target) in end.place.iter().zip(target.place) {
        assert!((end - target).abs() < 1e-5, "{end} and {target} m");
    }
    assert_eq!(driver.link().last_interruption, None);
}

#[test]
fn homing_brings_all_joints_home() {
    let arm = ideal_arm();
    let (driver, _node) = connected(arm.clone(), Listens::Node);
    let home = place(arm.as_ref(), 3);
    driver.position_move(Axes::One(3.into()), &[170.0]).unwrap();
    at_rest(&driver);
    assert!(driver.calibrator_present().unwrap());
    driver.home(Axes::All).unwrap();
    at_rest(&driver);
    assert!((place(arm.as_ref(), 3) - home).abs() < 1e-9);
    assert!(driver.home(Axes::One(3.into())).is_err());
}

#[test]
fn a_newer_move_ends_the_older_one_and_a_pose_out_of_reach_leaves_it() {
    let arm = ideal_arm();
    let base = Axes::One(0.into());
    // So slow that no move of this test ends by itself.
    arm.set_reference_speeds(base, &[1.0]).unwrap();
    let (driver, node) = connected(arm, Listens::Driver);
    driver.position_move(base, &[140.0]).unwrap();
    let far = CartesianPose {
        place: [5.0, 0.0, 0.0],
        turn: [0.0; 3],
    };
    let refused = driver.move_to(far).unwrap_err();
    assert!(matches!(refused, DeviceError::Refused { .. }), "{refused}");
    assert!(refused.to_string().contains("moving to a pose (moc)"));
    assert_eq!(driver.target_positions(base).unwrap(), [140.0]);
    assert!(!driver.motion_done(base).unwrap());
    driver.position_move(base, &[-140.0]).unwrap();
    assert_eq!(driver.target_positions(base).unwrap(), [-140.0]);
    eventually("the way back", || place(&driver, 0) < -0.1);
    assert!(!driver.motion_done(base).unwrap());
    driver.stop(Axes::All).unwrap();
    at_rest(&driver);
    assert!(place(&driver, 0) > -100.0);
    assert_eq!(node.status().refused, 1);
    let bad = CartesianPose {
        place: [f64::NAN; 3],
        turn: [0.0; 3],
    };
    assert!(matches!(
        driver.move_to(bad),
        Err(DeviceError::NotFinite { .. })
    ));
}

#[test]
fn what_the_protocol_has_no_words_for_is_refused() {
    let (driver, _node) = connected(ideal_arm(), Listens::Driver);
    let base = Axes::One(0.into());
    let refused = |outcome: Result<(), DeviceError>| {
        let error = outcome.unwrap_err();
        assert!(matches!(error, DeviceError::NotSupported { .. }), "{error}");
        assert!(error.to_string().contains("has no message"), "{error}");
    };
    refused(driver.set_reference_speeds(base, &[10.0]));
    refused(driver.set_reference_accelerations(base, &[10.0]));
    refused(driver.reference_speeds(base).map(drop));
    refused(driver.encoders().unwrap().set_encoders(base, &[0.0]));
    refused(driver.set_velocity_limits(0.into(), Limits::new(0.0, 1.0)));
    refused(driver.park(Axes::All));
    assert!(matches!(
        driver.set_control_modes(base, &[Mode::Velocity]),
        Err(DeviceError::NoSuchMode { .. })
    ));
    assert_eq!(
        driver.available_control_modes(0.into()).unwrap(),
        [Mode::Position, Mode::PositionDirect]
    );
    assert!(driver.velocity_control().is_none() && driver.torque_control().is_none());
}

#[test]
fn variables_tell_the_pose_and_the_connection() {
    let (driver, _node) = connected(ideal_arm(), Listens::Driver);
    let names = driver.variables().unwrap();
    assert_eq!(names, ["pose", "link", "failure", "interruption"]);
    for name in &names {
        assert!(!driver.variable(name).unwrap().is_empty());
    }
    let link = driver.variable("link").unwrap();
    assert_eq!(
        link[..2],
        [VariableValue::Text("up".into()), VariableValue::Integer(1)]
    );
    driver
        .position_move(Axes::All, &[0.0, -100.0, 0.0, 150.0, 0.0, 5.0, 0.0])
        .unwrap();
    at_rest(&driver);
    let pose = driver.variable("pose").unwrap();
    assert_eq!(pose.len(), 6);
    driver
        .set_variable("pose", &[VariableValue::List(pose)])
        .unwrap();
    assert!(driver.set_variable("pose", &[]).is_err());
    assert!(driver.set_variable("link", &[]).is_err());
    assert!(driver.variable("no such variable").is_err());
}

#[test]
fn before_a_connection_every_call_says_so() {
    let driver = driver();
    assert_eq!(driver.axes(), 7);
    let modes = driver.control_modes(Axes::One(0.into())).unwrap();
    assert_eq!(modes, [Mode::HardwareFault]);
    let link = driver.link();
    assert_eq!((link.state, link.sessions), (LinkState::Down, 0));
    let told = [
        driver.position_move(Axes::One(0.into()), &[0.0]),
        driver.stop(Axes::All),
        driver.motion_done(Axes::All).map(drop),
        driver.pose().map(drop),
        driver.move_home(),
    ];
    for error in told.map(Result::unwrap_err) {
        let text = error.to_string();
        assert!(text.contains("yarp wam-node"), "{text}");
    }
    assert!(matches!(
        driver.encoders().unwrap().encoder_readings(Axes::All),
        Err(DeviceError::NoDataYet { .. })
    ));
}

#[test]
fn a_second_client_is_turned_away_and_the_first_goes_on() {
    let (driver, node) = connected(ideal_arm(), Listens::Driver);
    let mut strangers = embedded::connect(driver.addresses());
    let mut byte = [0];
    use std::io::Read;
    assert_eq!(strangers.0.read(&mut byte).unwrap_or(0), 0);
    eventually("a stranger counted", || {
        driver.link().rejected_connections > 0
    });
    assert_eq!((driver.link().sessions, node.status().sessions), (1, 1));
    assert!(driver.pose().is_ok());
}

#[test]
fn ports_that_are_taken_are_named() {
    let first = driver();
    let options = NodeOptions::new(LinkMode::Listen(first.addresses()));
    let error = WamNode::start(ideal_arm(), options).unwrap_err();
    let source = std::error::Error::source(&error).unwrap().to_string();
    assert!(
        source.contains(&first.addresses().arm.to_string()),
        "{source}"
    );
}
