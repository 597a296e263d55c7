//! A finger of a simulated hand, on a serial line, moved from the other end of a network.
#![cfg(unix)]

use crate::support;

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::hand::simulated::{SimulatedHand, SimulatedHandOptions};
use yarp_devices::hand::{BarrettHand, HandBoard, HandOptions};
use yarp_devices::{Axes, AxisIndex, Device, Hand, Mode};
use yarp_wire::WireVersion;
use yarp_wrappers::control_board::messages::MotionEnd;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

const SECOND: Axes<'static> = Axes::One(AxisIndex::new(1));

fn a_finger_is_moved(wire_version: WireVersion) {
    let stage = Stage::new();
    let there = SimulatedHand::start(SimulatedHandOptions::new()).expect("it starts");
    let options = HandOptions::new(there.path())
        .echo_timeout(TEST_TIMEOUT / 6)
        .motion_timeout(TEST_TIMEOUT)
        .block_timeout(TEST_TIMEOUT);
    let hand = BarrettHand::open(options).expect("a hand answers");
    let board = HandBoard::start(hand).expect("it starts");
    board.initialise().expect("nothing is in its way");
    let server = stage.serve("/hand", board);
    let options = RemoteControlBoardOptions::new("/hand", "/tester").wire_version(wire_version);
    let hand = RemoteControlBoard::open(&stage.network, options).expect("it can be reached");

    let info = hand.axis_info().expect("it has axes");
    assert_eq!(info.axes(), 4);
    assert_eq!(info.axis_name(3.into()).expect("it has a name"), "spread");
    let modes = hand.control_mode().expect("it has modes");
    eventually("position mode", || {
        modes
            .control_modes(Axes::All)
            .is_ok_and(|modes| modes == [Mode::Position; 4])
    });
    let position = hand.position_control().expect("it moves point to point");
    position
        .position_move(SECOND, &[40.0])
        .expect("it is allowed");
    let encoders = hand.encoders().expect("it has encoders");
    // The finger itself too: on a busy machine it passes its target once and comes back.
    eventually("the finger at 40 degrees", || {
        encoders
            .encoder_readings(SECOND)
            .is_ok_and(|readings| (readings[0].position - 40.0).abs() < 0.3)
            && (there.positions()[1] - 5000.0).abs() < 50.0
    });
    assert_eq!(there.positions()[0], 0.0, "no other finger moves");
    assert!(position.position_move(SECOND, &[141.0]).is_err());
    let motion = hand
        .position_move_numbered(SECOND, &[20.0])
        .expect("it moves");
    assert_eq!(motion.wait(TEST_TIMEOUT).expect("it ends"), MotionEnd::Done);
    // The newest state may be from before its end.
    eventually("the finger at 20 degrees", || {
        encoders
            .encoder_readings(SECOND)
            .is_ok_and(|readings| (readings[0].position - 20.0).abs() < 0.3)
    });
    drop(hand);
    stage.runtime.block_on(server.close());
}

#[test]
fn by_a_client_of_3() {
    a_finger_is_moved(WireVersion::V3);
}

#[test]
fn by_a_client_of_4() {
    a_finger_is_moved(WireVersion::V4);
}
