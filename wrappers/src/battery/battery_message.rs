//! The numbers of a reading in a message.

use yarp_devices::{BatteryReading, BatteryStatus};
use yarp_wire::{Bottle, Value};

/// Order of the numbers of a battery on the wire, and the request of a client.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum BatteryLayout {
    /// That of `batteryWrapper` and `batteryClient` of 3.5.
    Wrapper,
    /// That of `battery_nws_yarp` and `battery_nwc_yarp`, from 3.12 on.
    #[default]
    Nws,
}

impl BatteryLayout {
    /// Returns the message of a reading.
    pub(super) fn message(self, reading: &BatteryReading) -> Bottle {
        let BatteryReading {
            voltage,
            current,
            charge,
            temperature,
            ..
        } = *reading;
        let numbers = match self {
            Self::Wrapper => [voltage, current, charge, temperature],
            Self::Nws => [charge, voltage, current, temperature],
        };
        let status = Value::Int32(reading.status.into());
        numbers
            .map(Value::Float64)
            .into_iter()
            .chain([status])
            .collect()
    }

    /// Returns the reading of a message with this time; `None` if it is malformed.
    pub(super) fn read(self, message: &Bottle, time: f64) -> Option<BatteryReading> {
        let [first, second, third, fourth, status] = message.as_slice() else {
            return None;
        };
        let numbers = [first.as_f64()?, second.as_f64()?, third.as_f64()?];
        let [voltage, current, charge] = match (self, numbers) {
            (Self::Wrapper, numbers) => numbers,
            (Self::Nws, [charge, voltage, current]) => [voltage, current, charge],
        };
        Some(BatteryReading {
            voltage,
            current,
            charge,
            temperature: fourth.as_f64()?,
            status: BatteryStatus::from(status.as_i32()?),
            time,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_have_the_order_of_stock() {
        let reading = BatteryReading {
            voltage: 24.5,
            current: -2.0,
            charge: 80.0,
            temperature: 30.0,
            status: BatteryStatus::Charging,
            time: 7.0,
        };
        let check = |layout: BatteryLayout, text: &str| {
            let message = layout.message(&reading);
            assert_eq!(message.to_string(), text);
            assert_eq!(layout.read(&message, 7.0), Some(reading));
        };
        check(BatteryLayout::Wrapper, "24.5 -2.0 80.0 30.0 1");
        check(BatteryLayout::Nws, "80.0 24.5 -2.0 30.0 1");
        for text in [
            "",
            "1.0 2.0 3.0 4.0",
            "1.0 2.0 3.0 4.0 5 6",
            "a 2.0 3.0 4.0 5",
        ] {
            let message = Bottle::parse(text).unwrap();
            assert_eq!(BatteryLayout::Nws.read(&message, 0.0), None, "{text}");
        }
    }
}
