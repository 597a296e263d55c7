//! The driver believes no position that nobody vouches for: not at its start, not after pucks or safety module restarted
//! while the bus was away, even when all of them are back by themselves.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use yarp_devices::can::puck::{Node, PuckMessage, PuckProperty};
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::{CanErrorKind, CanOptions, CanWam};
use yarp_devices::{Axes, DeviceError, Encoders, RemoteVariables, VariableValue};

use crate::can;

use can::memory::Memory;
use can::scenarios::{activate, active, move_elbow, options};
use can::{Plug, Rig, until};

const YES: [VariableValue; 1] = [VariableValue::Integer(1)];

fn refused(arm: &CanWam) -> String {
    let reading = arm.encoder_readings(Axes::All);
    reading.expect_err("the position is unknown").to_string()
}

/// Folds the arm as by hand, confirms it, and compares the position with the truth.
fn fold_and_confirm(rig: &Memory, arm: &CanWam) {
    let home = WamModel::<7>::new().home;
    rig.pucks().lock().simulator_mut().place(&home);
    arm.set_variable("confirm_home", &YES).expect("it connects");
    assert_eq!(arm.variable("confirm_home").unwrap(), YES);
    activate(rig, arm);
    until("the position of the encoders at the truth", || {
        let truth = rig.pucks().lock().simulator().angles();
        let believed = arm.encoder_readings(Axes::All).expect("it is connected");
        let mut pairs = believed.iter().zip(truth.iter());
        pairs.all(|(one, truth)| (one.position - truth.to_degrees()).abs() < 0.5)
    });
}

/// Counts commands that tell the safety module that positions are right.
fn count_declarations(rig: &Memory) -> Arc<AtomicU64> {
    let count = Arc::new(AtomicU64::new(0));
    let counter = Arc::clone(&count);
    *rig.hook().lock() = Some(Box::new(move |frame| {
        let declares = matches!(
            PuckMessage::read(frame),
            Ok((_, PuckMessage::Value { property: PuckProperty::ZERO, value })) if value != 0
        );
        counter.fetch_add(u64::from(declares), Ordering::Relaxed);
        false
    }));
    count
}

/// The position stays lost for many times the interval between attempts.
fn stays_lost(arm: &CanWam) {
    for _ in 0..50 {
        std::thread::sleep(Duration::from_millis(4));
        assert!(!arm.status().connected);
        assert!(arm.status().position_lost.is_some());
    }
}

#[test]
fn a_start_waits_for_a_confirmation_even_with_marks() {
    let rig = Memory::new();
    // Elsewhere than home, as after somebody led it.
    let mut pose = WamModel::<7>::new().home;
    pose[3] -= 0.8;
    rig.pucks().lock().simulator_mut().place(&pose);
    let declarations = count_declarations(&rig);
    let options = CanOptions {
        home_confirmed: false,
        ..options()
    };
    let arm = CanWam::start(WamModel::<7>::new(), options, rig.open()).expect("the pucks answer");
    rig.pucks().lock().press_activate();
    stays_lost(&arm);
    assert!(refused(&arm).contains("confirm"), "{}", refused(&arm));
    assert_eq!(
        arm.variable("confirm_home").unwrap(),
        [VariableValue::Integer(0)]
    );
    assert_eq!(declarations.load(Ordering::Relaxed), 0);
    fold_and_confirm(&rig, &arm);
}

#[test]
fn an_option_confirms_home_at_the_start() {
    let rig = Memory::new();
    let options = CanOptions {
        home_marks: None,
        home_confirmed: true,
        ..options()
    };
    let arm = CanWam::start(WamModel::<7>::new(), options, rig.open()).expect("the arm is found");
    activate(&rig, &arm);
    let again = arm.confirm_home();
    assert!(matches!(again, Err(DeviceError::NotSupported { .. })));
}

#[test]
fn pucks_that_restarted_and_woke_by_themselves_have_lost_their_positions() {
    let rig = Memory::new();
    let arm = active(&rig);
    move_elbow(&rig, &arm, 150.0);
    let declarations = count_declarations(&rig);
    (rig.switch())(Plug::Pull);
    until("the loss noticed", || !arm.status().connected);
    for motor in 0..7 {
        rig.pucks().lock().restart_motor(motor);
    }
    rig.pucks().lock().advance_start(Duration::from_secs(3));
    (rig.switch())(Plug::PutBack);
    until("the lost position told", || {
        let lost = arm.status().position_lost;
        lost.is_some_and(|error| matches!(error.kind, CanErrorKind::CountsChanged { .. }))
    });
    stays_lost(&arm);
    assert!(refused(&arm).contains("home pose"), "{}", refused(&arm));
    assert_eq!(declarations.load(Ordering::Relaxed), 0);
    fold_and_confirm(&rig, &arm);
}

#[test]
fn a_safety_module_that_restarted_is_not_told_that_positions_are_right() {
    let rig = Memory::new();
    let arm = active(&rig);
    let declarations = count_declarations(&rig);
    (rig.switch())(Plug::Pull);
    until("the loss noticed", || !arm.status().connected);
    rig.pucks().lock().restart_safety();
    (rig.switch())(Plug::PutBack);
    until("the lost position told", || {
        let lost = arm.status().position_lost;
        lost.is_some_and(|error| error.kind == CanErrorKind::SafetyRestarted)
    });
    stays_lost(&arm);
    assert_eq!(declarations.load(Ordering::Relaxed), 0);
    fold_and_confirm(&rig, &arm);
}

#[test]
fn the_emergency_stop_loses_the_position_and_a_failed_confirmation_does_not_restore_it() {
    let rig = Memory::new();
    let arm = active(&rig);
    rig.pucks().lock().press_stop();
    until("the emergency stop told", || {
        let lost = arm.status().position_lost;
        lost.is_some_and(|error| error.kind == CanErrorKind::EmergencyStop)
    });
    // Still pressed: the pucks have no power.
    let early = arm.confirm_home().expect_err("no puck answers").to_string();
    assert!(early.contains("emergency stop"), "{early}");
    rig.pucks().lock().press_idle();
    rig.pucks().lock().advance_start(Duration::from_secs(3));
    rig.pucks().lock().press_activate();
    stays_lost(&arm);
    rig.pucks().lock().set_silent(Node::of_motor(2), true);
    let missing = arm.confirm_home().expect_err("a puck is missing");
    assert!(missing.to_string().contains("puck 3"), "{missing}");
    rig.pucks().lock().set_silent(Node::of_motor(2), false);
    stays_lost(&arm);
    fold_and_confirm(&rig, &arm);
}

/// Idle, the arm sinks onto its stops, outside its limits. It is held there, and not pulled into them.
#[test]
fn activation_outside_the_limits_moves_nothing() {
    let rig = Memory::new();
    let arm = can::scenarios::start(&rig);
    let mut frames = Vec::new();
    rig.pucks()
        .lock()
        .advance(Duration::from_secs(2), &mut frames);
    let limits = WamModel::<7>::new().chain.limits().to_owned();
    let before = rig.pucks().lock().simulator().angles();
    assert!(
        before[1] < limits[1].min - 0.01 || before[3] > limits[3].max + 0.01,
        "it is inside: {before}"
    );
    activate(&rig, &arm);
    let periods = arm.status().periods;
    until("a second of control", || {
        arm.status().periods > periods + 500
    });
    let after = rig.pucks().lock().simulator().angles();
    let moved = (after - before).map(f64::to_degrees).abs().max();
    assert!(moved < 0.5, "{moved} degrees");
    // And commands lead it back.
    move_elbow(&rig, &arm, 170.0);
}

#[test]
fn the_arm_tells_how_late_its_control_is_also_after_a_reconnection() {
    let rig = Memory::new();
    let arm = active(&rig);
    let timing = || match &arm.variable("timing").unwrap()[..] {
        [VariableValue::Text(text)] => text.clone(),
        other => panic!("{other:?}"),
    };
    until("periods are counted", || !timing().contains("none"));
    let scheduling = arm.status().scheduling;
    // What an ordinary user is not granted is named too.
    assert!(
        scheduling.contains("priority") || scheduling.contains("SCHED_FIFO"),
        "{scheduling}"
    );
    assert!(timing().ends_with(&scheduling), "{}", timing());
    (rig.switch())(Plug::Pull);
    until("the loss noticed", || !arm.status().connected);
    (rig.switch())(Plug::PutBack);
    until("the arm reconnected", || arm.status().connections == 2);
    assert!(timing().ends_with(&scheduling), "{}", timing());
}
