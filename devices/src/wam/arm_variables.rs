//! Variables of an arm under control, by name, so that they can be read over a network.
//!
//! | name | of | value |
//! | --- | --- | --- |
//! | `description` | all | description of the arm; read only |
//! | `compensated_load` | all | load at the tool plate assumed by gravity compensation: kg, and x, y, z of its centre, m |
//! | `load` | the simulated arm | true load there, in the same form |
//! | `coulomb_friction` | the simulated arm | of each joint, Nm |
//! | `viscous_friction` | the simulated arm | of each joint, Nm s/deg |
//! | `status` | the arm on its bus | its state, in words; read only |
//! | `timing` | the arm on its bus | how late control periods began, and real-time settings of control, in words; read only |
//! | `confirm_home` | the arm on its bus | 1 if its position is known; set to 1, it confirms that the arm is folded at home |
//! | `zero_angles` | the arm on its bus | `zeroangle` of libbarrett's `zerocal.conf`, rad, used at the next confirmation |
//! | `puck.VERS` and others | the arm on its bus | a property of each motor's puck, in its own units; read only |
//! | `safety.VL2` and others | the arm on its bus | a property of the safety module, in its own units |

use super::arm_device::{ArmDevice, ControlledArm};
use crate::dynamics::Body;
use crate::{DeviceError, RemoteVariables, VariableValue};

const DESCRIPTION: &str = "description";
const COMPENSATED: &str = "compensated_load";
/// Maximum load, kg (Barrett's data sheet), and maximum distance of its centre from the tool plate, m.
const MAX_LOAD_MASS: f64 = 4.0;
const MAX_LOAD_DISTANCE: f64 = 1.0;

impl<A: ControlledArm<N>, const N: usize> RemoteVariables for ArmDevice<A, N> {
    fn variables(&self) -> Result<Vec<String>, DeviceError> {
        let mut names = vec![DESCRIPTION.to_owned(), COMPENSATED.to_owned()];
        names.extend(A::variables());
        Ok(names)
    }

    fn variable(&self, name: &str) -> Result<Vec<VariableValue>, DeviceError> {
        match name {
            DESCRIPTION => Ok(vec![VariableValue::Text(A::description())]),
            COMPENSATED => Ok(set_load(&self.control(|arm| *arm.compensated_load()))),
            _ => A::variable(self, name),
        }
    }

    fn set_variable(&self, name: &str, value: &[VariableValue]) -> Result<(), DeviceError> {
        match name {
            COMPENSATED => {
                let load = get_load(COMPENSATED, value)?;
                self.control(|arm| arm.set_compensated_load(load));
                Ok(())
            }
            _ => A::set_variable(self, name, value),
        }
    }
}

pub(super) fn no_variable<T>(name: &str) -> Result<T, DeviceError> {
    Err(DeviceError::NotSupported {
        what: format!("setting or asking for a variable `{name}`"),
    })
}

/// The numbers of a value, each within its range, both ends included.
pub(super) fn numbers<const N: usize>(
    what: &'static str,
    value: &[VariableValue],
    allowed: [(f64, f64); N],
) -> Result<[f64; N], DeviceError> {
    let numbers = VariableValue::numbers(value).unwrap_or_default();
    let inside = |numbers: &[f64; N]| {
        let mut pairs = numbers.iter().zip(allowed);
        pairs.all(|(number, (min, max))| (min..=max).contains(number))
    };
    <[f64; N]>::try_from(numbers.as_slice())
        .ok()
        .filter(inside)
        .ok_or_else(|| DeviceError::Unsuitable {
            what,
            asked: format!("{numbers:?}"),
            expected: format!("{N} numbers within {allowed:?}"),
        })
}

/// Formats a load as a variable.
pub(super) fn set_load(load: &Body) -> Vec<VariableValue> {
    let numbers = std::iter::once(load.mass).chain(load.centre.iter().copied());
    numbers.map(VariableValue::Number).collect()
}

/// A load as a variable is set to it.
pub(super) fn get_load(what: &'static str, value: &[VariableValue]) -> Result<Body, DeviceError> {
    let place = (-MAX_LOAD_DISTANCE, MAX_LOAD_DISTANCE);
    let [mass, x, y, z] = numbers(what, value, [(0.0, MAX_LOAD_MASS), place, place, place])?;
    Ok(Body::point(mass, [x, y, z].into()))
}
