//! A simulated battery.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::clock::{self, TimeSource};
use crate::{Battery, BatteryReading, BatteryStatus, Device, DeviceError};

/// Charge below which the battery is low, percent.
const LOW_CHARGE: f64 = 15.0;
/// Charge below which the battery is nearly empty, percent.
const CRITICAL_CHARGE: f64 = 5.0;
/// Voltage of the empty and of the full battery, V.
const VOLTAGES: (f64, f64) = (21.0, 29.4);
/// Temperature, °C.
const TEMPERATURE: f64 = 25.0;

/// A battery of 7 lithium cells that is discharged, or charged, by a given current.
///
/// ```
/// use std::time::Duration;
/// use yarp_devices::fake::SimulatedBattery;
///
/// let battery = SimulatedBattery::new(10.0, 5.0);
/// assert_eq!(battery.reading_after(Duration::ZERO).charge, 100.0);
/// assert_eq!(battery.reading_after(Duration::from_secs(3600)).charge, 50.0);
/// ```
#[derive(Debug)]
pub struct SimulatedBattery {
    /// Ampere-hours.
    capacity: f64,
    state: Mutex<State>,
}

#[derive(Clone, Copy, Debug)]
struct State {
    /// Charge at `since`, percent.
    charge: f64,
    since: Instant,
    /// A; positive while it is discharged.
    current: f64,
}

impl SimulatedBattery {
    /// A full battery of `capacity` ampere-hours that gives `current` amperes; a negative current charges it.
    pub fn new(capacity: f64, current: f64) -> Self {
        Self {
            capacity,
            state: Mutex::new(State {
                charge: 100.0,
                since: TimeSource::current().instant(),
                current,
            }),
        }
    }

    /// Sets the charge, 0 to 100 percent, and the current from now on, A.
    pub fn set(&self, charge: f64, current: f64) {
        *self.state() = State {
            charge: charge.clamp(0.0, 100.0),
            since: TimeSource::current().instant(),
            current,
        };
    }

    /// Returns what it measures that long after the last [`set`](Self::set), or after its creation.
    pub fn reading_after(&self, elapsed: Duration) -> BatteryReading {
        let State {
            charge, current, ..
        } = *self.state();
        let given = current * elapsed.as_secs_f64() / 3600.0;
        let charge = (charge - 100.0 * given / self.capacity).clamp(0.0, 100.0);
        let (empty, full) = VOLTAGES;
        BatteryReading {
            voltage: empty + (full - empty) * charge / 100.0,
            current,
            charge,
            temperature: TEMPERATURE,
            status: status(charge, current),
            time: clock::now(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn status(charge: f64, current: f64) -> BatteryStatus {
    match charge {
        _ if current < 0.0 => BatteryStatus::Charging,
        ..CRITICAL_CHARGE => BatteryStatus::Critical,
        ..LOW_CHARGE => BatteryStatus::Low,
        _ if current == 0.0 => BatteryStatus::Standby,
        _ => BatteryStatus::InUse,
    }
}

impl Battery for SimulatedBattery {
    fn battery_reading(&self) -> Result<BatteryReading, DeviceError> {
        let now = TimeSource::current().instant();
        let elapsed = now.saturating_duration_since(self.state().since);
        Ok(self.reading_after(elapsed))
    }

    fn battery_info(&self) -> Result<String, DeviceError> {
        Ok(format!("simulated battery, {} Ah", self.capacity))
    }
}

impl Device for SimulatedBattery {
    crate::offers! { battery: Battery }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charge_voltage_and_status_follow_the_current() {
        let battery = SimulatedBattery::new(10.0, 5.0);
        let after = |hours: f64| battery.reading_after(Duration::from_secs_f64(3600.0 * hours));
        assert_eq!(
            (after(0.0).voltage, after(0.0).status),
            (29.4, BatteryStatus::InUse)
        );
        assert_eq!(
            (after(1.0).charge, after(1.0).status),
            (50.0, BatteryStatus::InUse)
        );
        assert_eq!(after(0.0).temperature, 25.0);
        // Low below 15 percent, critical below 5.
        assert_eq!(after(1.68).status, BatteryStatus::InUse);
        assert_eq!(after(1.72).status, BatteryStatus::Low);
        assert_eq!(after(1.88).status, BatteryStatus::Low);
        assert_eq!(after(1.92).status, BatteryStatus::Critical);
        assert_eq!(after(1.75).status, BatteryStatus::Low);
        assert_eq!(after(1.95).status, BatteryStatus::Critical);
        assert_eq!((after(9.0).charge, after(9.0).voltage), (0.0, 21.0));
        battery.set(2.0, -10.0);
        assert_eq!(after(0.0).status, BatteryStatus::Charging);
        assert_eq!(after(2.0).charge, 100.0);
        battery.set(80.0, 0.0);
        assert_eq!(
            (after(5.0).charge, after(5.0).status),
            (80.0, BatteryStatus::Standby)
        );
    }
}
