//! Variables of the simulated machine that can be changed while it runs, by name.

use super::arm_variables::{get_load, no_variable, numbers, set_load};
use super::dynamic_arm::DynamicArm;
use super::dynamic_wam::DynamicWam;
use super::wam_model::Friction;
use crate::{DeviceError, VariableValue};

pub(super) const NAMES: [&str; 3] = [LOAD, COULOMB, VISCOUS];
const LOAD: &str = "load";
const COULOMB: &str = "coulomb_friction";
const VISCOUS: &str = "viscous_friction";
/// More holds any joint, Nm.
const MAX_COULOMB: f64 = 100.0;
/// Nm s/deg.
const MAX_VISCOUS: f64 = 10.0;

pub(super) fn variable<const N: usize>(
    device: &DynamicWam<N>,
    name: &str,
) -> Result<Vec<VariableValue>, DeviceError> {
    let each = |of: fn(&Friction) -> f64| {
        device.with(|arm| {
            let friction = &arm.simulator().model().friction;
            let numbers = friction.iter().map(of);
            numbers.map(VariableValue::Number).collect()
        })
    };
    match name {
        LOAD => Ok(device.with(|arm: &mut DynamicArm<N>| set_load(arm.simulator().load()))),
        COULOMB => Ok(each(|friction| friction.coulomb)),
        VISCOUS => Ok(each(|friction| friction.viscous.to_radians())),
        _ => no_variable(name),
    }
}

pub(super) fn set_variable<const N: usize>(
    device: &DynamicWam<N>,
    name: &str,
    value: &[VariableValue],
) -> Result<(), DeviceError> {
    let rub = |numbers: [f64; N], set: fn(&mut Friction, f64)| {
        device.with(|arm| {
            let mut friction = arm.simulator().model().friction;
            for (joint, number) in friction.iter_mut().zip(numbers) {
                set(joint, number);
            }
            arm.simulator_mut().set_friction(friction);
        });
    };
    match name {
        LOAD => {
            let load = get_load(LOAD, value)?;
            device.with(|arm| arm.simulator_mut().set_load(load));
        }
        COULOMB => rub(
            numbers(COULOMB, value, [(0.0, MAX_COULOMB); N])?,
            |joint, number| joint.coulomb = number,
        ),
        VISCOUS => rub(
            numbers(VISCOUS, value, [(0.0, MAX_VISCOUS); N])?,
            // Per radian it is more.
            |joint, number| joint.viscous = number.to_degrees(),
        ),
        _ => return no_variable(name),
    }
    Ok(())
}
