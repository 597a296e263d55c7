//! Variables of the arms under control: assumed loads, simulated properties, and properties of pucks.

use std::time::Duration;

use yarp_devices::can::puck::{PuckMessage, PuckProperty};
use yarp_devices::wam::DynamicWam;
use yarp_devices::wam::can::CanWam;
use yarp_devices::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, ControlCalibration, ControlMode, Device,
    DeviceError, Encoders, Impedance, ImpedanceControl, Interaction, InteractionMode, Mode, Motor,
    PositionControl, RemoteVariables, VariableValue,
};

use crate::can;

use can::memory::Memory;
use can::scenarios::{active, start};
use can::{Plug, Rig, until};

const BASE: AxisIndex = AxisIndex::new(0);
const SHOULDER: AxisIndex = AxisIndex::new(1);

fn values(numbers: &[f64]) -> Vec<VariableValue> {
    numbers.iter().copied().map(VariableValue::Number).collect()
}

fn whole(device: &CanWam, name: &str) -> Vec<i64> {
    let told = device.variable(name).expect("it is told");
    let whole = |value: &VariableValue| match value {
        VariableValue::Integer(value) => *value,
        other => panic!("{name} has {other:?}"),
    };
    told.iter().map(whole).collect()
}

fn dynamic() -> DynamicWam {
    DynamicWam::start().expect("the arm starts")
}

fn place(arm: &DynamicWam, joint: AxisIndex) -> f64 {
    arm.encoder_readings(joint.into()).unwrap()[0].position
}

/// Compliant with 1 Nm/deg.
fn soften(arm: &DynamicWam, joint: AxisIndex) {
    let damping = arm.impedance_limits(joint).unwrap().damping.max;
    let stiffness = 1.0;
    arm.set_impedance(joint, Impedance { stiffness, damping })
        .unwrap();
    arm.set_interactions(joint.into(), &[Interaction::Compliant])
        .unwrap();
}

fn has_what_all_arms_have(arm: &dyn Device) {
    let variables = arm.remote_variables().expect("it has variables");
    let names = variables.variables().unwrap();
    assert_eq!(names[..2], ["description", "compensated_load"]);
    let described = variables.variable("description").unwrap();
    assert!(matches!(&described[..], [VariableValue::Text(text)] if text.contains("WAM")));
    let load = "compensated_load";
    assert_eq!(variables.variable(load).unwrap(), values(&[0.0; 4]));
    let bad: [&[f64]; 5] = [
        &[1.0, 0.0, 0.0],
        &[5.0, 0.0, 0.0, 0.0],
        &[-1.0, 0.0, 0.0, 0.0],
        &[1.0, 0.0, 0.0, 2.0],
        &[f64::NAN, 0.0, 0.0, 0.0],
    ];
    for bad in bad {
        let refused = variables.set_variable(load, &values(bad)).unwrap_err();
        let why = refused.to_string();
        assert!(why.contains("compensated_load"), "{why}");
    }
    let word = [VariableValue::Text("heavy".to_owned())];
    assert!(variables.set_variable(load, &word).is_err());
    let hand = values(&[0.5, 0.0, 0.0, 0.1]);
    variables.set_variable(load, &hand).expect("it is taken");
    assert_eq!(variables.variable(load).unwrap(), hand);
    let one_list = [VariableValue::List(values(&[0.0; 4]))];
    variables
        .set_variable(load, &one_list)
        .expect("it is taken");
    for name in ["colour", "description"] {
        let refused = variables.set_variable(name, &hand);
        assert!(matches!(refused, Err(DeviceError::NotSupported { .. })));
    }
    for name in names {
        assert!(variables.variable(&name).is_ok(), "{name}");
    }
    assert!(variables.variable("colour").is_err());
}

#[test]
fn the_simulated_arm_has_them() {
    has_what_all_arms_have(&dynamic());
}

#[test]
fn the_arm_on_its_bus_has_them() {
    has_what_all_arms_have(&start(&Memory::new()));
}

/// 1.5 kg at the end of the arm, nearly straight, are 11 Nm at the shoulder; what measured moments and friction leave is below 5.
#[test]
fn a_load_pulls_the_arm_down_until_it_is_compensated() {
    let arm = dynamic();
    let raised = [0.0, -60.0_f64.to_radians(), 0.0, 0.0, 0.0, 0.0, 0.0];
    arm.with(|arm| {
        arm.simulator_mut().place(&raised.into());
        let counts = arm.simulator().counts();
        arm.forget_motion(counts);
        arm.hold();
    });
    soften(&arm, SHOULDER);
    let load = values(&[1.5, 0.0, 0.0, 0.0]);
    arm.set_variable("load", &load).expect("it is taken");
    assert_eq!(arm.variable("load").unwrap(), load);
    until("a shoulder that gives way", || {
        place(&arm, SHOULDER) < -66.0
    });
    arm.set_variable("compensated_load", &load)
        .expect("it is taken");
    until("a shoulder that is held again", || {
        place(&arm, SHOULDER) > -65.0
    });
}

/// The base sticks where the push ends, until its friction is removed.
#[test]
fn friction_can_be_taken_away() {
    let arm = dynamic();
    let rubbing = arm.variable("coulomb_friction").unwrap();
    assert_eq!(rubbing[0], VariableValue::Number(2.7));
    soften(&arm, BASE);
    // 2.1 Nm.
    arm.with(|arm| arm.push([0.0, 10.0, 0.0]));
    let now = || arm.with(|arm| arm.simulator().time());
    let end = now() + Duration::from_millis(500);
    until("half a second", || now() >= end);
    assert!(place(&arm, BASE).abs() < 0.1, "{}", place(&arm, BASE));
    for name in ["coulomb_friction", "viscous_friction"] {
        arm.set_variable(name, &values(&[0.0; 7])).expect("taken");
        assert_eq!(arm.variable(name).unwrap(), values(&[0.0; 7]));
        assert!(arm.set_variable(name, &values(&[-1.0; 7])).is_err());
        assert!(arm.set_variable(name, &values(&[1.0; 6])).is_err());
    }
    until("a base that gives way", || place(&arm, BASE) < -1.5);
}

/// A friction per deg/s is 57.2958 times as much per rad/s.
#[test]
fn viscous_friction_is_told_per_degree() {
    let arm = dynamic();
    arm.set_variable("viscous_friction", &values(&[0.02; 7]))
        .expect("it is taken");
    let per_radian = arm.with(|arm| arm.simulator().model().friction[6].viscous);
    assert!((per_radian - 1.145_916).abs() < 1e-6, "{per_radian}");
    let VariableValue::Number(told) = arm.variable("viscous_friction").unwrap()[6] else {
        panic!("no number");
    };
    assert!((told - 0.02).abs() < 1e-12, "{told}");
}

#[test]
fn frictions_have_a_range() {
    let arm = dynamic();
    for (name, most) in [("coulomb_friction", 100.0), ("viscous_friction", 10.0)] {
        for (asked, fits) in [
            (0.0, true),
            (-0.001, false),
            (most, true),
            (most * 1.01, false),
        ] {
            let taken = arm.set_variable(name, &values(&[asked; 7]));
            assert_eq!(taken.is_ok(), fits, "{name} {asked}");
        }
    }
}

#[test]
fn pucks_tell_their_properties() {
    let rig = Memory::new();
    let arm = active(&rig);
    assert_eq!(
        whole(&arm, "puck.IPNM"),
        [2700, 2700, 2700, 2700, 6500, 6500, 17474]
    );
    assert_eq!(whole(&arm, "puck.TEMP"), [40; 7]);
    assert_eq!(whole(&arm, "safety.MODE"), [2]);
    assert_eq!(whole(&arm, "safety.VL2"), [4096]);
    // Only what cannot harm can be set.
    for name in ["puck.MT", "puck.MODE", "safety.MODE", "safety.ZERO"] {
        let refused = arm.set_variable(name, &values(&[1.0]));
        assert!(
            matches!(refused, Err(DeviceError::NotSupported { .. })),
            "{name}"
        );
    }
    for wrong in [0.0, -1.0, 4097.0] {
        let refused = arm.set_variable("safety.VL2", &values(&[wrong]));
        assert!(
            matches!(refused, Err(DeviceError::Unsuitable { .. })),
            "{wrong}"
        );
    }
    arm.set_variable("safety.VL2", &values(&[2048.0]))
        .expect("closer is allowed");
    let limits = rig.pucks().lock().simulator().safety().limits();
    assert_eq!(limits.velocity_fault, 0.5);
    assert_eq!(arm.status().connections, 1);
}

#[test]
fn motors_tell_how_warm_they_are() {
    let rig = Memory::new();
    let arm = active(&rig);
    until("all temperatures", || arm.temperatures(Axes::All).is_ok());
    let temperatures = arm.temperatures(Axes::All).unwrap();
    assert!(
        temperatures.iter().all(|warm| (40.0..60.0).contains(warm)),
        "{temperatures:?}"
    );
    assert_eq!(arm.temperature_limit(BASE).unwrap(), 60.0);
    assert_eq!(arm.supply_voltage(BASE).unwrap(), 48.0);
    assert_eq!(arm.gearbox_ratio(BASE).unwrap(), -42.0);
    let peak = arm.amplifier_limit(AmplifierLimit::PeakCurrent, BASE);
    assert_eq!(peak.unwrap(), 4860.0 / 1024.0);
    assert!(arm.set_temperature_limit(BASE, 90.0).is_err());
    assert!(arm.temperatures(Axes::One(7.into())).is_err());
}

/// A puck without such a property does not answer, which is no reason to lose the arm.
#[test]
fn a_question_without_an_answer_is_told() {
    let rig = Memory::new();
    let arm = active(&rig);
    rig.wire().lock().noise = Some(Box::new(|frames| {
        let is_voltage = |message| matches!(message, PuckMessage::Value { property, .. } if property == PuckProperty::VBUS);
        let others = frames.into_iter().filter(|frame| {
            !PuckMessage::read(frame).is_ok_and(|(_, message)| is_voltage(message))
        });
        others.collect()
    }));
    let why = arm.supply_voltage(BASE).unwrap_err().to_string();
    assert!(why.contains("asking puck 1 for property 21"), "{why}");
    assert!(why.contains("the power of the arm"), "{why}");
    assert_eq!(arm.temperature_limit(BASE).unwrap(), 60.0);
    assert_eq!(arm.status().connections, 1);
    (rig.switch())(Plug::Pull);
    until("the loss noticed", || !arm.status().connected);
    let why = arm.variable("puck.TEMP").unwrap_err().to_string();
    assert!(why.contains("the arm on the CAN bus"), "{why}");
    assert!(arm.temperatures(Axes::All).is_err());
}

#[test]
fn amplifiers_go_with_the_modes_and_the_arm_is_parked_at_home() {
    let arm = dynamic();
    assert_eq!(arm.amplifier_status(Axes::All).unwrap(), [1; 7]);
    arm.enable_amplifiers(BASE.into(), false).unwrap();
    assert_eq!(arm.control_modes(BASE.into()).unwrap(), [Mode::Idle]);
    arm.enable_amplifiers(BASE.into(), true).unwrap();
    assert_eq!(arm.amplifier_status(BASE.into()).unwrap(), [0]);
    assert!(arm.park_robot(false).is_err(), "the base is idle");
    arm.set_control_modes(BASE.into(), &[Mode::Position])
        .unwrap();
    assert!(arm.calibration_done(BASE).unwrap());
    let why = arm.calibrate_robot().unwrap_err().to_string();
    assert!(why.contains("folding"), "{why}");
    arm.position_move(BASE.into(), &[10.0]).unwrap();
    until("the move on its way", || place(&arm, BASE) > 2.0);
    arm.park_robot(true).unwrap();
    assert!(place(&arm, BASE).abs() < 1.0, "{}", place(&arm, BASE));
    arm.with(|arm| arm.safety_mut().press_stop());
    until("a stopped arm", || {
        arm.amplifier_status(BASE.into()).unwrap() == [0]
    });
    assert!(arm.enable_amplifiers(BASE.into(), true).is_err());
}
