//! The values of variables.

use yarp_devices::VariableValue;
use yarp_wire::{Bottle, Value};

/// The values as they travel.
pub(crate) fn to_values(values: &[VariableValue]) -> impl Iterator<Item = Value> {
    values.iter().map(|value| match value {
        VariableValue::Integer(number) => match i32::try_from(*number) {
            Ok(number) => number.into(),
            Err(_) => (*number).into(),
        },
        VariableValue::Number(number) => (*number).into(),
        VariableValue::Text(text) => text.as_str().into(),
        VariableValue::List(values) => Value::List(to_values(values).collect::<Bottle>()),
    })
}

/// The values as they came; `None` where one is of a kind that no variable has.
pub(crate) fn read(values: &[Value]) -> Option<Vec<VariableValue>> {
    let one = |value: &Value| {
        Some(match value {
            Value::Float32(_) | Value::Float64(_) => VariableValue::Number(value.as_f64()?),
            Value::Int8(_) | Value::Int16(_) | Value::Int32(_) | Value::Int64(_) => {
                VariableValue::Integer(value.as_i64()?)
            }
            Value::List(list) | Value::Dictionary(list) => {
                VariableValue::List(read(list.as_slice())?)
            }
            Value::Blob(_) => return None,
            text => VariableValue::Text(text.to_plain_string()),
        })
    };
    values.iter().map(one).collect()
}
