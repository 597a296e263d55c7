//! A hand behind guards: the software stop ends grasps and refuses every command that moves, limits hold for whole-hand
//! commands too, and a velocity without a new command ends.
#![cfg(unix)]

use std::thread;

use yarp_devices::guard::Guarded;
use yarp_devices::hand::HandBoard;
use yarp_devices::{Axes, Device, DeviceError, Grasp, GraspKind, Hand, Mode, SoftwareStop};

use crate::hand_support;

use hand_support::{Stage, eventually};

const FINGER: Axes<'static> = Axes::One(yarp_devices::AxisIndex::new(0));

fn guarded(stage: &Stage) -> Guarded {
    let board = HandBoard::start(stage.open()).unwrap();
    board.initialise().unwrap();
    board.guarded().unwrap()
}

type Outcome = Result<(), DeviceError>;

/// A command with its name.
type Command = (&'static str, fn(&Guarded) -> Outcome);

const MOVING: [Command; 8] = [
    ("initialise", |hand| hand.initialise()),
    ("open_fingers", |hand| hand.open_fingers()),
    ("close_fingers", |hand| hand.close_fingers()),
    ("close_fingers_with_torque", |hand| {
        hand.close_fingers_with_torque()
    }),
    ("grasp", |hand| Grasp::grasp(hand, GraspKind::Rectangular)),
    ("move_fingers", |hand| hand.move_fingers(FINGER, &[10.0])),
    ("send_command", |hand| hand.send_command("GC").map(drop)),
    ("position_move", |hand| {
        hand.position_control()
            .unwrap()
            .position_move(FINGER, &[9.0])
    }),
];

fn is_held(outcome: &Outcome) -> bool {
    matches!(outcome, Err(DeviceError::Held { .. }))
}

#[test]
fn every_motion_is_refused_while_stopped() {
    let stage = Stage::new();
    let hand = guarded(&stage);
    hand.stop_motion().unwrap();
    let before = stage.there.travelled();
    for (name, command) in MOVING {
        assert!(is_held(&command(&hand)), "{name}");
    }
    assert_eq!(stage.there.travelled(), before);
    Hand::abort(&hand).unwrap();
    assert!(hand.is_connected());
    hand.finger_positions().unwrap();
    hand.release();
    for (name, command) in MOVING {
        assert!(!is_held(&command(&hand)), "{name}");
    }
}

/// The motors are frozen, so that the grasp lasts until something ends it.
#[test]
fn the_stop_ends_a_grasp() {
    let stage = Stage::new();
    let hand = guarded(&stage);
    stage.there.freeze(true);
    let control = hand.position_control().unwrap();
    eventually("axes at rest", || control.motion_done(Axes::All).unwrap());
    thread::scope(|scope| {
        let grasping = scope.spawn(|| hand.close_fingers());
        eventually("the grasp", || !control.motion_done(Axes::All).unwrap());
        hand.stop_motion().unwrap();
        let ended = grasping.join().unwrap().unwrap_err().to_string();
        assert!(ended.contains("somebody stopped the hand"), "{ended}");
    });
    stage.there.freeze(false);
    let before = stage.there.travelled();
    hand.finger_positions().unwrap();
    assert_eq!(stage.there.travelled(), before);
}

#[test]
fn angles_beyond_the_limits_are_refused_by_the_guard() {
    let stage = Stage::new();
    let hand = guarded(&stage);
    let refused = hand.move_fingers(FINGER, &[141.0]).unwrap_err();
    assert!(matches!(refused, DeviceError::Guarded { .. }), "{refused}");
}

#[test]
fn a_velocity_without_a_new_command_ends() {
    let stage = Stage::new();
    let hand = guarded(&stage);
    let modes = hand.control_mode().unwrap();
    modes.set_control_modes(FINGER, &[Mode::Velocity]).unwrap();
    let control = hand.velocity_control().unwrap();
    control.velocity_move(FINGER, &[2.0]).unwrap();
    eventually("the end of the velocity", || {
        control.reference_velocities(FINGER).unwrap() == [0.0]
    });
    // At 2 degrees per second the end of its range would have been 70 s away.
    assert!(hand.finger_positions().unwrap()[0] < 100.0);
}
