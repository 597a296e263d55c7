//! An abort was lost when it came while a command was typed, between the lines of a grasp, or before a board had begun.
#![cfg(unix)]

use crate::hand_support;

use std::thread;

use hand_support::{Stage, eventually};
use yarp_devices::hand::gcl::{Motor, Status};
use yarp_devices::hand::{GclConnection, HandBoard, HandError};
use yarp_devices::{Axes, ControlMode, Grasp, Hand, Mode, PositionControl};

/// Aborts `lines` when the hand has been sent `sent`, of which it has received all but the last byte. None of these
/// motors may move.
fn aborted(lines: &[&str], sent: &str, resting: &[Motor]) {
    let stage = Stage::new();
    let hand = stage.ready();
    let before = stage.there.travelled();
    stage.there.set_unresponsive_from(Some(sent.as_bytes()));
    let lines: Vec<String> = lines.iter().map(ToString::to_string).collect();
    thread::scope(|scope| {
        let running = scope.spawn(|| GclConnection::run(&hand, &lines));
        eventually("a command under way", || stage.there.is_unresponsive());
        Hand::abort(&hand).unwrap();
        stage.there.set_unresponsive_from(None);
        let outcome = running.join().unwrap();
        let status = outcome.as_ref().map_err(HandError::status);
        assert_eq!(status, Err(Some(Status::ABORTED)), "{outcome:?}");
    });
    // The next command finds the hand at rest.
    hand.finger_positions().unwrap();
    let after = stage.there.travelled();
    for motor in resting {
        assert_eq!(after[motor.index()], before[motor.index()], "{motor:?}");
    }
    hand.close_fingers().unwrap();
}

#[test]
fn while_a_command_is_typed() {
    aborted(&["GC"], "GC", &Motor::ALL);
}

#[test]
fn while_the_second_command_of_a_grasp_is_typed() {
    let fingers = [Motor::F1, Motor::F2, Motor::F3];
    aborted(&["SM 1500", "12M 8000"], "12M", &fingers);
}

#[test]
fn while_a_command_ends_by_itself_before_another() {
    aborted(&["PGET BAUD", "12C"], "BAUD\r", &Motor::ALL);
}

#[test]
fn before_a_board_has_begun_with_a_command() {
    let stage = Stage::new();
    let board = HandBoard::start(stage.open()).unwrap();
    board.initialise().unwrap();
    eventually("axes at rest", || board.motion_done(Axes::All).unwrap());
    let before = stage.there.travelled();
    // In the middle of a round of RealTime, so that the board can begin with nothing else.
    stage.there.set_unresponsive_from(Some(b""));
    eventually("a round under way", || stage.there.is_unresponsive());
    thread::scope(|scope| {
        let closing = scope.spawn(|| board.close_fingers());
        eventually("a command that waits", || {
            !board.motion_done(Axes::All).unwrap()
        });
        Hand::abort(&board).unwrap();
        closing.join().unwrap().expect_err("it was aborted");
    });
    stage.there.set_unresponsive_from(None);
    eventually("axes at rest", || board.motion_done(Axes::All).unwrap());
    board.finger_positions().unwrap();
    assert_eq!(stage.there.travelled(), before);
    let modes = board.control_modes(Axes::All).unwrap();
    assert_eq!(modes, [Mode::Position; 4], "nothing is wrong with the line");
    board.close_fingers().unwrap();
}
