//! Batteries.

use crate::DeviceError;

/// The battery of a robot (stock: `IBattery`).
pub trait Battery: Send + Sync {
    /// Returns what the battery measures, all of one moment (`getBatteryVoltage`, `getBatteryCurrent`,
    /// `getBatteryCharge`, `getBatteryTemperature`, `getBatteryStatus`).
    ///
    /// Errors: for a device behind a network [`DeviceError::NoDataYet`] and [`DeviceError::Stale`].
    fn battery_reading(&self) -> Result<BatteryReading, DeviceError>;

    /// Returns the description of the battery, for people (`getBatteryInfo`).
    ///
    /// Errors: those of the device.
    fn battery_info(&self) -> Result<String, DeviceError>;
}

/// A measurement of a battery.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatteryReading {
    /// Voltage, V.
    pub voltage: f64,
    /// Current, A; positive while the battery is discharged.
    pub current: f64,
    /// Charge, percent of the full battery.
    pub charge: f64,
    /// Temperature, °C.
    pub temperature: f64,
    /// Condition of the battery.
    pub status: BatteryStatus,
    /// Time of the measurement: seconds since the start of 1970.
    pub time: f64,
}

/// Condition of a battery (stock: `IBattery::Battery_status`).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum BatteryStatus {
    /// Neither charged nor discharged.
    Standby,
    /// It is charged.
    Charging,
    /// It is discharged.
    InUse,
    /// It reports an error.
    Error,
    /// It does not answer.
    Timeout,
    /// Its charge is low.
    Low,
    /// Its charge is nearly gone.
    Critical,
    /// Any other number, as received.
    Other(i32),
}

/// Statuses in the order of their numbers on the wire, from 0.
const NUMBERED: [BatteryStatus; 7] = [
    BatteryStatus::Standby,
    BatteryStatus::Charging,
    BatteryStatus::InUse,
    BatteryStatus::Error,
    BatteryStatus::Timeout,
    BatteryStatus::Low,
    BatteryStatus::Critical,
];

impl From<i32> for BatteryStatus {
    fn from(number: i32) -> Self {
        let place = usize::try_from(number).ok();
        let known = place.and_then(|place| NUMBERED.get(place));
        known.copied().unwrap_or(Self::Other(number))
    }
}

impl From<BatteryStatus> for i32 {
    fn from(status: BatteryStatus) -> Self {
        match status {
            BatteryStatus::Standby => 0,
            BatteryStatus::Charging => 1,
            BatteryStatus::InUse => 2,
            BatteryStatus::Error => 3,
            BatteryStatus::Timeout => 4,
            BatteryStatus::Low => 5,
            BatteryStatus::Critical => 6,
            BatteryStatus::Other(number) => number,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statuses_have_the_numbers_of_stock() {
        for number in -1..9 {
            assert_eq!(i32::from(BatteryStatus::from(number)), number);
        }
        assert_eq!(BatteryStatus::from(6), BatteryStatus::Critical);
        assert_eq!(BatteryStatus::from(7), BatteryStatus::Other(7));
    }
}
