//! Requests for calibration.

use yarp_devices::{AnalogSensor, DeviceError};
use yarp_wire::{Bottle, Value, Vocab32};

const ANALOG: Vocab32 = Vocab32::new("iana");
const CALIBRATE: Vocab32 = Vocab32::new("cal");
const CALIBRATE_CHANNEL: Vocab32 = Vocab32::new("calc");
/// Stock's `AS_OK` and `AS_ERROR`.
const OK: i32 = 0;
const ERROR: i32 = 1;

/// Returns the request to make the present values zero, of one channel or of all.
pub(super) fn calibration(channel: Option<usize>) -> Bottle {
    match channel {
        None => Bottle::from_iter([ANALOG.into(), CALIBRATE.into()]),
        Some(channel) => {
            let channel = i32::try_from(channel).unwrap_or(i32::MAX);
            Bottle::from_iter([ANALOG.into(), CALIBRATE_CHANNEL.into(), channel.into()])
        }
    }
}

/// Returns whether the answer to a calibration means that it was done.
pub(super) fn is_done(answer: &Bottle) -> bool {
    matches!(answer.get(0), Some(Value::Int32(OK)))
}

/// Executes a request; returns the answer, and the reason of a refusal.
pub(super) fn answer(sensor: &dyn AnalogSensor, request: &Bottle) -> (Bottle, Option<DeviceError>) {
    let word = |index: usize| request.get(index).and_then(Value::as_vocab);
    let channel = match (word(0), word(1), request.len()) {
        (Some(ANALOG), Some(CALIBRATE), 2) => None,
        (Some(ANALOG), Some(CALIBRATE_CHANNEL), 3) => {
            let channel = request.get(2).and_then(Value::as_i64);
            match channel.and_then(|channel| usize::try_from(channel).ok()) {
                Some(channel) => Some(channel),
                None => return (Bottle::of(ERROR), None),
            }
        }
        // Values to be reached are an error: no device here takes any.
        (Some(ANALOG), Some(CALIBRATE | CALIBRATE_CHANNEL), 3..) => {
            let error = DeviceError::NotSupported {
                what: "calibrating to given values".to_owned(),
            };
            return (Bottle::of(ERROR), Some(error));
        }
        _ => return (Bottle::of(Vocab32::FAIL), None),
    };
    match sensor.calibrate(channel) {
        Ok(()) => (Bottle::of(OK), None),
        Err(error) => (Bottle::of(ERROR), Some(error)),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use yarp_devices::SensorReading;

    use super::*;

    #[derive(Default)]
    struct Sensor(Mutex<Vec<Option<usize>>>);

    impl AnalogSensor for Sensor {
        fn channels(&self) -> usize {
            6
        }
        fn read_channels(&self, reading: &mut SensorReading) {
            reading.set(&[0.0; 6], 0.0);
        }
        fn calibrate(&self, channel: Option<usize>) -> Result<(), DeviceError> {
            if channel == Some(9) {
                return Err(DeviceError::NotSupported { what: "9".into() });
            }
            self.0.lock().unwrap().push(channel);
            Ok(())
        }
    }

    #[test]
    fn requests_are_answered_as_in_stock() {
        let sensor = Sensor::default();
        let check = |text: &str, expected: &str| {
            let request = Bottle::parse(text).unwrap();
            assert_eq!(answer(&sensor, &request).0.to_string(), expected, "{text}");
        };
        check("[iana] [cal]", "0");
        check("[iana] [calc] 3", "0");
        check("[iana] [calc] 9", "1");
        check("[iana] [calc] -1", "1");
        check("[iana] [calc] 3 0.5", "1");
        check("[iana] [cal] 1.0 2.0", "1");
        for other in ["", "[iana]", "[iana] [calc]", "[cal]", "[get] [cal]"] {
            check(other, "[fail]");
        }
        assert_eq!(*sensor.0.lock().unwrap(), [None, Some(3)]);
        assert!(is_done(&Bottle::parse("0").unwrap()));
        for text in ["1", "[fail]", ""] {
            assert!(!is_done(&Bottle::parse(text).unwrap()));
        }
        for channel in [None, Some(3)] {
            assert!(is_done(&answer(&sensor, &calibration(channel)).0));
        }
    }
}
