//! Messages of clocks.

use yarp_devices::clock::NetworkTime;
use yarp_wire::{Bottle, Value};

/// Puts a message of a clock into effect: whole seconds and nanoseconds, two integers. Returns the reason if it is no time.
pub(super) fn apply(message: &Bottle, time: &NetworkTime) -> Result<(), String> {
    let number = |place: usize| match message.get(place)? {
        Value::Int8(number) => Some(i64::from(*number)),
        Value::Int16(number) => Some(i64::from(*number)),
        Value::Int32(number) => Some(i64::from(*number)),
        Value::Int64(number) => Some(*number),
        _ => None,
    };
    match (number(0), number(1)) {
        (Some(seconds), Some(nanoseconds)) => time
            .tick(seconds, nanoseconds)
            .map_err(|error| error.to_string()),
        _ => Err("expected two integers, seconds and nanoseconds".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_two_integers() {
        let check = |text: &str, expected: Option<f64>| {
            let time = NetworkTime::new("/clock");
            let message = Bottle::parse(text).expect("test data is valid");
            assert_eq!(apply(&message, &time).is_ok(), expected.is_some(), "{text}");
            assert_eq!(time.time(), expected, "{text}");
        };
        check("3 500000000", Some(3.5));
        check("0 0", Some(0.0));
        // Wall-clock time after 2038 does not fit into 32 bits.
        check("4000000000 0", Some(4e9));
        check("3 500000000 more", Some(3.5));
        check("", None);
        check("3", None);
        check("3.0 0", None);
        check("nan nan", None);
        check("(3 0)", None);
        check("[on] 0", None);
        check("\"3\" \"0\"", None);
        check("-1 0", None);
        check("1 -1", None);
        check("1 1000000000", None);
    }
}
