//! Sensors with constant values.

use std::sync::{Arc, Mutex, PoisonError};

use crate::clock;
use crate::{
    AnalogSensor, AnalogSensors, Device, DeviceError, GenericSensor, SensorInfo, SensorKind,
    SensorReading, VirtualSensor,
};

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.80665;
/// Temperature, °C.
const TEMPERATURE: f64 = 25.0;

/// Sensors of any names, as on a robot at rest: accelerometers measure gravity along z, temperatures are 25 °C, all other
/// values are 0.
///
/// They take the place of boards of sensors that are not there. As one sensor of several channels
/// ([`AnalogSensor`], [`GenericSensor`]) all channels are 0, or what they are set to: as torques that are measured outside
/// ([`VirtualSensor`]), or by calibrating them to a value.
///
/// ```
/// use yarp_devices::fake::ConstantSensors;
/// use yarp_devices::{AnalogSensors, SensorKind};
///
/// let sensors = ConstantSensors::new(24).sensors_of(SensorKind::LinearAccelerometer, ["foot_acc"]);
/// let reading = sensors.read_sensor(SensorKind::LinearAccelerometer, 0).unwrap();
/// assert!(reading.values[2] > 9.8);
/// ```
#[derive(Clone, Debug)]
pub struct ConstantSensors {
    /// Values of the channels; clones share them.
    channels: Arc<Mutex<Vec<f64>>>,
    /// Number of values of arrays and skin patches.
    length: usize,
    names: [Vec<String>; SensorKind::ALL.len()],
}

impl ConstantSensors {
    /// Creates `channels` channels and no other sensors; arrays and skin patches have this length too.
    pub fn new(channels: usize) -> Self {
        Self {
            channels: Arc::new(Mutex::new(vec![0.0; channels])),
            length: channels,
            names: Default::default(),
        }
    }

    fn no_channel(&self, channel: usize) -> DeviceError {
        DeviceError::Unsuitable {
            what: "channel",
            asked: channel.to_string(),
            expected: format!("one of {}, counted from 0", self.length),
        }
    }

    /// Adds sensors of a kind; names that are there already are passed over.
    pub fn sensors_of<S: Into<String>>(
        mut self,
        kind: SensorKind,
        names: impl IntoIterator<Item = S>,
    ) -> Self {
        let known = &mut self.names[kind.index()];
        for name in names {
            let name = name.into();
            if !known.contains(&name) {
                known.push(name);
            }
        }
        self
    }
}

impl AnalogSensors for ConstantSensors {
    fn sensors(&self, kind: SensorKind) -> Vec<SensorInfo> {
        let names = self.names[kind.index()].iter();
        names
            .map(|name| SensorInfo {
                name: name.clone(),
                frame: match kind.size() {
                    Some(_) => name.clone(),
                    None => String::new(),
                },
            })
            .collect()
    }

    fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>) {
        let mut values = vec![0.0; kind.size().unwrap_or(self.length)];
        match kind {
            SensorKind::LinearAccelerometer => values[2] = GRAVITY,
            SensorKind::Temperature => values[0] = TEMPERATURE,
            _ => {}
        }
        let now = clock::now();
        readings.resize_with(self.names[kind.index()].len(), SensorReading::default);
        for reading in readings {
            reading.set(&values, now);
        }
    }
}

impl AnalogSensor for ConstantSensors {
    fn channels(&self) -> usize {
        self.length
    }

    fn read_channels(&self, reading: &mut SensorReading) {
        let values = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        reading.set(&values, clock::now());
    }

    /// Succeeds, without an effect.
    fn calibrate(&self, channel: Option<usize>) -> Result<(), DeviceError> {
        match channel {
            Some(channel) if channel >= self.length => Err(self.no_channel(channel)),
            _ => Ok(()),
        }
    }
}

impl GenericSensor for ConstantSensors {
    fn generic_channels(&self) -> usize {
        self.length
    }

    fn read_generic(&self, reading: &mut SensorReading) {
        self.read_channels(reading);
    }

    fn calibrate_generic(&self, channel: usize, value: f64) -> Result<(), DeviceError> {
        if !value.is_finite() {
            return Err(DeviceError::Unsuitable {
                what: "value of a channel",
                asked: value.to_string(),
                expected: "a finite number".to_owned(),
            });
        }
        let mut channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        let channel = channels
            .get_mut(channel)
            .ok_or_else(|| self.no_channel(channel))?;
        *channel = value;
        Ok(())
    }
}

impl VirtualSensor for ConstantSensors {
    fn virtual_channels(&self) -> usize {
        self.length
    }

    fn set_virtual_measures(&self, values: &[f64]) -> Result<(), DeviceError> {
        let mut channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(first) = channels.get_mut(..values.len()) else {
            return Err(DeviceError::WrongCount {
                what: "measured torques",
                expected: self.length,
                got: values.len(),
            });
        };
        if let Some(joint) = values.iter().position(|value| !value.is_finite()) {
            return Err(DeviceError::NotFinite {
                joint: joint.into(),
                quantity: "measured torque",
                asked: values[joint],
            });
        }
        first.copy_from_slice(values);
        Ok(())
    }
}

impl Device for ConstantSensors {
    crate::offers! {
        analog_sensors: AnalogSensors,
        analog_sensor: AnalogSensor,
        generic_sensor: GenericSensor,
        virtual_sensor: VirtualSensor,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibrated_channel_reads_its_value() {
        let sensors = ConstantSensors::new(2);
        sensors.calibrate_generic(1, 2.5).unwrap();
        assert!(sensors.calibrate_generic(2, 1.0).is_err());
        assert!(sensors.calibrate_generic(0, f64::NAN).is_err());
        let mut reading = SensorReading::default();
        sensors.read_generic(&mut reading);
        assert_eq!(reading.values, [0.0, 2.5]);
        assert_eq!(sensors.generic_channels(), 2);
    }
}
