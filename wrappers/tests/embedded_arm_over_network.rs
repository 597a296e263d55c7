//! The arm behind its embedded PC, served on a network: driver, server and client in a row, each over TCP.

use crate::support;

use std::sync::Arc;

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::embedded::{DriverOptions, EmbeddedWam, LinkMode, NodeOptions, WamNode};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, Device, Mode, PositionControl, VariableValue, checks};

#[test]
fn our_client_drives_it_over_the_network() {
    let stage = Stage::new();
    let driver = EmbeddedWam::start(DriverOptions {
        timeout: TEST_TIMEOUT,
        max_state_age: TEST_TIMEOUT,
        ..DriverOptions::new(LinkMode::listen_on_loopback())
    })
    .expect("there are ports");
    let node = WamNode::start(
        Arc::new(SimulatedWam::new()),
        NodeOptions {
            timeout: TEST_TIMEOUT,
            idle_timeout: TEST_TIMEOUT,
            ..NodeOptions::new(LinkMode::Connect(driver.addresses()))
        },
    )
    .expect("it starts");
    eventually("an arm at rest", || {
        matches!(driver.motion_done(Axes::All), Ok(true))
    });
    let server = stage.serve("/wam", driver);
    let arm = stage.remote("/client");
    for check in [
        checks::axes_have_names,
        checks::readings_carry_fresh_times,
        checks::limits_are_kept,
        checks::a_relative_move_adds_up,
        checks::a_group_move_leaves_the_others_alone,
        checks::a_stop_ends_a_move,
        checks::a_malformed_command_is_refused,
    ] {
        check(&arm, TEST_TIMEOUT);
    }
    // What only the protocol has: the pose of the tool, as a variable.
    let variables = arm.remote_variables().expect("it has variables");
    let pose = variables.variable("pose").expect("it is told");
    assert_eq!(pose.len(), 6);
    assert_eq!(
        variables.variable("link").expect("it is told")[0],
        VariableValue::Text("up".to_owned())
    );
    let position = arm.position_control().expect("it moves");
    let home = arm.remote_calibrator().expect("it goes home");
    home.home(Axes::All).expect("it takes the command");
    eventually("the way home", || {
        position.motion_done(Axes::All).unwrap_or(false)
    });
    // Refused by the protocol, reported over the network.
    assert!(
        position
            .set_reference_speeds(Axes::One(0.into()), &[5.0])
            .is_err()
    );
    // The PC disconnects: the modes report it, and moves are refused.
    drop(node);
    let modes = arm.control_mode().expect("it has modes");
    eventually("a fault", || {
        modes
            .control_modes(Axes::One(0.into()))
            .is_ok_and(|modes| modes == [Mode::HardwareFault])
    });
    assert!(position.position_move(Axes::One(0.into()), &[1.0]).is_err());
    drop(arm);
    stage.runtime.block_on(server.close());
}
