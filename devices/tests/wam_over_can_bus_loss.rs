//! The bus goes down in the middle of each command and at each frame of a period: the step is named, the arm is
//! braked, and nothing resumes by itself when the bus is back.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use yarp_devices::can::BusError;
use yarp_devices::can::puck::{Address, Group, Node, PuckMessage, PuckProperty};
use yarp_devices::simulation::{SafetyMode, SimulatedPucks};
use yarp_devices::wam::can::{CanStep, CanWam};
use yarp_devices::{
    Axes, AxisIndex, ControlMode, DeviceError, Encoders, Mode, MotionControl, PositionControl,
    PositionDirect, TorqueControl, VelocityControl,
};

use crate::can;

use can::memory::Memory;
use can::scenarios::{activate, active, elbow, modes};
use can::{Plug, Rig, says, until};

const ELBOW: Axes<'static> = Axes::One(AxisIndex::new(3));

/// A command to the elbow that opens it, and the mode it needs.
type Command = (Mode, fn(&CanWam) -> Result<(), DeviceError>);

const COMMANDS: [Command; 5] = [
    (Mode::Position, |arm| arm.position_move(ELBOW, &[100.0])),
    (Mode::Position, |arm| arm.relative_move(ELBOW, &[-60.0])),
    (Mode::Velocity, |arm| arm.velocity_move(ELBOW, &[-20.0])),
    (Mode::PositionDirect, |arm| {
        arm.set_direct_positions(ELBOW, &[170.0])
    }),
    (Mode::Torque, |arm| {
        arm.set_reference_torques(ELBOW, &[-2.0])
    }),
];

#[test]
fn in_the_middle_of_each_command() {
    for (mode, command) in COMMANDS {
        let rig = Memory::new();
        let arm = active(&rig);
        arm.set_control_modes(Axes::All, &[mode; 7]).unwrap();
        command(&arm).expect("it is taken");
        until("a command on its way", || elbow(&rig) < 177.5);
        (rig.switch())(Plug::Pull);
        until("the loss noticed", || !arm.status().connected);
        assert_eq!(safety(&rig), SafetyMode::Idle, "{mode}");
        let held = elbow(&rig);
        for told in [
            command(&arm),
            arm.stop(ELBOW),
            arm.set_control_modes(Axes::All, &[mode; 7]),
            arm.encoder_readings(ELBOW).map(|_| ()),
            arm.motion_done(ELBOW).map(|_| ()),
        ] {
            let told = told.expect_err("there is no arm").to_string();
            assert!(told.contains("CAN interface is down"), "{mode}: {told}");
            assert!(told.contains("try"), "{mode}: {told}");
        }
        (rig.switch())(Plug::PutBack);
        until("the arm found again", || arm.status().connected);
        let periods = arm.status().periods;
        until("control periods", || arm.status().periods > periods + 100);
        assert_eq!(modes(&arm), [Mode::HardwareFault; 7]);
        // Braked, it sinks a little.
        let now = elbow(&rig);
        assert!((now - held).abs() < 3.0, "{mode}: from {held} to {now}");
    }
}

fn safety(rig: &Memory) -> SafetyMode {
    rig.pucks().lock().simulator().safety().mode()
}

/// Back before the safety module misses a heartbeat: it has not braked by itself, and could not be commanded to.
#[test]
fn for_less_than_a_heartbeat() {
    let rig = Memory::new();
    let arm = active(&rig);
    arm.position_move(ELBOW, &[100.0]).expect("it is taken");
    until("a move on its way", || elbow(&rig) < 177.5);
    rig.wire().lock().failure = Some(BusError::Off);
    until("the loss noticed", || !arm.status().connected);
    // By then the command to brake has failed too.
    until("an attempt to find the arm", || {
        let error = arm.status().last_error;
        error.is_some_and(|error| error.step == CanStep::Open)
    });
    assert_eq!(safety(&rig), SafetyMode::Active);
    rig.wire().lock().failure = None;
    until("the arm found again", || arm.status().connections == 2);
    until("control periods", || arm.status().periods > 100);
    assert_eq!(safety(&rig), SafetyMode::Idle);
    assert_eq!(modes(&arm), [Mode::HardwareFault; 7]);
    let refused = arm.position_move(ELBOW, &[100.0]);
    assert!(matches!(refused, Err(DeviceError::WrongMode { .. })));
    activate(&rig, &arm);
}

#[test]
fn at_each_frame_of_a_period() {
    let watch = (Address::from_host(Node::SAFETY), PuckProperty::MODE);
    let torques = |group: Group| Address::from_host(group).id();
    for step in [
        "reading positions",
        "watching the safety module",
        "lower",
        "upper",
    ] {
        let rig = Memory::new();
        let arm = active(&rig);
        let switch = rig.switch();
        *rig.hook().lock() = Some(Box::new(move |frame| {
            let now = match step {
                "lower" => frame.id() == torques(Group::LOWER_TORQUES),
                "upper" => frame.id() == torques(Group::UPPER_TORQUES),
                "reading positions" => SimulatedPucks::asks_for_positions(frame),
                _ => says(frame, watch.0, PuckMessage::Get(watch.1)),
            };
            if now {
                switch(Plug::Pull);
            }
            now
        }));
        until("the loss noticed", || !arm.status().connected);
        let told = arm.status().loss.expect("a reason").to_string();
        let expected = match step {
            "lower" | "upper" => "sending torques",
            other => other,
        };
        assert!(told.contains(expected), "{expected}: {told}");
    }
}

/// Pauses the driver for longer than a puck takes to restart; `meanwhile` happens at the end of that.
fn pause(rig: &Memory, meanwhile: impl Fn() + Send + 'static) {
    let mut paused = false;
    *rig.hook().lock() = Some(Box::new(move |_| {
        if !std::mem::replace(&mut paused, true) {
            std::thread::sleep(Duration::from_millis(600));
            meanwhile();
        }
        false
    }));
}

#[test]
fn a_driver_that_was_paused_goes_on_if_nothing_happened() {
    let rig = Memory::new();
    let arm = active(&rig);
    let done = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&done);
    pause(&rig, move || seen.store(true, Ordering::Relaxed));
    until("the pause", || done.load(Ordering::Relaxed));
    let periods = arm.status().periods;
    until("control", || arm.status().periods > periods + 50);
    assert_eq!(arm.status().connections, 1);
}

/// After such a time a rotor may have turned far, so that the count of a restarted puck would be plausible.
#[test]
fn a_puck_that_restarted_while_the_driver_was_paused_has_lost_its_position() {
    let rig = Memory::new();
    let arm = active(&rig);
    let pucks = rig.pucks().clone();
    pause(&rig, move || {
        pucks.lock().restart_motor(1);
        pucks.lock().advance_start(Duration::from_secs(3));
    });
    until("the lost position told", || {
        arm.status().position_lost.is_some()
    });
}
