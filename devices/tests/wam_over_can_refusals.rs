//! Answers of pucks that do not fit: the driver refuses the arm, names the puck, and does not drive it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use yarp_devices::can::CanFrame;
use yarp_devices::can::puck::{Address, Node, PuckMessage, PuckProperty};
use yarp_devices::simulation::SafetyLimits;
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::{CanErrorKind, CanOptions, CanWam};
use yarp_devices::{Axes, Encoders, Mode, RemoteVariables, VariableValue};

use crate::can;

use can::memory::Memory;
use can::scenarios::{activate, active, modes, move_elbow, options, start};
use can::{Plug, Rig, until};

/// Has nodes for which `of` is true answer queries for a property with another value.
fn answer_otherwise(
    rig: &Memory,
    property: PuckProperty,
    value: i32,
    of: impl Fn(Node) -> bool + Send + Copy + 'static,
) {
    let replace = move |frame: CanFrame| match PuckMessage::read(&frame) {
        Ok((
            address,
            PuckMessage::Value {
                property: asked, ..
            },
        )) if asked == property && of(address.from) => {
            PuckMessage::Value { property, value }.frame(address)
        }
        _ => frame,
    };
    rig.wire().lock().noise = Some(Box::new(move |answers| {
        answers.into_iter().map(replace).collect()
    }));
}

fn refused(rig: &Memory) -> String {
    let refused = CanWam::start(WamModel::<7>::new(), options(), rig.open());
    refused
        .map(|_| ())
        .expect_err("it does not fit")
        .to_string()
}

fn tell_position(rig: &Memory, motor: usize, counts: i32) {
    let told = PuckMessage::Value {
        property: PuckProperty::P,
        value: counts,
    };
    let frame = told.frame(Address::from_host(Node::of_motor(motor)));
    rig.pucks().lock().receive(&frame, &mut Vec::new());
}

#[test]
fn what_does_not_fit_the_model_is_refused() {
    let third = |node: Node| node == Node::of_motor(2);
    for (property, value, expected) in [
        (PuckProperty::VERS, 64, "a firmware of 65 or newer"),
        (PuckProperty::ROLE, 5, "the role of a motor"),
        (PuckProperty::CTS, 40_960, "4096 counts per turn"),
        (PuckProperty::PIDX, 1, "a slot that no other puck"),
        (PuckProperty::PIDX, 5, "a slot from 1 to 4"),
        (PuckProperty::IPNM, 0, "more than 0"),
        (PuckProperty::MT, -1, "more than 0"),
    ] {
        let rig = Memory::new();
        answer_otherwise(&rig, property, value, third);
        let why = refused(&rig);
        assert!(why.contains(expected) && why.contains("puck 3"), "{why}");
    }
}

#[test]
fn a_safety_module_that_does_not_take_what_is_written_is_refused() {
    let safety = |node: Node| node == Node::SAFETY;
    for (property, value, expected) in [
        (PuckProperty::VL2, 20_000, "which was written"),
        (PuckProperty::TL1, 1, "which was written"),
        (PuckProperty::ZERO, 0, "1, which was written"),
    ] {
        let rig = Memory::new();
        answer_otherwise(&rig, property, value, safety);
        let why = refused(&rig);
        assert!(why.contains(expected), "{why}");
    }
}

/// libbarrett: the role of a safety module is 2.
#[test]
fn a_motor_in_the_place_of_the_safety_module_is_refused() {
    let rig = Memory::new();
    answer_otherwise(&rig, PuckProperty::ROLE, 0, |node| node == Node::SAFETY);
    let why = refused(&rig);
    assert!(why.contains("the role of a safety module"), "{why}");
}

#[test]
fn a_safety_module_in_its_error_state_is_refused() {
    let rig = Memory::new();
    answer_otherwise(&rig, PuckProperty::STAT, 1, |node| node == Node::SAFETY);
    let why = refused(&rig);
    assert!(why.contains("(node 10) is in its error state"), "{why}");
}

/// The angle of a rotor is within a turn of 4096 counts.
#[test]
fn an_angle_that_no_rotor_has_is_refused() {
    for angle in [-1, 4096] {
        let rig = Memory::new();
        answer_otherwise(&rig, PuckProperty::MECH, angle, |node| {
            node == Node::of_motor(6)
        });
        let why = refused(&rig);
        assert!(why.contains("an angle from 0 to 4095"), "{why}");
    }
}

#[test]
fn a_position_that_a_puck_does_not_take_is_refused() {
    let rig = Memory::new();
    let shift = |frame: CanFrame| match PuckMessage::read(&frame) {
        Ok((address, PuckMessage::Position { motor, joint }))
            if address.from == Node::of_motor(1) =>
        {
            let motor = motor + 2000;
            PuckMessage::Position { motor, joint }.frame(address)
        }
        _ => frame,
    };
    rig.wire().lock().noise = Some(Box::new(move |answers| {
        answers.into_iter().map(shift).collect()
    }));
    let why = refused(&rig);
    assert!(why.contains("-36833, which was written"), "{why}");
}

/// Starts an arm whose elbow has been told to be at `angle`, rad; returns whether its position is lost, or the refusal.
fn started_with_elbow_at(angle: f64) -> Result<bool, String> {
    let rig = Memory::new();
    drop(start(&rig));
    let counts = -18.0 * 4096.0 / std::f64::consts::TAU * angle;
    tell_position(&rig, 3, counts as i32);
    CanWam::start(WamModel::<7>::new(), options(), rig.open())
        .map(|arm| arm.status().position_lost.is_some())
        .map_err(|error| error.to_string())
}

/// A tenth of a radian outside is the stretch of cables, more than 0.2 is a lost position. At the lower end the elbow is far
/// from home: the arm is found, and waits for a person.
#[test]
fn how_far_outside_its_limits_a_joint_may_seem_to_be() {
    for (angle, waits) in [(3.13 + 0.1, false), (-0.9 - 0.1, true)] {
        assert_eq!(started_with_elbow_at(angle), Ok(waits), "{angle}");
    }
    for angle in [3.13 + 0.3, -0.9 - 0.3] {
        let why = started_with_elbow_at(angle).unwrap_err();
        assert!(why.contains("outside"), "{angle}: {why}");
    }
}

#[test]
fn limits_of_the_safety_module_fit_into_sixteen_bits() {
    let rig = Memory::new();
    let options = CanOptions {
        limits: SafetyLimits {
            velocity_fault: 100.0,
            ..SafetyLimits::default()
        },
        ..options()
    };
    let arm = CanWam::start(WamModel::<7>::new(), options, rig.open()).expect("it is found");
    let told = arm.variable("safety.VL2").expect("it answers");
    assert_eq!(told, [VariableValue::Integer(32_767)]);
}

#[test]
fn a_temperature_belongs_to_its_puck() {
    let rig = Memory::new();
    answer_otherwise(&rig, PuckProperty::TEMP, 55, |node| {
        node == Node::of_motor(1)
    });
    let arm = start(&rig);
    until("all temperatures", || {
        arm.status().temperatures.iter().all(Option::is_some)
    });
    let warm = arm.status().temperatures.map(|celsius| celsius == Some(55));
    assert_eq!(warm, [false, true, false, false, false, false, false]);
}

/// The safety module kept its power and says that positions are right.
#[test]
fn pucks_that_woke_in_their_first_turn_are_told_where_they_are() {
    let rig = Memory::new();
    drop(start(&rig));
    for motor in 0..7 {
        rig.pucks().lock().restart_motor(motor);
    }
    rig.pucks().lock().advance_start(Duration::from_secs(3));
    let home = WamModel::<7>::new().home;
    rig.pucks().lock().simulator_mut().place(&home);
    let arm = start(&rig);
    assert_eq!(arm.status().position_lost, None);
    let elbow = arm.encoder_readings(Axes::One(3.into())).unwrap()[0].position;
    assert!((elbow - 179.3).abs() < 1.0, "{elbow}");
}

/// Pucks with old firmware have no absolute angle, so that counts alone tell.
fn lost_by_counts(change: impl Fn(&Memory)) -> CanErrorKind {
    let rig = Memory::new();
    answer_otherwise(&rig, PuckProperty::VERS, 117, |node| node != Node::SAFETY);
    let arm = active(&rig);
    let base = Axes::One(0.into());
    use yarp_devices::PositionControl;
    arm.set_reference_speeds(base, &[40.0]).expect("a speed");
    arm.position_move(base, &[-28.6]).expect("it may move");
    until("the end of a move", || arm.motion_done(base).unwrap());
    (rig.switch())(Plug::Pull);
    until("the loss noticed", || !arm.status().connected);
    change(&rig);
    (rig.switch())(Plug::PutBack);
    until("the lost position told", || {
        arm.status().position_lost.is_some()
    });
    arm.status().position_lost.expect("it is lost").kind
}

/// Half a radian of the base are three turns of its motor: less than what may be moved unseen.
#[test]
fn a_count_in_the_first_turn_that_was_elsewhere_is_a_restart() {
    let kind = lost_by_counts(|rig| {
        rig.pucks().lock().restart_motor(0);
        rig.pucks().lock().advance_start(Duration::from_secs(3));
    });
    let base = Node::of_motor(0);
    assert!(
        matches!(kind, CanErrorKind::CountsChanged { node, .. } if node == base),
        "{kind:?}"
    );
}

#[test]
fn more_than_a_radian_of_unseen_motion_is_not_believed() {
    // The base was at -0.5 rad, which are 13690 counts, and seems to be at -1.6.
    let kind = lost_by_counts(|rig| tell_position(rig, 0, 43_800));
    assert!(
        matches!(kind, CanErrorKind::CountsChanged { .. }),
        "{kind:?}"
    );
}

/// The arm may have been led by hand while the bus was away.
#[test]
fn half_a_radian_of_unseen_motion_is_believed() {
    let rig = Memory::new();
    let arm = active(&rig);
    move_elbow(&rig, &arm, 150.0);
    (rig.switch())(Plug::Pull);
    until("the loss noticed", || !arm.status().connected);
    let mut pose = rig.pucks().lock().simulator().angles();
    pose[0] += 0.5;
    rig.pucks().lock().simulator_mut().place(&pose);
    (rig.switch())(Plug::PutBack);
    activate(&rig, &arm);
    let base = arm.encoder_readings(Axes::One(0.into())).unwrap()[0].position;
    assert!((base - 28.6).abs() < 2.0, "{base}");
}

/// The driver gives up on a safety module that answers nothing any more while the pucks do.
#[test]
fn a_silent_safety_module_stops_the_control() {
    let rig = Memory::new();
    let arm = active(&rig);
    let seen = Arc::new(AtomicBool::new(false));
    let silent = Arc::clone(&seen);
    rig.wire().lock().noise = Some(Box::new(move |answers| {
        silent.store(true, Ordering::Relaxed);
        let of_safety = |frame: &CanFrame| {
            PuckMessage::read(frame).is_ok_and(|(address, _)| address.from == Node::SAFETY)
        };
        answers
            .into_iter()
            .filter(|frame| !of_safety(frame))
            .collect()
    }));
    until("the loss", || arm.status().loss.is_some());
    let loss = arm.status().loss.expect("it was lost").to_string();
    assert!(loss.contains("watching the safety module"), "{loss}");
    assert!(seen.load(Ordering::Relaxed));
}

/// Ten unanswered queries, one for each ten periods, are too many.
#[test]
fn the_silence_of_the_safety_module_is_noticed_within_a_hundred_periods() {
    let rig = Memory::new();
    let arm = active(&rig);
    rig.pucks().lock().set_silent(Node::SAFETY, true);
    let before = arm.status().periods;
    until("the loss", || !arm.status().connected);
    let periods = arm.status().periods - before;
    assert!(periods <= 110, "{periods}");
}

#[test]
fn a_silent_puck_is_noticed_whichever_it_is() {
    for motor in [0, 3, 6] {
        let rig = Memory::new();
        let arm = active(&rig);
        let node = Node::of_motor(motor);
        rig.pucks().lock().set_silent(node, true);
        until("the loss", || arm.status().loss.is_some());
        let kind = arm.status().loss.expect("it was lost").kind;
        assert_eq!(kind, CanErrorKind::Silent { node });
    }
}

/// Two frames that are lost are made up for, a third is not.
#[test]
fn a_query_of_a_caller_is_sent_three_times_at_most() {
    for (lost, attempts, answered) in [(0, 1, true), (2, 3, true), (100, 3, false)] {
        let rig = Memory::new();
        let arm = active(&rig);
        let asked = Arc::new(AtomicUsize::new(0));
        let seen = Arc::clone(&asked);
        rig.wire().lock().loss = Some(Box::new(move |frame| {
            let query = PuckMessage::Get(PuckProperty::VERS);
            let is_query = can::says(frame, Address::from_host(Node::SAFETY), query);
            is_query && seen.fetch_add(1, Ordering::Relaxed) < lost
        }));
        let told = arm.variable("safety.VERS");
        assert_eq!(told.is_ok(), answered, "{lost} lost: {told:?}");
        assert_eq!(asked.load(Ordering::Relaxed), attempts, "{lost} lost");
        let _ = told.inspect_err(|error| {
            assert!(error.to_string().contains("node 10"), "{error}");
        });
    }
}

/// A mode that no safety module has does not permit motion, and counts as no answer.
#[test]
fn an_unknown_mode_of_the_safety_module_is_not_active() {
    let rig = Memory::new();
    let arm = start(&rig);
    answer_otherwise(&rig, PuckProperty::MODE, 3, |node| node == Node::SAFETY);
    until("the loss", || {
        assert_eq!(modes(&arm), [Mode::HardwareFault; 7]);
        arm.status().loss.is_some()
    });
    let loss = arm.status().loss.expect("it was lost").to_string();
    assert!(loss.contains("watching the safety module"), "{loss}");
}
