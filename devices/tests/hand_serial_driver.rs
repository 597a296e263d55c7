//! The driver and a simulated hand over a pseudo-terminal: every command, grasp and complaint.
#![cfg(unix)]

use crate::hand_support;

use std::error::Error;
use std::thread;
use std::time::Duration;

use hand_support::{Stage, eventually};
use yarp_devices::hand::gcl::{
    Command, Layout, Motor, MotorControl, MotorLayout, MotorSet, Parameter, Status, Verb,
};
use yarp_devices::hand::simulated::Object;
use yarp_devices::hand::{self, BarrettHand, HandError, finger_coupling, named_grasps};
use yarp_devices::{Axes, DeviceError, Grasp, GraspKind, Hand};

/// The status that a call through the interfaces was refused with.
fn status<T: std::fmt::Debug>(outcome: Result<T, DeviceError>) -> Option<Status> {
    let error = outcome.expect_err("the hand complains");
    let cause = error.source().expect("the hand's own complaint");
    cause
        .downcast_ref::<HandError>()
        .and_then(HandError::status)
}

#[test]
fn a_hand_must_be_initialised() {
    let stage = Stage::new();
    let hand = stage.open();
    assert_eq!(status(hand.close_fingers()), Some(Status::NOT_INITIALISED));
    hand.initialise().unwrap();
    assert_eq!(hand.finger_positions().unwrap(), [0.0; 4]);
    hand.close_fingers().unwrap();
    assert!(hand.finger_positions().unwrap()[0] > 139.0);
    stage.there.restart();
    assert_eq!(status(hand.open_fingers()), Some(Status::NOT_INITIALISED));
}

#[test]
fn every_named_grasp_ends_where_it_is_expected() {
    let stage = Stage::new();
    let hand = stage.ready();
    for kind in GraspKind::ALL {
        hand.grasp(GraspKind::OpenWide).unwrap();
        hand.grasp(kind)
            .unwrap_or_else(|error| panic!("{kind}: {error}"));
        let off = hand.check_grasp(named_grasps::expected(kind)).unwrap();
        // Closed fingers go a little beyond the 140 degrees of the data sheet.
        assert!(off.iter().all(|off| off.abs() < 3.0), "{kind}: {off:?}");
    }
}

#[test]
fn a_grasp_that_holds_something_is_told_from_an_empty_one() {
    let stage = Stage::new();
    let hand = stage.ready();
    let object = Object {
        inner: 70.0,
        outer: 30.0,
        torque: 0.4,
    };
    stage.there.set_object(Motor::F3, Some(object));
    hand.close_fingers_with_torque().unwrap();
    let off = hand
        .check_grasp(named_grasps::expected(GraspKind::Needle))
        .unwrap();
    assert!(
        (off[2] - 6.0).abs() < 0.1,
        "it stalls at 70 of 64 degrees: {off:?}"
    );
    let closed = [Some(140.0), Some(140.0), Some(140.0), None];
    let off = hand.check_grasp(closed).unwrap();
    assert!(off[0].abs() < 3.0 && (off[2] + 70.0).abs() < 0.1, "{off:?}");
}

#[test]
fn the_clutch_lets_go_at_a_hard_object() {
    let stage = Stage::new();
    let hand = stage.ready();
    let object = Object {
        inner: 60.0,
        outer: 40.0,
        torque: 2.0,
    };
    stage.there.set_object(Motor::F1, Some(object));
    hand.close_fingers().unwrap();
    let [first, ..] = hand::read(&hand, Parameter::BREAKAWAY_POSITION).unwrap();
    assert_eq!(first, 7500);
    assert_eq!(
        hand::read(&hand, Parameter::BREAKAWAY).unwrap()[..3],
        [1, 0, 0]
    );
    let counts = hand::read(&hand, Parameter::POSITION).unwrap()[0];
    let links = finger_coupling::links(counts.into(), Some(first.into()));
    assert!((links.inner.to_degrees() - 60.0).abs() < 0.1);
    assert!((links.outer.to_degrees() - 40.0).abs() < 0.1);
    hand.open_fingers().unwrap();
    assert_eq!(hand::read(&hand, Parameter::BREAKAWAY).unwrap()[0], 0);
}

#[test]
fn a_move_that_is_blocked_says_so_and_one_out_of_range_does_not_begin() {
    let stage = Stage::new();
    let hand = stage.ready();
    let object = Object {
        inner: 40.0,
        outer: 0.0,
        torque: 0.1,
    };
    stage.there.set_object(Motor::F2, Some(object));
    assert_eq!(
        status(hand.move_fingers(Axes::One(1.into()), &[64.0])),
        Some(Status::NOT_REACHED)
    );
    let before = stage.there.travelled();
    for bad in [-1.0, 141.0, f64::NAN, f64::INFINITY] {
        assert!(
            hand.move_fingers(Axes::All, &[10.0, 10.0, bad, 10.0])
                .is_err()
        );
    }
    assert!(hand.move_fingers(Axes::One(4.into()), &[1.0]).is_err());
    assert_eq!(stage.there.travelled(), before);
}

#[test]
fn fingers_go_where_they_are_sent() {
    let stage = Stage::new();
    let hand = stage.ready();
    hand.move_fingers(Axes::All, &[10.0, 20.0, 10.0, 90.0])
        .unwrap();
    assert_eq!(hand.finger_positions().unwrap(), [10.0, 20.0, 10.0, 90.0]);
    hand.move_fingers(Axes::One(1.into()), &[5.0]).unwrap();
    assert_eq!(hand.finger_positions().unwrap(), [10.0, 5.0, 10.0, 90.0]);
}

/// Each verb of the language once, over the line.
#[test]
fn every_command_is_understood() {
    let stage = Stage::new();
    let hand = stage.ready();
    let answer = |text: &str| {
        hand.send_command(text)
            .unwrap_or_else(|error| panic!("{text}: {error:?}"))
    };
    for quiet in [
        "GC",
        "GO",
        "GTC",
        "GTO",
        "GM 4000",
        "1IC 100",
        "2IO",
        "M",
        "HOME",
        "GHOME",
        "SHOME",
        "2HI",
        "1T",
        "FSET MCV 80",
        "FSAVE MCV",
        "FLOAD",
        "FDEF MCV",
        "PSAVE",
        "PDEF OTEMP",
        "PLOAD OTEMP",
        "12FSET MCV 100 MOV 90",
        "PSET OTEMP 640",
        "",
    ] {
        assert_eq!(answer(quiet), "", "{quiet}");
    }
    assert_eq!(answer("12FGET MCV MOV"), "100 100 90 90");
    assert_eq!(answer("PGET OTEMP"), "640");
    assert!(answer("1FLISTV").contains("MCV 100"));
    for told in [
        "FLIST", "FLISTA", "FLISTAV", "PLIST", "PLISTV", "PLISTA", "?", "A?", "VERS",
    ] {
        let text = answer(told);
        assert_eq!(text.is_empty(), told == "PLISTA", "{told}: {text}");
    }
    assert!(answer("ERR").contains("over-temperature"));
    assert!(answer("RESET").contains("BarrettHand Firmware"));
    assert_eq!(
        status(hand.send_command("GC")),
        Some(Status::NOT_INITIALISED)
    );
}

#[test]
fn complaints_come_back_as_what_they_are() {
    let stage = Stage::new();
    let hand = stage.ready();
    let complaint = |text: &str| status(hand.send_command(text)).expect("a status");
    assert_eq!(complaint("XYZ"), Status::UNKNOWN_COMMAND);
    assert_eq!(complaint("FGET NOTHING"), Status::UNKNOWN_PARAMETER);
    assert_eq!(complaint("FSET MCV 5000"), Status::INVALID_VALUE);
    assert_eq!(complaint("FSET P 0"), Status::READ_ONLY);
    assert_eq!(complaint("GC 1"), Status::TOO_MANY_ARGUMENTS);
    assert_eq!(complaint("GRESET"), Status::NO_PREFIX_ALLOWED);
    stage.there.set_temperature(90.0);
    assert_eq!(complaint("GC"), Status::OVER_TEMPERATURE);
    stage.there.set_temperature(40.0);
    hand.close_fingers().unwrap();
}

#[test]
fn what_is_no_line_for_the_hand_is_not_sent() {
    let stage = Stage::new();
    let hand = stage.ready();
    let before = stage.there.travelled();
    let long = "M".repeat(256);
    for text in [
        "GC\rGO",
        "GC\n",
        "\u{3}",
        "GC\u{e9}",
        "123LOOP",
        "pset lft 1 baud 384",
        &long,
    ] {
        let error = hand.send_command(text).expect_err(text);
        assert!(matches!(
            error.source().and_then(|cause| cause.downcast_ref()),
            Some(HandError::NotSent { .. })
        ));
    }
    assert_eq!(stage.there.travelled(), before);
}

#[test]
fn a_hand_that_gets_hot_while_it_moves_stops() {
    let stage = Stage::new();
    let hand = stage.ready();
    stage.there.freeze(true);
    thread::scope(|scope| {
        let closing = scope.spawn(|| hand.close_fingers());
        eventually("a motion under way", || stage.there.is_busy());
        stage.there.set_temperature(90.0);
        assert_eq!(
            status(closing.join().unwrap()),
            Some(Status::OVER_TEMPERATURE)
        );
    });
}

fn aborted(motion: impl Fn(&BarrettHand) -> Result<(), DeviceError> + Send + Sync) {
    let stage = Stage::new();
    let hand = stage.ready();
    stage.there.freeze(true);
    thread::scope(|scope| {
        let moving = scope.spawn(|| motion(&hand));
        eventually("a motion under way", || stage.there.is_busy());
        assert!(matches!(
            hand.command(&Verb::Version.into()),
            Err(HandError::Busy { .. })
        ));
        Hand::abort(&hand).unwrap();
        assert_eq!(status(moving.join().unwrap()), Some(Status::ABORTED));
    });
    let stopped = stage.there.travelled();
    stage.there.freeze(false);
    // The next command finds everything at rest, also the steps of a grasp that were still to come.
    hand.finger_positions().unwrap();
    assert_eq!(stage.there.travelled(), stopped);
}

#[test]
fn an_abort_ends_a_close() {
    aborted(|hand| hand.close_fingers());
}

#[test]
fn an_abort_ends_a_grasp_of_several_steps() {
    aborted(|hand| hand.grasp(GraspKind::Peg));
}

#[test]
fn an_abort_with_nothing_under_way_does_no_harm() {
    let stage = Stage::new();
    let hand = stage.ready();
    Hand::abort(&hand).unwrap();
    hand.close_fingers().unwrap();
}

/// A motion may take as long as the options say, and the initialisation, which has two parts, twice as long.
#[test]
fn the_timeouts_of_motions_are_those_of_the_options() {
    let time = Duration::from_millis(200);
    let stage = Stage::new();
    drop(stage.ready());
    let hand = BarrettHand::open(stage.options().motion_timeout(time)).expect("a hand answers");
    let waited = |verb: Verb| {
        stage.there.freeze(true);
        let error = hand.command(&verb.into()).expect_err("it is frozen");
        stage.there.freeze(false);
        match error {
            HandError::NoPrompt { waited, .. } => waited,
            other => panic!("{other}"),
        }
    };
    assert_eq!(waited(Verb::Close), time);
    assert_eq!(waited(Verb::Initialise), 2 * time);
}

#[test]
fn the_line_can_be_made_faster() {
    let stage = Stage::new();
    let hand = stage.ready();
    hand.set_baud(384).unwrap();
    assert_eq!(hand.send_command("PGET BAUD").unwrap(), "384");
    hand.close_fingers().unwrap();
}

#[test]
fn realtime_tells_positions_while_motors_move() {
    let stage = Stage::new();
    let hand = stage.ready();
    let told = MotorLayout {
        speed: Some(1),
        position: true,
        strain: true,
        change: Some(1),
        ..MotorLayout::default()
    };
    let layout = Layout {
        temperature: true,
        ..Layout::same(MotorSet::FINGERS, told)
    };
    let mut session = hand.realtime(layout).unwrap();
    assert!(hand.finger_positions().is_err(), "the line is taken");
    let closing = MotorControl {
        speed: 50,
        ..MotorControl::default()
    };
    let mut walked = 0;
    eventually("a finger at 20 degrees", || {
        let feedback = session.control(&[closing; 4]).unwrap();
        assert!(feedback.temperature.unwrap() > 300);
        walked += i32::from(feedback.motors[0].change.unwrap());
        feedback.motors[0].position.unwrap() > 2500
    });
    eventually("everything told", || {
        let feedback = session.control(&[MotorControl::default(); 4]).unwrap();
        walked += i32::from(feedback.motors[0].change.unwrap());
        walked == i32::from(feedback.motors[0].position.unwrap())
    });
    session.end().unwrap();
    let [first, second, third, spread] = hand.finger_positions().unwrap();
    assert!(first > 19.0 && second > 19.0 && third > 19.0 && spread == 0.0);
}

/// The driver sets the content of the blocks once, and again after anything that may have changed it.
#[test]
fn realtime_has_its_layout_again_after_others_were_set_and_after_a_loss_of_power() {
    let stage = Stage::new();
    let hand = stage.ready();
    let told = MotorLayout {
        speed: Some(1),
        position: true,
        ..MotorLayout::default()
    };
    let layout = Layout::same(MotorSet::FINGERS, told);
    let check = |when: &str| {
        let mut session = hand.realtime(layout.clone()).expect(when);
        for _ in 0..3 {
            let feedback = session.ask().expect(when);
            let positions = feedback.motors.map(|motor| motor.position);
            assert_eq!(positions, [Some(0), Some(0), Some(0), None], "{when}");
        }
        session.end().expect(when);
    };
    check("at first");
    check("without a change");
    // More in each block, and less.
    for line in ["GFSET LFS 1", "2FSET LFAP 0", "FLOAD", "FDEF", "GM 0"] {
        hand.send_command(line).expect("the hand takes it");
        check(line);
    }
    stage.there.restart();
    hand.initialise().expect("nothing is in its way");
    check("after a loss of power");
}

#[test]
fn realtime_is_left_also_when_the_session_is_dropped_and_motors_stop() {
    let stage = Stage::new();
    let hand = stage.ready();
    let layout = Layout::same(
        MotorSet::FINGERS,
        MotorLayout {
            speed: Some(1),
            position: true,
            ..MotorLayout::default()
        },
    );
    let mut session = hand.realtime(layout.clone()).unwrap();
    let slow = MotorControl {
        speed: 1,
        ..MotorControl::default()
    };
    session.control(&[slow; 4]).unwrap();
    drop(session);
    let stopped = stage.there.travelled();
    hand.finger_positions().unwrap();
    assert_eq!(stage.there.travelled(), stopped);
    // A hand that was never initialised does not enter it at all.
    stage.there.restart();
    let refused = hand.realtime(layout).map(drop);
    assert!(refused.is_err_and(|error| error.status() == Some(Status::NOT_INITIALISED)));
}

#[test]
fn a_second_program_cannot_open_the_line() {
    let stage = Stage::new();
    let _hand = stage.ready();
    assert!(matches!(
        BarrettHand::open(stage.options()),
        Err(HandError::Open { .. })
    ));
}

#[test]
fn a_command_is_a_value_too() {
    let stage = Stage::new();
    let hand = stage.ready();
    let command = Command::new(MotorSet::FINGERS, Verb::Move(Some(4000)));
    hand.command(&command).unwrap();
    assert_eq!(
        hand::read(&hand, Parameter::POSITION).unwrap(),
        [4000, 4000, 4000, 0]
    );
}
