//! Every call ends, even if the other side fails.

use crate::support;

use std::time::{Duration, Instant};

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::{
    Axes, AxisInfo, ControlMode, DeviceError, Encoders, PositionControl, VelocityControl,
};
use yarp_wire::WireVersion;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

#[test]
fn its_state_grows_stale_and_calls_name_it() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let arm = stage.remote("/me");
    eventually("a first state", || arm.encoder_readings(Axes::All).is_ok());

    stage.runtime.block_on(server.close());
    eventually("distrust", || {
        matches!(
            arm.encoder_readings(Axes::All),
            Err(DeviceError::Stale { limit, .. }) if limit == Duration::from_millis(500)
        )
    });
    assert!(matches!(
        arm.control_modes(Axes::All),
        Err(DeviceError::Stale { .. })
    ));
    let begun = Instant::now();
    let message = |outcome: Result<(), DeviceError>| outcome.expect_err("gone").to_string();
    let error = message(arm.position_move(Axes::One(0.into()), &[1.0]));
    assert!(
        error.starts_with("`positionMoveOneRPC 0 1.0` with /wam/nws/rpc:i failed; try "),
        "{error}"
    );
    let error = message(arm.velocity_move(Axes::One(0.into()), &[1.0]));
    assert!(
        error.starts_with("sending a command with /wam/command:i failed; try "),
        "{error}"
    );
    assert!(arm.axis_name(0.into()).is_err());
    assert!(begun.elapsed() < TEST_TIMEOUT / 2);
    drop(arm);
    assert!(stage.registered().is_empty());
}

#[test]
fn a_server_that_is_dropped_lets_its_names_go() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let begun = Instant::now();
    drop(server);
    assert!(
        begun.elapsed() < Duration::from_secs(1),
        "a drop waits for nothing"
    );
    eventually("the end of the names", || stage.registered().is_empty());
}

#[test]
fn when_it_comes_back_it_is_connected_again() {
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        let stage = Stage::new();
        let server = stage.serve_arm();
        let options = RemoteControlBoardOptions::new("/wam", "/me").wire_version(wire_version);
        let arm = RemoteControlBoard::open(&stage.network, options).expect("it is there");
        let sees = || arm.encoder_readings(Axes::All).is_ok();
        eventually("a first state", sees);
        stage.runtime.block_on(server.close());
        eventually("distrust", || !sees());
        assert!(arm.axis_name(0.into()).is_err());

        let server = stage.serve_arm();
        eventually("states again", sees);
        eventually("answers again", || arm.axis_name(0.into()).is_ok());
        arm.set_control_modes(Axes::One(0.into()), &[yarp_devices::Mode::Velocity])
            .expect("it answers");
        eventually("commands again", || {
            let _ = arm.velocity_move(Axes::One(0.into()), &[3.0]);
            arm.reference_velocities(Axes::One(0.into()))
                .is_ok_and(|velocities| velocities == [3.0])
        });
        drop(arm);
        stage.runtime.block_on(server.close());
        assert!(stage.registered().is_empty());
    }
}
