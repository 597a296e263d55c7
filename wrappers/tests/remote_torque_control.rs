//! The arm with masses and friction, served on a network: what changes how it pushes and yields reaches it through server and
//! client, in the words of both wire versions.

use crate::support;

use std::cell::Cell;

use support::{Stage, eventually};
use yarp_devices::wam::DynamicWam;
use yarp_devices::{Axes, AxisIndex, Device, Impedance, Interaction, Mode, VariableValue};
use yarp_wire::WireVersion;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

const BASE: AxisIndex = AxisIndex::new(0);
const AT_BASE: Axes<'static> = Axes::One(BASE);
/// Friction of the base and encoder rounding, Nm.
const FRICTION: f64 = 3.1;

/// Returns the position of the base; retries while the newest state is old, as it may be on a busy machine.
fn position(arm: &RemoteControlBoard) -> f64 {
    let encoders = arm.encoders().expect("it has encoders");
    let place = Cell::new(0.0);
    eventually("a fresh state", || {
        let readings = encoders.encoder_readings(AT_BASE);
        readings.is_ok_and(|readings| {
            place.set(readings[0].position);
            true
        })
    });
    place.get()
}

fn set_mode(arm: &RemoteControlBoard, mode: Mode) {
    let modes = arm.control_mode().expect("it has modes");
    modes
        .set_control_modes(AT_BASE, &[mode])
        .expect("it is taken");
    eventually("the mode set", || {
        modes.control_modes(AT_BASE).is_ok_and(|now| now == [mode])
    });
}

fn yields(arm: &RemoteControlBoard) {
    let impedance = arm.impedance_control().expect("it yields");
    let interaction = arm.interaction_mode().expect("it is stiff or not");
    let limits = impedance.impedance_limits(BASE).expect("known");
    let soft = Impedance {
        stiffness: 1.0,
        damping: limits.damping.max,
    };
    impedance.set_impedance(BASE, soft).expect("it is taken");
    impedance
        .set_impedance_offset(BASE, 10.0)
        .expect("it is taken");
    let set = |asked: Interaction| {
        interaction
            .set_interactions(AT_BASE, &[asked])
            .expect("it is taken");
        eventually("the interaction mode", || {
            interaction
                .interactions(AT_BASE)
                .is_ok_and(|now| now == [asked])
        });
    };
    set(Interaction::Compliant);
    eventually("a base pushed by its offset", || {
        (position(arm) - 10.0).abs() < FRICTION
    });
    impedance
        .set_impedance_offset(BASE, 0.0)
        .expect("it is taken");
    set(Interaction::Stiff);
}

fn follows_currents(arm: &RemoteControlBoard) {
    let control = arm.current_control().expect("it has currents");
    let most = control.current_ranges(AT_BASE).expect("known")[0].max;
    // 3.6 of 25 Nm; the motor turns the other way.
    let asked = most * 3.6 / 25.0;
    set_mode(arm, Mode::Current);
    let start = position(arm);
    control
        .set_reference_currents(AT_BASE, &[asked])
        .expect("it is sent");
    eventually("a base that turns", || position(arm) < start - 3.0);
    eventually("the current told", || {
        control
            .currents(AT_BASE)
            .is_ok_and(|now| (now[0] - asked).abs() < 1e-3)
    });
    set_mode(arm, Mode::Position);
}

fn knows_no_duty_cycles(arm: &RemoteControlBoard) {
    let control = arm.pwm_control().expect("it is asked in vain");
    assert!(control.reference_duty_cycles(AT_BASE).is_err());
    assert!(control.duty_cycles(AT_BASE).is_err());
    let modes = arm.control_mode().expect("it has modes");
    // A refusal is not reported in every wire version.
    let _ = modes.set_control_modes(AT_BASE, &[Mode::Pwm]);
    eventually("the mode it had", || {
        modes
            .control_modes(AT_BASE)
            .is_ok_and(|now| now == [Mode::Position])
    });
}

fn has_variables(arm: &RemoteControlBoard) {
    let control = arm.remote_variables().expect("it has variables");
    let names = control.variables().expect("known");
    assert!(
        names.iter().any(|name| name == "coulomb_friction"),
        "{names:?}"
    );
    let load = [0.5, 0.0, 0.0, 0.1].map(VariableValue::Number);
    control
        .set_variable("compensated_load", &load)
        .expect("it is taken");
    assert_eq!(control.variable("compensated_load").expect("known"), load);
    let heavy = [50.0, 0.0, 0.0, 0.1].map(VariableValue::Number);
    assert!(control.set_variable("compensated_load", &heavy).is_err());
    let motor = arm.motor().expect("it has motors");
    assert_eq!(motor.gearbox_ratio(BASE).expect("known"), -42.0);
}

fn over_the_network(wire_version: WireVersion) {
    let stage = Stage::new();
    let server = stage.serve(
        "/wam",
        DynamicWam::start().expect("the machine has threads"),
    );
    let options = RemoteControlBoardOptions::new("/wam", "/tester").wire_version(wire_version);
    let arm = RemoteControlBoard::open(&stage.network, options).expect("it can be reached");
    yields(&arm);
    follows_currents(&arm);
    knows_no_duty_cycles(&arm);
    has_variables(&arm);
    drop(arm);
    stage.runtime.block_on(server.close());
}

#[test]
fn in_the_words_of_3() {
    over_the_network(WireVersion::V3);
}

#[test]
fn in_the_words_of_4() {
    over_the_network(WireVersion::V4);
}
