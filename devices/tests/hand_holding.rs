//! The end of a motion: current off, servo on (`HOLD`), or controlled torque (`TC`, `TO`); and what gains and limits of
//! strain do to it.
#![cfg(unix)]

use yarp_devices::hand::gcl::{Motor, Status};
use yarp_devices::hand::simulated::{Firmware, Load, Object};

/// The object is met at 60 degrees, 125 counts each.
const MET: f64 = 7500.0;

const SOFT: Object = Object {
    inner: 60.0,
    outer: 40.0,
    torque: 0.5,
};

const HARD: Object = Object {
    torque: 2.0,
    ..SOFT
};

fn hand() -> Firmware {
    let mut hand = Firmware::new();
    hand.advance(5.0);
    run(&mut hand, "HI");
    hand
}

/// Sends a line and waits for its end; returns the reply behind the echo.
fn run(hand: &mut Firmware, line: &str) -> String {
    hand.take_output();
    hand.receive(format!("{line}\r").as_bytes());
    for _ in 0..60_000 {
        if !hand.is_busy() {
            let said = String::from_utf8(hand.take_output()).expect("ASCII");
            return said[line.len()..].trim_end_matches("\n\r=> ").to_owned();
        }
        hand.advance(0.001);
    }
    panic!("{line} does not end");
}

/// Closes onto something soft, takes it away, and returns the way of the finger after that.
fn way_after_release(lines: &[&str]) -> f64 {
    let mut hand = hand();
    hand.set_object(Motor::F1, Some(SOFT));
    for line in lines {
        assert_eq!(run(&mut hand, line), "", "{line}");
    }
    assert_eq!(hand.positions()[0], MET);
    hand.advance(1.0);
    assert_eq!(hand.positions()[0], MET);
    hand.set_object(Motor::F1, None);
    hand.advance(2.0);
    hand.positions()[0] - MET
}

#[test]
fn only_a_torque_controlled_close_pushes_on_after_its_end() {
    assert_eq!(way_after_release(&["1C"]), 0.0);
    assert_eq!(way_after_release(&["1FSET HOLD 1", "1C"]), 0.0);
    assert_eq!(way_after_release(&["1TC"]), 17800.0 - MET);
    assert_eq!(way_after_release(&["1TC", "1T"]), 0.0);
    // A motion of another motor leaves it as it is.
    assert_eq!(way_after_release(&["1TC", "2M 500"]), 17800.0 - MET);
}

#[test]
fn a_torque_controlled_open_ends_open() {
    let mut hand = hand();
    assert_eq!(run(&mut hand, "1M 3000"), "");
    // Opening ends at the target, without a stall.
    assert_eq!(run(&mut hand, "1TO"), "");
    hand.advance(1.0);
    assert_eq!(hand.positions()[0], 0.0);
}

#[test]
fn an_abort_and_heat_switch_the_current_off() {
    for ending in [
        (|hand: &mut Firmware| hand.receive(&[3])) as fn(&mut Firmware),
        |hand| hand.set_temperature(80.0),
    ] {
        let mut hand = hand();
        hand.set_object(Motor::F1, Some(SOFT));
        run(&mut hand, "1TC");
        ending(&mut hand);
        hand.advance(0.01);
        hand.set_object(Motor::F1, None);
        hand.advance(2.0);
        assert_eq!(hand.positions()[0], MET);
    }
}

/// The spread can be driven back, unless its servo is on.
#[test]
fn hold_keeps_the_spread_where_it_is() {
    for (hold, way) in [(0, 200.0), (1, 0.0)] {
        let mut hand = hand();
        run(&mut hand, &format!("4FSET HOLD {hold}"));
        assert_eq!(run(&mut hand, "4M 1500"), "");
        let before = hand.positions()[3];
        hand.push_spread(200.0);
        assert_eq!(hand.positions()[3] - before, way, "HOLD {hold}");
        run(&mut hand, "4T");
        hand.push_spread(100.0);
        assert_eq!(hand.positions()[3] - before, way + 100.0);
    }
}

/// With a quarter of the usual gain the motor is too weak to make the clutch let go.
#[test]
fn the_gain_decides_whether_the_clutch_lets_go() {
    for (gain, releases) in [(1, "0 0"), (5, "1 7500")] {
        let mut hand = hand();
        run(&mut hand, &format!("1FSET FPG {gain}"));
        hand.set_object(Motor::F1, Some(HARD));
        assert_eq!(run(&mut hand, "1C"), "");
        let told = run(&mut hand, "1FGET BD BP");
        assert_eq!(told.trim(), releases, "FPG {gain}");
    }
}

/// `LCPG` is the gain while RealTime lasts; 0 is no torque.
#[test]
fn a_gain_of_zero_in_realtime_moves_nothing() {
    for (gain, moves) in [(0, false), (90, true)] {
        let mut hand = hand();
        run(&mut hand, "1FSET LCV 1 LCVC 16 LCPG 1");
        hand.receive(b"1LOOP\r");
        hand.receive(&[b'C', 50, gain]);
        hand.advance(0.5);
        assert_eq!(hand.positions()[0] > 1000.0, moves, "gain {gain}");
    }
}

/// `O`, `TO` and `HI` clear the breakaway; `HOME` and moves do not.
#[test]
fn the_breakaway_stays_known_until_the_hand_opens() {
    for (line, told) in [
        ("1HOME", "1 7500"),
        ("1M 100", "1 7500"),
        ("1O", "0 0"),
        ("1TO", "0 0"),
        ("1HI", "0 0"),
    ] {
        let mut hand = hand();
        hand.set_object(Motor::F1, Some(HARD));
        run(&mut hand, "1C");
        hand.set_object(Motor::F1, None);
        assert_eq!(run(&mut hand, line), "", "{line}");
        assert_eq!(run(&mut hand, "1FGET BD BP").trim(), told, "{line}");
    }
}

/// The simulated gauge reads 128 without strain: below a limit of 130 from the start.
#[test]
fn strain_below_lsg_ends_a_motion() {
    for (limit, reached) in [(130, false), (128, true), (255, true), (256, true)] {
        let mut hand = hand();
        run(&mut hand, &format!("1FSET LSG {limit}"));
        hand.set_load(Motor::F1, Load::default());
        let said = run(&mut hand, "1M 8000");
        let status = format!("\n\rERR {}", Status::NOT_REACHED.bits());
        let expected = if reached { "" } else { status.as_str() };
        assert_eq!(said, expected, "LSG {limit}");
        assert_eq!(hand.positions()[0] > 7900.0, reached);
    }
}

/// Barrett's figure of closing forces ends at 25 N, at 55 mm of the fingertip: no gain makes a finger stronger.
#[test]
fn no_gain_makes_a_finger_stronger_than_its_largest_force() {
    for (newtons, yields) in [(20.0, false), (30.0, true)] {
        let mut hand = hand();
        run(&mut hand, "1FSET FPG 255 HSG 256");
        run(&mut hand, "1M 5000");
        let torque = newtons * 0.055;
        hand.set_load(
            Motor::F1,
            Load {
                inner: torque,
                outer: torque,
            },
        );
        let said = run(&mut hand, "1M 9000");
        assert_eq!(said.contains("ERR 16"), yields, "{newtons} N: {said}");
    }
}

/// The fingers stand in the way of the spread when they are closed as far as 14000 counts.
#[test]
fn closed_fingers_block_the_spread() {
    for (fingers, said) in [(13_900, ""), (14_100, "\n\rERR 16")] {
        let mut hand = hand();
        assert_eq!(run(&mut hand, &format!("GM {fingers}")), "");
        assert_eq!(run(&mut hand, "SM 1000"), said, "{fingers}");
    }
}

/// A hand that was too hot moves again when it is five degrees below its limit of 65.
#[test]
fn a_hand_that_was_hot_cools_before_it_moves() {
    let mut hand = hand();
    for (celsius, moves) in [(64.0, true), (66.0, false), (61.0, false), (59.5, true)] {
        hand.set_temperature(celsius);
        hand.advance(0.01);
        let said = run(&mut hand, "1M 3000");
        assert_eq!(said.is_empty(), moves, "{celsius}: {said}");
        assert_eq!(said.contains("ERR 8192"), !moves, "{celsius}: {said}");
        run(&mut hand, "1M 2000");
    }
}

/// `MPE` is the distance from its target that a motion may end at, 50 counts for a finger.
#[test]
fn a_motion_may_end_within_mpe_of_its_target() {
    for (target, said) in [(7540, ""), (7560, "\n\rERR 16")] {
        let mut hand = hand();
        hand.set_object(Motor::F1, Some(SOFT));
        assert_eq!(run(&mut hand, &format!("1M {target}")), said, "{target}");
        assert_eq!(hand.positions()[0], MET);
    }
}

/// `OD` counts thousands.
#[test]
fn the_odometer_counts_thousands() {
    let mut hand = hand();
    for line in ["1M 17000", "1M 1000", "1M 17000"] {
        run(&mut hand, line);
    }
    let told: i32 = run(&mut hand, "1FGET OD").trim().parse().expect("a number");
    assert_eq!(told, (hand.travelled()[0] / 1000.0) as i32);
    // 3500 counts to its stop at first.
    assert_eq!(told, (3500 + 17_000 + 16_000 + 16_000) / 1000);
}
