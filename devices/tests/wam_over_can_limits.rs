//! The last lines of the driver on its bus: torques within those of a puck, positions that cannot be, and no position
//! written without the precautions of libbarrett.

use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use yarp_devices::can::CanFrame;
use yarp_devices::can::puck::{Address, Group, Node, PuckMessage, PuckProperty, Target};
use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::{SimulatedPucks, SimulatorOptions};
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::{CanErrorKind, CanWam};
use yarp_devices::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, CurrentControl, Encoders, JointFault,
    PositionControl,
};

use crate::can;

use can::memory::Memory;
use can::scenarios::{active, options, start};
use can::{Rig, until};

const ELBOW: Axes<'static> = Axes::One(AxisIndex::new(3));

/// `MT` of joint 4 is 4320 units (btclient); more is asked for, and never sent.
#[test]
fn torques_on_the_bus_are_within_those_of_the_puck() {
    let rig = Memory::new();
    let arm = active(&rig);
    let largest = Arc::new(AtomicI32::new(0));
    let seen = Arc::clone(&largest);
    *rig.hook().lock() = Some(Box::new(move |frame| {
        if let Ok((address, PuckMessage::Torques(slots))) = PuckMessage::read(frame)
            && address.to == Target::Group(Group::LOWER_TORQUES)
        {
            seen.fetch_max(i32::from(slots[3]).abs(), Ordering::Relaxed);
        }
        false
    }));
    let mut gains = arm.control(|arm| arm.gains(3.into())).unwrap();
    gains.proportional *= 1000.0;
    gains.limit = 28.8;
    arm.control(|arm| arm.set_gains(3.into(), gains)).unwrap();
    arm.position_move(ELBOW, &[120.0]).unwrap();
    until("the largest torque", || {
        largest.load(Ordering::Relaxed) >= 4320
    });
    assert_eq!(largest.load(Ordering::Relaxed), 4320);
}

/// A position reply of the elbow's puck, moved by these counts.
fn shifted(frame: &CanFrame, by: i32) -> Option<CanFrame> {
    let (address, message) = PuckMessage::read(frame).ok()?;
    match message {
        PuckMessage::Position { motor, joint } if address.from == Node::of_motor(3) => Some(
            PuckMessage::Position {
                motor: motor + by,
                joint,
            }
            .frame(address),
        ),
        _ => None,
    }
}

/// No rotor turns by hundreds of turns in a period.
#[test]
fn a_position_that_jumps_is_missed_and_not_believed() {
    let rig = Memory::new();
    let arm = active(&rig);
    let before = arm.encoder_readings(ELBOW).unwrap()[0].position;
    let missed = arm.status().missed_replies;
    let spoilt = Arc::new(AtomicBool::new(false));
    let done = Arc::clone(&spoilt);
    rig.wire().lock().noise = Some(Box::new(move |answers| {
        let spoil = |frame: CanFrame| match shifted(&frame, 1_900_000) {
            Some(other) if !done.swap(true, Ordering::Relaxed) => other,
            _ => frame,
        };
        answers.into_iter().map(spoil).collect()
    }));
    until("a spoilt reply", || spoilt.load(Ordering::Relaxed));
    until("a missed reply", || arm.status().missed_replies > missed);
    let after = arm.encoder_readings(ELBOW).unwrap()[0].position;
    assert!((after - before).abs() < 1.0, "from {before} to {after}");
}

/// The plausible change grows with the time since the last position, not with the age of the connection.
#[test]
fn a_position_that_stays_elsewhere_is_not_believed_after_a_while_either() {
    let rig = Memory::new();
    let arm = active(&rig);
    let periods = arm.status().periods;
    until("some control", || arm.status().periods > periods + 500);
    rig.wire().lock().noise = Some(Box::new(move |answers| {
        let spoil = |frame: CanFrame| shifted(&frame, 300_000).unwrap_or(frame);
        answers.into_iter().map(spoil).collect()
    }));
    until("the loss", || arm.status().loss.is_some());
    let kind = arm.status().loss.expect("it was lost").kind;
    let node = Node::of_motor(3);
    assert_eq!(kind, CanErrorKind::Silent { node });
}

/// libbarrett: the safety module ignores velocity faults while positions are written, each of which looks like a jump.
#[test]
fn faults_are_ignored_before_positions_are_written() {
    let rig = Memory::new();
    let written = Arc::new(Mutex::new(Vec::new()));
    let seen = Arc::clone(&written);
    *rig.hook().lock() = Some(Box::new(move |frame| {
        if let Ok((address, PuckMessage::Value { property, value })) = PuckMessage::read(frame)
            && match address.to == Target::Node(Node::SAFETY) {
                // Numbers have other meanings there.
                true => property == PuckProperty::IFAULT,
                false => property == PuckProperty::P,
            }
        {
            seen.lock().unwrap().push((address.to, property, value));
        }
        false
    }));
    let _arm = start(&rig);
    let written = written.lock().unwrap();
    let (to, property, faults) = written[0];
    assert_eq!(
        (to, property),
        (Target::Node(Node::SAFETY), PuckProperty::IFAULT)
    );
    assert!(faults >= 7, "{faults} of seven");
    assert_eq!(written.len(), 8);
}

#[test]
fn positions_are_not_written_while_the_safety_module_is_active() {
    let rig = Memory::new();
    rig.pucks().lock().press_activate();
    let written = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&written);
    *rig.hook().lock() = Some(Box::new(move |frame| {
        if let Ok((address, PuckMessage::Value { property, .. })) = PuckMessage::read(frame)
            && (property == PuckProperty::P && address.to != Target::Node(Node::SAFETY))
        {
            seen.store(true, Ordering::Relaxed);
        }
        false
    }));
    let refused = CanWam::start(WamModel::<7>::new(), options(), rig.open());
    let refused = refused.map(|_| ()).expect_err("it is active").to_string();
    assert!(refused.contains("Shift and Idle"), "{refused}");
    assert!(!written.load(Ordering::Relaxed));
}

/// Pucks that were told a position which no arm can have.
#[test]
fn an_implausible_position_is_refused() {
    let rig = Memory::new();
    drop(start(&rig));
    let elbow = Node::of_motor(3);
    let message = PuckMessage::Value {
        property: PuckProperty::P,
        value: 100_000,
    };
    let frame = message.frame(Address::from_host(elbow));
    rig.pucks().lock().receive(&frame, &mut Vec::new());
    let refused = CanWam::start(WamModel::<7>::new(), options(), rig.open());
    let refused = refused.map(|_| ()).expect_err("nowhere").to_string();
    assert!(refused.contains("outside its limits"), "{refused}");
}

/// `MT` of a puck may be below that of the model; the simulated puck follows its own.
#[test]
fn a_simulated_puck_follows_its_own_largest_torque() {
    let speed = |units: i16| {
        let mut pucks = SimulatedPucks::new(WamModel::<7>::new(), SimulatorOptions::default());
        pucks.advance_start(Duration::from_secs(3));
        pucks.press_activate();
        let mut frames = Vec::new();
        let limit = PuckMessage::Value {
            property: PuckProperty::MT,
            value: 1000,
        };
        let limit = limit.frame(Address::from_host(Node::of_motor(3)));
        pucks.receive(&limit, &mut frames);
        let torques = PuckMessage::Torques([0, 0, 0, units]);
        let torques = torques.frame(Address::from_host(Group::LOWER_TORQUES));
        for _ in 0..10 {
            pucks.receive(&torques, &mut frames);
            pucks.advance(Duration::from_millis(2), &mut frames);
        }
        pucks.simulator().velocities()[3]
    };
    assert_eq!(speed(5000), speed(1000));
    assert_ne!(speed(1000), speed(900));
}

#[test]
fn the_safety_module_is_heard_each_second() {
    let mut pucks = SimulatedPucks::new(WamModel::<7>::new(), SimulatorOptions::default());
    let mut frames = Vec::new();
    for _ in 0..3500 {
        pucks.advance(Duration::from_millis(1), &mut frames);
    }
    let heard = frames.iter().filter(|frame| frame.id() == 0x540).count();
    assert_eq!(heard, 3);
}

/// The base turns about the vertical, so that its weight does not move it.
#[test]
fn a_puck_that_is_switched_off_forgets_its_torque() {
    let mut pucks = SimulatedPucks::new(WamModel::<7>::new(), SimulatorOptions::default());
    pucks.advance_start(Duration::from_secs(3));
    let mut frames = Vec::new();
    let torques = |motor: i16| {
        let torques = PuckMessage::Torques([motor, 0, 0, 0]);
        torques.frame(Address::from_host(Group::LOWER_TORQUES))
    };
    pucks.press_activate();
    pucks.advance(Duration::from_millis(2), &mut frames);
    pucks.receive(&torques(500), &mut frames);
    pucks.press_idle();
    pucks.press_activate();
    let before = pucks.simulator().angles()[0];
    let of_others = PuckMessage::Torques([0; 4]).frame(Address::from_host(Group::UPPER_TORQUES));
    for _ in 0..10 {
        pucks.receive(&of_others, &mut frames);
        pucks.advance(Duration::from_millis(2), &mut frames);
    }
    let unmoved = pucks.simulator().angles()[0];
    assert!((unmoved - before).abs() < 1e-6, "it still pushes");
    for _ in 0..10 {
        pucks.receive(&torques(500), &mut frames);
        pucks.advance(Duration::from_millis(2), &mut frames);
    }
    assert!((pucks.simulator().angles()[0] - unmoved).abs() > 1e-6);
}

/// Each puck has its own limit, as Barrett has set it.
#[test]
fn the_limit_of_a_temperature_is_that_of_the_puck() {
    let rig = Memory::new();
    drop(start(&rig));
    let limit = PuckMessage::Value {
        property: PuckProperty::OTEMP,
        value: 50,
    };
    let frame = limit.frame(Address::from_host(Node::of_motor(2)));
    rig.pucks().lock().receive(&frame, &mut Vec::new());
    let arm = active(&rig);
    for motor in [1, 2] {
        rig.pucks().lock().set_temperature(motor, Some(51));
    }
    until("the arm holds", || arm.status().held.is_some());
    let held = arm.status().held.unwrap_or_default();
    assert!(
        held.contains("puck 3") && held.contains("limit is 50 °C"),
        "{held}"
    );
    rig.pucks().lock().set_temperature(2, Some(40));
    until("the arm goes on", || arm.status().held.is_none());
}

/// A current is a torque in units of 1/1024 A (libbarrett), of which each puck tells how many it follows and has per Nm.
#[test]
fn ranges_of_currents_are_those_of_the_pucks() {
    let rig = Memory::new();
    drop(start(&rig));
    let tell = |motor: usize, property: PuckProperty, value: i32| {
        let message = PuckMessage::Value { property, value };
        let frame = message.frame(Address::from_host(Node::of_motor(motor)));
        rig.pucks().lock().receive(&frame, &mut Vec::new());
    };
    tell(0, PuckProperty::IPNM, 2560);
    tell(3, PuckProperty::MT, 2048);
    let arm = start(&rig);
    let range = |joint: usize| arm.current_ranges(Axes::One(joint.into())).unwrap()[0].max;
    // 25 Nm of the loop through a ratio of 42.
    let expected = 25.0 / 42.0 * 2560.0 / 1024.0;
    assert!((range(0) - expected).abs() < 1e-9, "{} A", range(0));
    assert_eq!(range(3), 2.0);
    let limit = arm.amplifier_limit(AmplifierLimit::MaxCurrent, 3.into());
    assert_eq!(limit.unwrap(), 2.0);
}

/// A joint that somebody pushes away has stalled, and its fault says so until it is commanded again.
#[test]
fn a_stall_is_a_fault_of_its_joint() {
    let rig = Memory::new();
    let arm = active(&rig);
    let wrist = AxisIndex::new(4);
    let mut push = Joints::<7>::zeros();
    push[4] = 4.0;
    rig.pucks().lock().simulator_mut().twist(push);
    until("a stall", || arm.last_fault(wrist).unwrap().code == 2);
    rig.pucks().lock().simulator_mut().twist(Joints::zeros());
    let fault = arm.last_fault(wrist).unwrap();
    assert!(fault.message.contains("joint 4 has stalled"), "{fault:?}");
    assert_eq!(arm.last_fault(0.into()).unwrap().code, 0);
    arm.relative_move(wrist.into(), &[1.0])
        .expect("the next command");
    assert_eq!(arm.last_fault(wrist).unwrap().code, 0);
}
