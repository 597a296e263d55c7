//! Plugs pulled, noise and strangers on the serial line of the hand.
#![cfg(unix)]

use crate::hand_support;

use std::error::Error;
use std::thread;
use std::time::{Duration, Instant};

use hand_support::{Stage, eventually};
use yarp_devices::hand::gcl::{Layout, MotorControl, MotorLayout, MotorSet, Status};
use yarp_devices::hand::simulated::Noise;
use yarp_devices::hand::{BarrettHand, GclConnection, HandError, HandOptions};
use yarp_devices::{Axes, DeviceError, Grasp, GraspKind, Hand};

/// Disconnects the line during a call, and checks the result.
fn plug_pulled(step: &str, call: impl Fn(&BarrettHand) -> Result<(), DeviceError> + Send + Sync) {
    let stage = Stage::new();
    let hand = stage.ready();
    stage.there.freeze(true);
    thread::scope(|scope| {
        let moving = scope.spawn(|| call(&hand));
        eventually("a motion under way", || stage.there.is_busy());
        stage.there.disconnect_line();
        let error = moving.join().unwrap().expect_err("the line broke");
        let cause = error.source().and_then(|cause| cause.downcast_ref());
        let Some(HandError::LineLost { step: told, .. }) = cause else {
            panic!("{step}: {error:?}");
        };
        assert!(told.contains(step), "{told}, expected {step}");
    });
    assert!(!Hand::is_connected(&hand));
    assert!(hand.finger_positions().is_err(), "there is no line");
    // From here on the driver moves nothing that the hand was not commanded before.
    stage.there.reconnect_line().unwrap();
    let before = stage.there.travelled();
    match hand.finger_positions() {
        Ok(_) => {}
        Err(error) => panic!("the line is back: {error:?}"),
    }
    assert!(Hand::is_connected(&hand));
    stage.there.freeze(false);
    hand.finger_positions().unwrap();
    assert_eq!(stage.there.travelled(), before, "what it did had ended");
}

#[test]
fn while_closing() {
    plug_pulled("waiting for `GC` to end", |hand| hand.close_fingers());
}

#[test]
fn while_opening() {
    plug_pulled("waiting for `GO` to end", |hand| hand.open_fingers());
}

#[test]
fn while_closing_with_torque() {
    plug_pulled("waiting for `GTC` to end", |hand| {
        hand.close_fingers_with_torque()
    });
}

#[test]
fn while_initialising() {
    plug_pulled("waiting for `HI` to end", |hand| hand.initialise());
}

#[test]
fn while_moving_a_finger() {
    plug_pulled("waiting for `1M 15000` to end", |hand| {
        hand.move_fingers(Axes::One(0.into()), &[120.0])
    });
}

#[test]
fn while_grasping() {
    for kind in GraspKind::ALL {
        plug_pulled("to end", |hand| hand.grasp(kind));
    }
}

#[test]
fn while_a_typed_command_runs() {
    plug_pulled("waiting for `GIC 9000` to end", |hand| {
        hand.send_command("GIC 9000").map(drop)
    });
}

#[test]
fn while_in_realtime() {
    let stage = Stage::new();
    let hand = stage.ready();
    let told = MotorLayout {
        speed: Some(1),
        position: true,
        ..MotorLayout::default()
    };
    let layout = Layout::same(MotorSet::FINGERS, told);
    let slow = [MotorControl {
        speed: 1,
        ..MotorControl::default()
    }; 4];
    let mut session = hand.realtime(layout.clone()).unwrap();
    session.control(&slow).unwrap();
    stage.there.disconnect_line();
    let error = session.control(&slow).expect_err("the line broke");
    assert!(
        matches!(&error, HandError::LineLost { step, .. } if step == "exchanging blocks"),
        "{error:?}"
    );
    assert!(session.end().is_err(), "there is no line to leave it over");
    stage.there.reconnect_line().unwrap();
    // The next command leaves RealTime, which stops its motors.
    hand.finger_positions().unwrap();
    let stopped = stage.there.travelled();
    let mut session = hand.realtime(layout).unwrap();
    session.ask().unwrap();
    session.end().unwrap();
    assert_eq!(stage.there.travelled(), stopped);
}

/// One of each command of the language, queries and moves.
const COMMANDS: [&str; 32] = [
    "GC",
    "GO",
    "GTC",
    "GTO",
    "12IC 100",
    "1IO",
    "3M 8000",
    "SM 1200",
    "GHOME",
    "HI",
    "GT",
    "1234C",
    "FSET MCV 90",
    "PSET OTEMP 600",
    "FGET P",
    "2FGET MCV MOV",
    "PGET TEMP",
    "FLOAD",
    "FSAVE MCV",
    "FDEF",
    "PLOAD",
    "PSAVE",
    "PDEF OTEMP",
    "FLIST",
    "FLISTV",
    "PLISTAV",
    "?",
    "A?",
    "ERR",
    "VERS",
    "RESET",
    "",
];

/// Disconnects the line when the hand has received all of `sent` but its last byte, and reconnects it; the hand has
/// not moved.
fn plug_pulled_at(
    stage: &Stage,
    hand: &BarrettHand,
    sent: &str,
    step: &str,
    call: impl Fn() -> HandError + Send,
) {
    let before = stage.there.travelled();
    stage.there.set_unresponsive_from(Some(sent.as_bytes()));
    let error = thread::scope(|scope| {
        let calling = scope.spawn(call);
        eventually("a command under way", || stage.there.is_unresponsive());
        stage.there.disconnect_line();
        calling.join().unwrap()
    });
    let HandError::LineLost { step: told, .. } = &error else {
        panic!("{step}: {error:?}");
    };
    assert_eq!(told, step);
    assert!(!Hand::is_connected(hand));
    stage.there.set_unresponsive_from(None);
    stage.there.reconnect_line().unwrap();
    hand.finger_positions().expect("the line is back");
    assert_eq!(stage.there.travelled(), before, "{step}");
}

#[test]
fn while_any_command_is_typed_or_answered() {
    let stage = Stage::new();
    let hand = stage.ready();
    for text in COMMANDS {
        let line = [text.to_owned()];
        let call = || GclConnection::run(&hand, &line).expect_err("the line broke");
        if !text.is_empty() {
            let step = format!("waiting for the echo of `{text}`");
            plug_pulled_at(&stage, &hand, text, &step, call);
        }
        let step = format!("waiting for `{text}` to end");
        plug_pulled_at(&stage, &hand, &format!("{text}\r"), &step, call);
    }
    hand.close_fingers().unwrap();
}

#[test]
fn while_realtime_begins() {
    let stage = Stage::new();
    let hand = stage.ready();
    let layout = Layout::same(MotorSet::FINGERS, MotorLayout::default());
    let call = || {
        hand.realtime(layout.clone())
            .map(drop)
            .expect_err("the line broke")
    };
    for (sent, step) in [
        ("LOOP", "waiting for the echo of `GLOOP`"),
        ("LOOP\r", "waiting for `GLOOP` to begin"),
    ] {
        plug_pulled_at(&stage, &hand, sent, step, call);
    }
}

#[test]
fn a_line_that_stays_away_is_refused_at_once_and_used_when_it_is_back() {
    let stage = Stage::new();
    let hand = stage.ready();
    stage.there.disconnect_line();
    let refused = || {
        let error = hand.close_fingers().expect_err("no line");
        let cause = error
            .source()
            .and_then(|cause| cause.downcast_ref::<HandError>());
        cause.is_some_and(HandError::is_loss)
    };
    assert!(refused() && refused());
    let before = stage.there.travelled();
    // It lost its power as well.
    stage.there.restart();
    stage.there.reconnect_line().unwrap();
    let outcome = hand
        .close_fingers()
        .expect_err("it forgot where its fingers are");
    let cause = outcome
        .source()
        .and_then(|cause| cause.downcast_ref::<HandError>());
    assert_eq!(
        cause.and_then(HandError::status),
        Some(Status::NOT_INITIALISED)
    );
    assert_eq!(stage.there.travelled(), before);
    hand.initialise().unwrap();
    hand.close_fingers().unwrap();
}

/// One byte in a hundred is spoiled in each direction: commands are repeated until they came through whole.
#[test]
fn noise_moves_nothing_that_was_not_asked_for() {
    let stage = Stage::new();
    let options = stage.options().motion_timeout(Duration::from_secs(10));
    let hand = BarrettHand::open(options).unwrap();
    hand.initialise().unwrap();
    let noise = Noise {
        spoiled: 0.01,
        seed: 5,
    };
    stage.there.set_noise(Some(noise));
    let mut through = 0;
    for round in 0..30 {
        let target = f64::from(round % 2 * 40 + 20);
        let before = stage.there.positions();
        match hand.move_fingers(Axes::One(1.into()), &[target]) {
            Ok(()) => through += 1,
            // An answer that was spoiled; the hand may have moved, but only there.
            Err(error) => println!("{error}: {:?}", error.source().map(ToString::to_string)),
        }
        let after = stage.there.positions();
        for motor in [0, 2, 3] {
            assert_eq!(after[motor], before[motor], "motor {motor}");
        }
        assert!((0.0..=60.0 * 125.0 + 1.0).contains(&after[1]), "{after:?}");
    }
    assert!(through >= 5, "{through} of 30 came through");
    stage.there.set_noise(None);
    hand.move_fingers(Axes::One(1.into()), &[30.0]).unwrap();
}

/// Duration of random bytes: three seconds, or the value of this variable.
const RANDOM_BYTES_SECONDS: &str = "YARP_HAND_BABBLE_SECONDS";

/// A call of a hand.
type Call = fn(&BarrettHand) -> Result<(), DeviceError>;

fn babble() -> Duration {
    let seconds = std::env::var(RANDOM_BYTES_SECONDS).map_or(Ok(3), |text| text.parse());
    Duration::from_secs(seconds.unwrap_or_else(|error| panic!("{RANDOM_BYTES_SECONDS}: {error}")))
}

/// Random bytes for a while: no panic, no movement, and every call comes back.
#[test]
fn a_stranger_on_the_line_moves_nothing() {
    let stage = Stage::new();
    let options = HandOptions::new(&stage.path)
        .echo_timeout(Duration::from_millis(100))
        .motion_timeout(Duration::from_secs(1))
        .block_timeout(Duration::from_millis(100));
    drop(stage.ready());
    let before = stage.there.travelled();
    stage.there.set_random_output(Some(11));
    let until = Instant::now() + babble();
    let mut calls = 0;
    while Instant::now() < until || calls < 3 {
        match BarrettHand::open(options.clone()) {
            Ok(hand) => panic!("a stranger was taken for a hand: {hand:?}"),
            // Four times 25 ms for a prompt and 100 ms for an error.
            Err(HandError::NoHand { waited, .. }) => {
                assert_eq!(waited, Duration::from_millis(500));
            }
            Err(error) => panic!("{error}"),
        }
        calls += 1;
    }
    println!("{calls} times a hand was looked for among random bytes");
    stage.there.set_random_output(None);
    assert_eq!(stage.there.travelled(), before);
    stage.ready().close_fingers().unwrap();
}

/// The same, when the stranger comes while the driver already knows the hand.
#[test]
fn a_hand_that_begins_to_babble_is_not_obeyed_nor_told_anything() {
    let stage = Stage::new();
    let options = stage.options().echo_timeout(Duration::from_secs(1));
    let hand = BarrettHand::open(options).unwrap();
    hand.initialise().unwrap();
    let before = stage.there.travelled();
    stage.there.set_random_output(Some(3));
    let until = Instant::now() + babble();
    // First seven letters: two may come back among random bytes by chance. From then on the driver checks that the
    // hand is there before any command.
    let calls: [Call; 5] = [
        |hand| hand.send_command("GM 8000").map(drop),
        |hand| hand.finger_positions().map(drop),
        |hand| hand.close_fingers(),
        |hand| hand.grasp(GraspKind::Peg),
        |hand| hand.initialise(),
    ];
    let mut count = 0;
    for call in calls.iter().cycle() {
        let outcome = call(&hand).expect_err("nobody understands");
        let cause = outcome.source().and_then(|cause| cause.downcast_ref());
        assert!(
            matches!(
                cause,
                Some(HandError::Garbled { .. } | HandError::NoHand { .. })
            ),
            "{cause:?}"
        );
        count += 1;
        if Instant::now() > until {
            break;
        }
    }
    println!("{count} commands failed while random bytes came");
    assert_eq!(stage.there.travelled(), before);
    stage.there.set_random_output(None);
    hand.close_fingers().unwrap();
}
