//! The end of a grasp against a finger that cannot go on: after `TSTOP` of pushing, or as soon as the strain exceeds `HSG`.

use yarp_devices::hand::gcl::Motor;
use yarp_devices::hand::simulated::{Firmware, Object};

/// A step of the simulated time, s.
const STEP: f64 = 0.001;

/// Initialises the hand, sets the parameters, closes a finger onto something soft, and returns the time from the contact
/// to the end of the command, s.
fn pushing_time(parameters: &str) -> f64 {
    let mut hand = Firmware::new();
    hand.advance(5.0);
    let run = |hand: &mut Firmware, line: &str| {
        hand.receive(format!("{line}\r").as_bytes());
        for _ in 0..60_000 {
            if !hand.is_busy() {
                return;
            }
            hand.advance(STEP);
        }
        panic!("{line} does not end");
    };
    run(&mut hand, "HI");
    run(&mut hand, parameters);
    hand.set_object(
        Motor::F1,
        Some(Object {
            inner: 60.0,
            outer: 40.0,
            torque: 0.5,
        }),
    );
    hand.take_output();
    hand.receive(b"1C\r");
    let mut time = 0.0;
    while hand.is_busy() && time < 60.0 {
        let before = hand.positions()[0];
        hand.advance(STEP);
        // 60 degrees, 125 counts each.
        if before == 7500.0 {
            time += STEP;
        }
    }
    let said = String::from_utf8(hand.take_output()).expect("ASCII");
    assert!(!said.contains("ERR"), "{parameters}: {said}");
    assert_eq!(hand.positions()[0], 7500.0, "{parameters}");
    time
}

#[test]
fn a_motor_pushes_for_tstop() {
    for milliseconds in [100, 1200] {
        let time = pushing_time(&format!("1FSET HSG 256 TSTOP {milliseconds}"));
        let expected = f64::from(milliseconds) / 1000.0;
        assert!((time - expected).abs() < 0.02, "{time} s, not {expected}");
    }
}

/// The simulated gauge reads 128 without strain and 100 more per Nm: 178 here.
#[test]
fn a_motor_stops_when_the_strain_exceeds_hsg() {
    let time = pushing_time("1FSET TSTOP 5000 HSG 170");
    assert!(time < 0.05, "{time} s beyond the limit");
    for unreached in [190, 256] {
        let time = pushing_time(&format!("1FSET TSTOP 1000 HSG {unreached}"));
        assert!((time - 1.0).abs() < 0.02, "{time} s below {unreached}");
    }
}
