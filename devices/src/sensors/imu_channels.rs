//! An inertial sensor as twelve channels.

use std::sync::Arc;

use crate::imu_layout::{CHANNELS, KINDS};
use crate::{
    AnalogSensor, AnalogSensors, Device, DeviceError, GenericSensor, SensorReading, SensorStatus,
};

/// The inertial sensors of a device as the twelve channels of YARP 3.x (`IGenericSensor`): orientation (roll, pitch, yaw
/// in degrees), acceleration (m/s²), angular velocity (deg/s), magnetic field (tesla).
///
/// Channels of a kind that the device lacks are 0.
pub struct ImuChannels {
    device: Arc<dyn Device>,
    places: [Option<usize>; KINDS.len()],
}

impl std::fmt::Debug for ImuChannels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ImuChannels")
            .field("places", &self.places)
            .finish_non_exhaustive()
    }
}

impl ImuChannels {
    /// Selects the sensors named `name`, or the first of each kind.
    ///
    /// * Errors: [`DeviceError::NotSupported`] for a device without inertial sensors, [`DeviceError::Unsuitable`] for a
    ///   name that none has.
    pub fn new(device: Arc<dyn Device>, name: Option<&str>) -> Result<Self, DeviceError> {
        let missing = || DeviceError::NotSupported {
            what: "inertial sensors".to_owned(),
        };
        let sensors = device.analog_sensors().ok_or_else(missing)?;
        let infos = KINDS.map(|kind| sensors.sensors(kind));
        if infos.iter().all(Vec::is_empty) {
            return Err(missing());
        }
        let places = infos.map(|infos| match name {
            None => (!infos.is_empty()).then_some(0),
            Some(name) => infos.iter().position(|info| info.name == name),
        });
        if places.iter().all(Option::is_none) {
            return Err(DeviceError::Unsuitable {
                what: "sensor",
                asked: name.unwrap_or_default().to_owned(),
                expected: "the name of one that there is".to_owned(),
            });
        }
        Ok(Self { device, places })
    }

    fn read(&self, sensors: &dyn AnalogSensors, reading: &mut SensorReading) {
        reading.set(&[0.0; CHANNELS], 0.0);
        for ((kind, place), channels) in KINDS.iter().zip(self.places).zip(0..) {
            let Some(place) = place else { continue };
            let into = &mut reading.values[3 * channels..][..3];
            match sensors.read_sensor(*kind, place) {
                Ok(read) if read.status == SensorStatus::Ok && read.values.len() == 3 => {
                    into.copy_from_slice(&read.values);
                    reading.time = reading.time.max(read.time);
                }
                Ok(read) if read.status != SensorStatus::Ok => return reading.fail(read.status),
                _ => return reading.fail(SensorStatus::Error),
            }
        }
    }
}

impl AnalogSensor for ImuChannels {
    fn channels(&self) -> usize {
        CHANNELS
    }

    fn read_channels(&self, reading: &mut SensorReading) {
        match self.device.analog_sensors() {
            Some(sensors) => self.read(sensors, reading),
            None => reading.fail(SensorStatus::Error),
        }
    }
}

impl GenericSensor for ImuChannels {
    fn generic_channels(&self) -> usize {
        CHANNELS
    }

    fn read_generic(&self, reading: &mut SensorReading) {
        self.read_channels(reading);
    }
}

impl Device for ImuChannels {
    crate::offers! {
        analog_sensor: AnalogSensor,
        generic_sensor: GenericSensor,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SensorKind;
    use crate::fake::ConstantSensors;

    #[test]
    fn sensors_have_their_channels_and_missing_ones_are_zero() {
        let sensors = ConstantSensors::new(1)
            .sensors_of(SensorKind::LinearAccelerometer, ["a", "b"])
            .sensors_of(SensorKind::Gyroscope, ["a"]);
        let sensors: Arc<dyn Device> = Arc::new(sensors);
        let mut reading = SensorReading::default();
        for name in [None, Some("b")] {
            let channels = ImuChannels::new(sensors.clone(), name).unwrap();
            channels.read_channels(&mut reading);
            assert_eq!(reading.status, SensorStatus::Ok);
            assert!(reading.time > 0.0);
            let mut expected = [0.0; CHANNELS];
            expected[5] = 9.80665;
            assert_eq!(reading.values, expected);
            reading = SensorReading::default();
            channels.read_generic(&mut reading);
            assert_eq!(reading.values, expected);
            assert_eq!(channels.generic_channels(), reading.values.len());
        }
        assert!(ImuChannels::new(sensors, Some("c")).is_err());
        assert!(ImuChannels::new(Arc::new(ConstantSensors::new(6)), None).is_err());
    }

    /// Sensors that wait for their first values.
    struct Waiting;

    impl AnalogSensors for Waiting {
        fn sensors(&self, kind: SensorKind) -> Vec<crate::SensorInfo> {
            match kind {
                SensorKind::Gyroscope => vec![crate::SensorInfo::default()],
                _ => Vec::new(),
            }
        }
        fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>) {
            readings.clear();
            readings.resize(self.sensors(kind).len(), SensorReading::default());
        }
    }

    impl Device for Waiting {
        crate::offers! { analog_sensors: AnalogSensors }
    }

    #[test]
    fn a_sensor_without_values_is_not_read_as_zero() {
        let channels = ImuChannels::new(Arc::new(Waiting), None).unwrap();
        let mut reading = SensorReading::default();
        channels.read_channels(&mut reading);
        assert_eq!(reading.status, SensorStatus::WaitingForFirstRead);
    }
}
