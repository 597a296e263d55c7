//! Numbers in requests.
//!
//! Stock takes anything for a number: a missing item is 0, a word is its code. So a request with a forgotten value
//! sends a joint to 0. Here a number is a number, integer or floating, and all else makes the request malformed.

use yarp_devices::{AxisIndex, MotorTorqueParameters};
use yarp_wire::{Bottle, Value};

/// The value as a floating point number, if it is a number.
pub(crate) fn float(value: &Value) -> Option<f64> {
    match value {
        Value::Int8(_)
        | Value::Int16(_)
        | Value::Int32(_)
        | Value::Int64(_)
        | Value::Float32(_)
        | Value::Float64(_) => value.as_f64(),
        _ => None,
    }
}

/// The value as a count, if it is a whole number from 0 up to `i32::MAX`.
pub(crate) fn count(value: &Value) -> Option<usize> {
    let number = float(value)?;
    let whole = number.fract() == 0.0 && (0.0..=f64::from(i32::MAX)).contains(&number);
    whole.then_some(number as usize)
}

/// Parses the value as an axis; the device checks whether the axis exists.
pub(crate) fn axis(value: &Value) -> Option<AxisIndex> {
    count(value).map(AxisIndex::from)
}

/// All items of a list as floating point numbers.
pub(crate) fn floats(list: &Bottle) -> Option<Vec<f64>> {
    list.iter().map(float).collect()
}

/// Parses the motor parameters of a torque loop: four numbers up to 3.6, nine later; missing ones are 0.
pub(super) fn motor_parameters(numbers: &[f64]) -> Option<MotorTorqueParameters> {
    let mut all = [0.0; 9];
    match numbers.len() {
        4 | 9 => all[..numbers.len()].copy_from_slice(numbers),
        _ => return None,
    }
    Some(MotorTorqueParameters::from_array(all))
}

/// An axis or a count as stock sends it.
pub(crate) fn integer(number: usize) -> Value {
    // No device has more axes than this; a larger number names none of them either way.
    Value::Int32(i32::try_from(number).unwrap_or(i32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yarp_wire::Vocab32;

    #[test]
    fn only_numbers_are_numbers() {
        let check = |value: Value, as_float: Option<f64>, as_count: Option<usize>| {
            assert_eq!(float(&value), as_float, "{value:?}");
            assert_eq!(count(&value), as_count, "{value:?}");
        };
        check(Value::Int32(3), Some(3.0), Some(3));
        check(Value::Int32(-1), Some(-1.0), None);
        check(Value::Float64(3.0), Some(3.0), Some(3));
        check(Value::Float64(3.5), Some(3.5), None);
        check(Value::Int64(1 << 40), Some((1u64 << 40) as f64), None);
        check(Value::Vocab32(Vocab32::new("a")), None, None);
        check(Value::bool(true), None, None);
        check("3".into(), None, None);
        assert_eq!(count(&Value::Float64(f64::NAN)), None);
    }
}
