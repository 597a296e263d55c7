//! The hand's four axes, over a pseudo-terminal, keep the contracts of the interfaces as a hand can.
#![cfg(unix)]

use crate::hand_support;

use hand_support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::hand::HandBoard;
use yarp_devices::hand::gcl::Motor;
use yarp_devices::hand::simulated::{Object, SimulatedHandOptions};
use yarp_devices::{
    Axes, AxisIndex, ControlLimits, ControlMode, DeviceError, Encoders, Grasp, Hand, Limits, Mode,
    MotionControl, PositionControl, VelocityControl, checks,
};

const FIRST: Axes<'static> = Axes::One(AxisIndex::new(0));
const SPREAD: Axes<'static> = Axes::One(AxisIndex::new(3));

/// Runs at the speed of a hand: control rounds run in real time.
fn stage() -> Stage {
    Stage::with(SimulatedHandOptions::new())
}

fn board(stage: &Stage) -> HandBoard {
    let board = HandBoard::start(stage.open()).expect("it starts");
    board.initialise().expect("nothing is in its way");
    // At once, without waiting for anything else.
    assert_eq!(board.control_modes(Axes::All).unwrap(), [Mode::Position; 4]);
    board
}

fn is_in(board: &HandBoard, mode: Mode) {
    eventually("a mode", || {
        board.control_modes(Axes::All).unwrap() == [mode; 4]
    });
}

fn at(board: &HandBoard, axes: Axes<'_>) -> f64 {
    board.encoder_readings(axes).unwrap()[0].position
}

fn done(board: &HandBoard) {
    eventually("the end of a motion", || {
        board.motion_done(Axes::All).unwrap()
    });
}

#[test]
fn axes_go_where_they_are_sent() {
    let stage = stage();
    let board = board(&stage);
    board
        .position_move(Axes::All, &[45.0, 30.0, 0.0, 90.0])
        .unwrap();
    done(&board);
    let readings = board.encoder_readings(Axes::All).unwrap();
    for (reading, target) in readings.iter().zip([45.0, 30.0, 0.0, 90.0]) {
        assert!((reading.position - target).abs() < 0.3, "{readings:?}");
    }
    board.relative_move(SPREAD, &[-30.0]).unwrap();
    done(&board);
    assert!((at(&board, SPREAD) - 60.0).abs() < 0.6);
    // Replies of the hand itself.
    let told = Hand::finger_positions(&board).unwrap();
    assert!(
        (told[0] - 45.0).abs() < 0.3 && (told[3] - 60.0).abs() < 0.6,
        "{told:?}"
    );
}

#[test]
fn a_velocity_moves_an_axis_until_it_is_stopped() {
    let stage = stage();
    let board = board(&stage);
    board.set_control_modes(FIRST, &[Mode::Velocity]).unwrap();
    board.velocity_move(FIRST, &[20.0]).unwrap();
    eventually("an axis under way", || at(&board, FIRST) > 5.0);
    board.stop(FIRST).unwrap();
    done(&board);
    let here = at(&board, FIRST);
    assert!((4.0..=140.0).contains(&here));
    assert_eq!(board.reference_velocities(FIRST).unwrap(), [0.0]);
}

#[test]
fn an_axis_that_meets_something_stays_there() {
    let stage = stage();
    let board = board(&stage);
    let object = Object {
        inner: 20.0,
        outer: 0.0,
        torque: 0.1,
    };
    stage.there.set_object(Motor::F1, Some(object));
    board.position_move(FIRST, &[60.0]).unwrap();
    done(&board);
    assert!((at(&board, FIRST) - 20.0).abs() < 0.3);
    assert!((board.target_positions(FIRST).unwrap()[0] - 20.0).abs() < 0.3);
}

#[test]
fn nothing_moves_before_the_hand_is_initialised() {
    let stage = stage();
    let board = HandBoard::start(stage.open()).unwrap();
    is_in(&board, Mode::NotConfigured);
    assert!(matches!(
        board.position_move(FIRST, &[10.0]),
        Err(DeviceError::Held { .. })
    ));
    assert!(board.set_control_modes(FIRST, &[Mode::Velocity]).is_err());
    assert!(board.close_fingers().is_err());
    assert_eq!(stage.there.travelled(), [0.0; 4]);
    board.initialise().unwrap();
    is_in(&board, Mode::Position);
}

#[test]
fn a_grasp_takes_the_hand_over_and_gives_it_back() {
    let stage = stage();
    let board = board(&stage);
    board.close_fingers().unwrap();
    done(&board);
    // They had been opened again as far as their axes go, and on a slow machine farther. Its counters are whole
    // numbers: the hand is there as soon as half a count is missing.
    let counters = stage.there.positions().map(f64::round);
    assert_eq!(counters[..3], [17800.0; 3]);
    assert!(at(&board, FIRST) > 139.0);
    board.position_move(FIRST, &[100.0]).unwrap();
    done(&board);
    assert!((at(&board, FIRST) - 100.0).abs() < 0.3);
    assert_eq!(board.send_command("PGET BAUD").unwrap(), "96");
}

#[test]
fn a_line_that_breaks_is_a_fault_and_no_move_is_resumed() {
    let stage = stage();
    let board = board(&stage);
    board.position_move(FIRST, &[100.0]).unwrap();
    eventually("an axis under way", || at(&board, FIRST) > 1.0);
    stage.there.disconnect_line();
    is_in(&board, Mode::HardwareFault);
    assert!(matches!(
        board.position_move(FIRST, &[10.0]),
        Err(DeviceError::Held { .. })
    ));
    stage.there.reconnect_line().unwrap();
    is_in(&board, Mode::Idle);
    let stopped = stage.there.travelled();
    assert!(board.position_move(FIRST, &[10.0]).is_err(), "it is idle");
    board
        .set_control_modes(Axes::All, &[Mode::Position; 4])
        .unwrap();
    eventually("newer readings", || board.motion_done(Axes::All).unwrap());
    assert_eq!(stage.there.travelled(), stopped);
    board.position_move(FIRST, &[10.0]).unwrap();
    done(&board);
    assert!((at(&board, FIRST) - 10.0).abs() < 0.3);
}

/// The data sheet: 140 degrees of a finger take a second, 180 of the spread half a second.
#[test]
fn the_limits_are_those_of_the_data_sheet() {
    let stage = stage();
    let board = HandBoard::start(stage.open()).unwrap();
    for finger in 0..3 {
        let limits = board.position_limits(finger.into()).unwrap();
        assert_eq!(limits, Limits::new(0.0, 140.0));
        let speeds = board.velocity_limits(finger.into()).unwrap();
        // What a signed byte of 100 counts/s can say: 12700 counts/s, 125 for each degree.
        assert_eq!(speeds, Limits::new(0.0, 100.0));
    }
    let limits = board.position_limits(3.into()).unwrap();
    assert_eq!(limits, Limits::new(0.0, 180.0));
    let speeds = board.velocity_limits(3.into()).unwrap();
    assert_eq!(speeds, Limits::new(0.0, 360.0));
}

/// The line breaks and the hand loses its power: once it is initialised again its axes are idle, as after any loss.
#[test]
fn a_hand_that_lost_its_power_with_its_line_is_idle_when_it_is_back() {
    let stage = stage();
    let board = board(&stage);
    stage.there.disconnect_line();
    is_in(&board, Mode::HardwareFault);
    stage.there.restart();
    stage.there.reconnect_line().unwrap();
    // The second reply comes after the board has found the hand not initialised.
    for _ in 0..2 {
        eventually("an answer", || board.send_command("VERS").is_ok());
    }
    is_in(&board, Mode::HardwareFault);
    board.initialise().unwrap();
    is_in(&board, Mode::Idle);
}

#[test]
fn contracts_that_need_no_exact_place_are_kept() {
    let stage = stage();
    let board = board(&stage);
    for check in [
        checks::axes_have_names,
        checks::readings_carry_fresh_times,
        checks::a_bad_target_for_one_moves_none,
        checks::references_are_kept,
        checks::too_hard_is_as_hard_as_it_can,
        checks::modes_are_kept,
    ] {
        check(&board, TEST_TIMEOUT);
    }
}
