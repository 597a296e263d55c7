//! Variables of pucks and safety module that callers can read, and the few that they can set, by name.
//!
//! Only what cannot harm: properties of motors are read. The limits of the safety module can be narrowed below those
//! the driver was started with, never widened, and not switched off (which 0 does); they return to the driver's own
//! after a reconnection. Values are whole numbers in the units of the bus.

use super::property_request::run;
use super::{CanOptions, CanWam};
use crate::can::puck::{Node, PuckProperty};
use crate::wam::arm_variables::{no_variable, numbers};
use crate::wam::can::arm_startup::limits_in_units;
use crate::{DeviceError, VariableValue};

const STATUS: &str = "status";
/// Delays of the control periods, and real-time settings of their thread.
const TIMING: &str = "timing";
/// 1 if the position is known. Setting it to 1 confirms that the arm is folded at home.
const CONFIRM_HOME: &str = "confirm_home";
/// Angles of the rotors with the joints at zero, rad, for the next confirmation; none if they are not known.
const ZERO_ANGLES: &str = "zero_angles";
/// Of the pucks of motors.
const MOTOR: [(&str, PuckProperty); 12] = [
    ("puck.VERS", PuckProperty::VERS),
    ("puck.ROLE", PuckProperty::ROLE),
    ("puck.STAT", PuckProperty::STAT),
    ("puck.MODE", PuckProperty::MODE),
    ("puck.TEMP", PuckProperty::TEMP),
    ("puck.OTEMP", PuckProperty::OTEMP),
    ("puck.VBUS", PuckProperty::VBUS),
    ("puck.T", PuckProperty::T),
    ("puck.MT", PuckProperty::MT),
    ("puck.MECH", PuckProperty::MECH),
    ("puck.CTS", PuckProperty::CTS),
    ("puck.IPNM", PuckProperty::IPNM),
];
/// Of the safety module.
const SAFETY: [(&str, PuckProperty); 13] = [
    ("safety.VERS", PuckProperty::VERS),
    ("safety.STAT", PuckProperty::STAT),
    ("safety.MODE", PuckProperty::MODE),
    ("safety.ZERO", PuckProperty::ZERO),
    ("safety.VL1", PuckProperty::VL1),
    ("safety.VL2", PuckProperty::VL2),
    ("safety.TL1", PuckProperty::TL1),
    ("safety.TL2", PuckProperty::TL2),
    ("safety.VBUS", PuckProperty::VBUS),
    ("safety.VOLTL1", PuckProperty::VOLTL1),
    ("safety.VOLTL2", PuckProperty::VOLTL2),
    ("safety.VOLTH1", PuckProperty::VOLTH1),
    ("safety.VOLTH2", PuckProperty::VOLTH2),
];

pub(super) fn names() -> impl Iterator<Item = String> {
    let properties = MOTOR.iter().chain(&SAFETY).map(|(name, _)| *name);
    [STATUS, TIMING, CONFIRM_HOME, ZERO_ANGLES]
        .into_iter()
        .chain(properties)
        .map(str::to_owned)
}

fn named(
    table: &[(&'static str, PuckProperty)],
    name: &str,
) -> Option<(&'static str, PuckProperty)> {
    table.iter().find(|(known, _)| *known == name).copied()
}

pub(super) fn variable<const N: usize>(
    device: &CanWam<N>,
    name: &str,
) -> Result<Vec<VariableValue>, DeviceError> {
    if name == STATUS {
        return Ok(vec![VariableValue::Text(device.status().to_string())]);
    }
    if name == TIMING {
        let status = device.status();
        let (delays, scheduling) = (status.delays, status.scheduling);
        let text = format!("delays of control periods: {delays}; {scheduling}");
        return Ok(vec![VariableValue::Text(text)]);
    }
    let whole = |value: i32| VariableValue::Integer(value.into());
    if name == CONFIRM_HOME {
        let known = device.status().position_lost.is_none();
        return Ok(vec![whole(known.into())]);
    }
    if name == ZERO_ANGLES {
        let angles = device.with(|arm| arm.zero_angles());
        return Ok(angles
            .iter()
            .flatten()
            .copied()
            .map(VariableValue::Number)
            .collect());
    }
    if let Some((_, property)) = named(&MOTOR, name) {
        let one = |motor| run(device, Node::of_motor(motor), property, None).map(whole);
        return (0..N).map(one).collect();
    }
    let Some((_, property)) = named(&SAFETY, name) else {
        return no_variable(name);
    };
    Ok(vec![whole(run(device, Node::SAFETY, property, None)?)])
}

pub(super) fn set_variable<const N: usize>(
    device: &CanWam<N>,
    options: &CanOptions<N>,
    name: &str,
    value: &[VariableValue],
) -> Result<(), DeviceError> {
    if name == CONFIRM_HOME {
        let [_] = numbers(CONFIRM_HOME, value, [(1.0, 1.0)])?;
        return device.confirm_home();
    }
    if name == ZERO_ANGLES {
        // Values out of range exclude a motor.
        let angles = numbers(ZERO_ANGLES, value, [(-1e3, 1e3); N])?;
        device.with(|arm| arm.set_zero_angles(angles));
        return Ok(());
    }
    let Some((name, property)) = named(&SAFETY, name) else {
        return no_variable(name);
    };
    let mut limits = limits_in_units(options).into_iter();
    let Some((_, most)) = limits.find(|(limit, _)| *limit == property) else {
        return no_variable(name);
    };
    // A limit of 0 is none, so that any is closer.
    let most = if most == 0 { i32::from(i16::MAX) } else { most };
    let [asked] = numbers(name, value, [(1.0, f64::from(most))])?;
    let asked = asked as i32;
    let got = run(device, Node::SAFETY, property, Some(asked))?;
    if got == asked {
        return Ok(());
    }
    Err(DeviceError::Unsuitable {
        what: name,
        asked: asked.to_string(),
        expected: format!("what the safety module takes; it keeps {got}"),
    })
}
