//! Named values: `(Kp (1.0 2.0)) (Ts 0.05) (dominantEye left)`.

use yarp_devices::{GazeOptions, VariableValue};
use yarp_wire::{Bottle, Value};

use crate::control_board::messages::{read_variable, variable_values};

/// Returns named values as they travel.
pub(super) fn to_list(options: &GazeOptions) -> Bottle {
    let one = |(name, value): &(String, Vec<VariableValue>)| {
        let mut list = Bottle::of(name.as_str());
        variable_values(value).for_each(|value| list.push(value));
        Value::List(list)
    };
    options.options.iter().map(one).collect()
}

/// Reads named values; `None` for a list that holds anything else.
pub(super) fn read(values: &[Value]) -> Option<GazeOptions> {
    let one = |value: &Value| {
        let (name, value) = value.as_list()?.as_slice().split_first()?;
        Some((name.as_str()?.to_owned(), read_variable(value)?))
    };
    let options = values.iter().map(one).collect::<Option<_>>()?;
    Some(GazeOptions { options })
}
