//! An inertial sensor whose values count up.

use std::time::{Duration, Instant};

use crate::clock::{self, TimeSource};
use crate::imu_layout::{CHANNELS, KINDS};
use crate::{AnalogSensors, Device, GenericSensor, SensorInfo, SensorKind, SensorReading};

/// Gravity that stock's sensor measures, m/s².
const GRAVITY: f64 = 9.81;
/// Half a turn in radians, with as many digits as stock's sensor has.
#[expect(
    clippy::approx_constant,
    reason = "stock's values are the same to the last digit"
)]
const HALF_TURN: f64 = 3.14;
/// First value, and the value from which it starts at 0 again.
const FIRST_COUNT: u64 = 10;
const COUNTS: u64 = 360;

/// An inertial sensor as stock's `fakeIMU`: a number goes up by one each period, from 10 to 359 and on from 0.
///
/// Orientation, angular velocity and magnetic field are this number on all axes. The acceleration is that of gravity on a sensor with
/// this pitch in degrees. The values depend on the elapsed time alone.
///
/// ```
/// use std::time::Duration;
/// use yarp_devices::fake::FakeImu;
///
/// let imu = FakeImu::new(Duration::from_millis(10));
/// assert_eq!(imu.values_after(Duration::ZERO)[..3], [10.0; 3]);
/// assert_eq!(imu.values_after(Duration::from_millis(25))[6..9], [12.0; 3]);
/// ```
#[derive(Debug)]
pub struct FakeImu {
    /// Period of the counting; none if the first value stays.
    period: Option<Duration>,
    start: Instant,
    info: SensorInfo,
}

impl FakeImu {
    /// Creates a sensor that counts every `period`; a period of 0 is one of 1 ns.
    pub fn new(period: Duration) -> Self {
        Self {
            period: Some(period.max(Duration::from_nanos(1))),
            ..Self::constant()
        }
    }

    /// Creates a sensor whose values stay (stock: `constantValue`).
    pub fn constant() -> Self {
        Self {
            period: None,
            start: TimeSource::current().instant(),
            info: SensorInfo {
                name: "sensorName".to_owned(),
                frame: "frameName".to_owned(),
            },
        }
    }

    /// Sets the name of the sensors, and of the frame in which they measure.
    pub fn named(mut self, info: SensorInfo) -> Self {
        self.info = info;
        self
    }

    /// Returns the values of the channels that long after the start.
    pub fn values_after(&self, elapsed: Duration) -> [f64; CHANNELS] {
        let periods = match self.period {
            Some(period) => elapsed.as_nanos() / period.as_nanos(),
            None => 0,
        };
        let counts = (u128::from(FIRST_COUNT) + periods) % u128::from(COUNTS);
        let count = counts as f64;
        let pitch = count * HALF_TURN / 180.0;
        let mut values = [count; CHANNELS];
        values[3..6].copy_from_slice(&[GRAVITY * pitch.sin(), 0.0, -GRAVITY * pitch.cos()]);
        values
    }

    fn values(&self) -> [f64; CHANNELS] {
        let now = TimeSource::current().instant();
        self.values_after(now.saturating_duration_since(self.start))
    }
}

impl GenericSensor for FakeImu {
    fn generic_channels(&self) -> usize {
        CHANNELS
    }

    fn read_generic(&self, reading: &mut SensorReading) {
        reading.set(&self.values(), clock::now());
    }
}

impl AnalogSensors for FakeImu {
    fn sensors(&self, kind: SensorKind) -> Vec<SensorInfo> {
        match KINDS.contains(&kind) {
            true => vec![self.info.clone()],
            false => Vec::new(),
        }
    }

    fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>) {
        let place = KINDS.iter().position(|known| *known == kind);
        readings.resize_with(usize::from(place.is_some()), SensorReading::default);
        if let (Some(place), [reading]) = (place, readings.as_mut_slice()) {
            reading.set(&self.values()[3 * place..][..3], clock::now());
        }
    }
}

impl Device for FakeImu {
    crate::offers! {
        analog_sensors: AnalogSensors,
        generic_sensor: GenericSensor,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SensorStatus;

    #[test]
    fn the_count_starts_again_and_gravity_turns_with_it() {
        let imu = FakeImu::new(Duration::from_millis(10));
        let after = |periods: u32| imu.values_after(periods * Duration::from_millis(10));
        assert_eq!(after(349)[0], 359.0);
        assert_eq!(after(350)[0], 0.0);
        assert_eq!(after(350)[3..6], [0.0, 0.0, -9.81]);
        let [x, y, z] = after(80)[3..6] else {
            panic!("three of them")
        };
        assert!(
            (x - 9.81).abs() < 1e-3 && y == 0.0 && z.abs() < 0.02,
            "{x} {y} {z}"
        );
        let constant = FakeImu::constant();
        assert_eq!(constant.values_after(Duration::from_secs(9))[11], 10.0);
    }

    #[test]
    fn both_interfaces_show_the_same_values() {
        let imu = FakeImu::constant();
        let mut reading = SensorReading::default();
        imu.read_generic(&mut reading);
        assert_eq!(
            (reading.status, reading.values.len()),
            (SensorStatus::Ok, CHANNELS)
        );
        for (kind, channels) in KINDS.iter().zip(reading.values.chunks(3)) {
            let [sensor] = imu.sensors(*kind).try_into().unwrap();
            assert_eq!(sensor.name, "sensorName");
            assert_eq!(imu.read_sensor(*kind, 0).unwrap().values, channels);
        }
        assert!(imu.sensors(SensorKind::Temperature).is_empty());
        assert!(imu.read_sensor(SensorKind::Temperature, 0).is_err());
        assert!(imu.calibrate_generic(0, 0.0).is_err(), "as in stock");
    }
}
