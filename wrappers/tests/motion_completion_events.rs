//! The end of a move is announced to its client, and never that of another.

use crate::support;

use std::time::Duration;

use support::{Stage, TEST_TIMEOUT};
use yarp_devices::{
    Axes, AxisIndex, ControlMode, DeviceError, Mode, MotionControl, PositionControl,
};
use yarp_ports::{PortOptions, Queue, remote_admin};
use yarp_wire::WireVersion;
use yarp_wrappers::control_board::messages::MotionEnd;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

const JOINT: Axes<'static> = Axes::One(AxisIndex::new(0));

/// A client, on whose board joint 0 is so slow that a move of many degrees does not end by itself.
fn slow_arm(stage: &Stage, local: &str) -> RemoteControlBoard {
    let options = RemoteControlBoardOptions::new("/wam", local).rpc_timeout(TEST_TIMEOUT);
    let arm = RemoteControlBoard::open(&stage.network, options).expect("it can be reached");
    arm.set_reference_speeds(JOINT, &[0.01])
        .expect("it answers");
    arm
}

#[test]
fn an_end_is_announced_to_readers_and_to_who_waits() {
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        let stage = Stage::new();
        let server = stage.serve_arm();
        let reader = stage.port("/person", PortOptions::new().queue(Queue::Wait(100)));
        let connecting = remote_admin::connect(&stage.network, "/wam/async:o", "/person", None);
        stage.runtime.block_on(connecting).expect("it can be read");
        let options = RemoteControlBoardOptions::new("/wam", "/me").wire_version(wire_version);
        let arm = RemoteControlBoard::open(&stage.network, options.rpc_timeout(TEST_TIMEOUT))
            .expect("it can be reached");
        // The second leads to where the joint is already.
        for _ in 0..2 {
            let motion = arm.position_move_numbered(JOINT, &[0.5]).expect("it moves");
            assert_eq!(motion.wait(TEST_TIMEOUT).expect("it ends"), MotionEnd::Done);
            let reading = async { tokio::time::timeout(TEST_TIMEOUT, reader.read()).await };
            let message = stage
                .runtime
                .block_on(reading)
                .expect("in time")
                .expect("open");
            let text = message.bottle().expect("a bottle").to_string();
            assert_eq!(text, format!("[done] {} (0)", motion.number()));
        }
        assert!(arm.motion_done(JOINT).expect("it answers"));
        drop(arm);
        stage.runtime.block_on(server.close());
        assert_eq!(stage.registered(), ["/person"]);
    }
}

/// One axis, several and all, as the words of 3.x and the calls of 4.0 have a form for each.
#[test]
fn relative_moves_have_numbers_too() {
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        let stage = Stage::new();
        let server = stage.serve_arm();
        let options = RemoteControlBoardOptions::new("/wam", "/me").wire_version(wire_version);
        let arm = RemoteControlBoard::open(&stage.network, options.rpc_timeout(TEST_TIMEOUT))
            .expect("it can be reached");
        // The first reply is a float: a 4.0 client of ours could not read it, as it was encoded for 3.x.
        let start = arm.target_positions(JOINT).expect("it answers")[0];
        let some = [AxisIndex::new(0), AxisIndex::new(4)];
        let selections: [(Axes<'_>, &[f64]); 3] = [
            (JOINT, &[0.5]),
            (Axes::Group(&some), &[0.5, 0.5]),
            (Axes::All, &[0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ];
        let mut before = 0;
        for (axes, distances) in selections {
            let motion = arm
                .relative_move_numbered(axes, distances)
                .expect("it moves");
            assert_eq!(motion.wait(TEST_TIMEOUT).expect("it ends"), MotionEnd::Done);
            assert!(motion.number() > before);
            before = motion.number();
        }
        let end = arm.target_positions(JOINT).expect("it answers")[0];
        assert!((end - start - 1.5).abs() < 1e-9, "{start} {end}");
        let error = arm.relative_move_numbered(JOINT, &[0.5, 0.5]);
        assert!(matches!(error, Err(DeviceError::WrongCount { .. })));
        let error = arm.relative_move_numbered(JOINT, &[f64::NAN]);
        assert!(matches!(error, Err(DeviceError::NotFinite { .. })));
        let far = arm.relative_move_numbered(JOINT, &[999.0]);
        assert!(far.expect_err("too far").to_string().contains("999"));
        drop(arm);
        stage.runtime.block_on(server.close());
    }
}

#[test]
fn a_move_of_another_client_is_not_taken_for_ones_own() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let (mine, other) = (slow_arm(&stage, "/mine"), slow_arm(&stage, "/other"));
    let first = mine
        .position_move_numbered(JOINT, &[50.0])
        .expect("it moves");
    let second = other
        .position_move_numbered(JOINT, &[40.0])
        .expect("it moves");
    let by = second.number();
    let end = first.wait(TEST_TIMEOUT).expect("it ends");
    assert_eq!(end, MotionEnd::Superseded { by });
    assert!(second.wait(Duration::ZERO).is_err(), "it is under way");
    // Also by a client that does not use numbers.
    mine.position_move(JOINT, &[30.0]).expect("it moves");
    let end = second.wait(TEST_TIMEOUT).expect("it ends");
    assert!(matches!(end, MotionEnd::Superseded { by } if by > second.number()));
    drop((mine, other));
    stage.runtime.block_on(server.close());
}

#[test]
fn a_stop_and_a_change_of_mode_end_a_move_unfinished() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let arm = slow_arm(&stage, "/me");
    let motion = arm
        .position_move_numbered(JOINT, &[50.0])
        .expect("it moves");
    arm.stop(JOINT).expect("it answers");
    assert_eq!(
        motion.wait(TEST_TIMEOUT).expect("it ends"),
        MotionEnd::Stopped
    );
    let motion = arm
        .position_move_numbered(JOINT, &[50.0])
        .expect("it moves");
    arm.set_control_modes(JOINT, &[Mode::Idle])
        .expect("it answers");
    let end = motion.wait(TEST_TIMEOUT).expect("it ends");
    assert!(matches!(end, MotionEnd::Failed { .. }), "{end:?}");
    // A move that the device refuses never began, and the reason is reported.
    let error = arm
        .position_move_numbered(JOINT, &[50.0])
        .expect_err("idle");
    assert!(error.to_string().contains("idle"), "{error}");
    drop(arm);
    stage.runtime.block_on(server.close());
}

#[test]
fn an_end_whose_announcement_was_lost_is_asked_for() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let arm = slow_arm(&stage, "/me");
    let motion = arm
        .position_move_numbered(JOINT, &[50.0])
        .expect("it moves");
    let disconnecting = remote_admin::disconnect(&stage.network, "/wam/async:o", "/me/async:i");
    stage
        .runtime
        .block_on(disconnecting)
        .expect("it was connected");
    arm.stop(JOINT).expect("it answers");
    // From async code, too.
    let end = stage.runtime.block_on(motion.ended(TEST_TIMEOUT));
    assert_eq!(end.expect("it ends"), MotionEnd::Stopped);
    drop(arm);
    stage.runtime.block_on(server.close());
}

#[test]
fn a_server_that_was_started_again_does_not_credit_its_moves_to_older_ones() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let arm = slow_arm(&stage, "/me");
    let motion = arm
        .position_move_numbered(JOINT, &[50.0])
        .expect("it moves");
    stage.runtime.block_on(server.close());
    let server = stage.serve_arm();
    let other = stage.remote("/other");
    let newer = other
        .position_move_numbered(JOINT, &[0.5])
        .expect("it moves");
    assert_eq!(newer.wait(TEST_TIMEOUT).expect("it ends"), MotionEnd::Done);
    let error = motion.wait(TEST_TIMEOUT).expect_err("nobody knows");
    assert!(error.to_string().contains("does not know"), "{error}");
    drop((arm, other));
    stage.runtime.block_on(server.close());
}

#[test]
fn a_board_without_the_port_is_said_to_have_no_numbers() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let arm = stage.remote("/me");
    // As if it were a board of stock.
    let unregistering = async {
        let network = stage.network.clone();
        network.unregister("/wam/async:o").await
    };
    stage.runtime.block_on(unregistering).expect("it was there");
    let error = arm.position_move_numbered(JOINT, &[1.0]).expect_err("none");
    assert!(error.to_string().contains("not supported"), "{error}");
    drop(arm);
    stage.runtime.block_on(server.close());
}
