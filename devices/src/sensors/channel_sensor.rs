//! One sensor of a device, as channels.

use std::sync::{Arc, Mutex, PoisonError};

use crate::{AnalogSensor, Device, DeviceError, SensorKind, SensorReading, SensorStatus};

/// One sensor of a device with sensors of several kinds, as YARP 3.x served it (`IAnalogSensor`).
///
/// Calibration subtracts the values at that time from then on.
pub struct ChannelSensor {
    device: Arc<dyn Device>,
    kind: SensorKind,
    index: usize,
    channels: usize,
    offsets: Mutex<Vec<f64>>,
}

impl std::fmt::Debug for ChannelSensor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ChannelSensor")
            .field("kind", &self.kind)
            .field("index", &self.index)
            .finish_non_exhaustive()
    }
}

impl ChannelSensor {
    /// Selects a sensor; without a name the first of its kind.
    ///
    /// * Errors: [`DeviceError::NotSupported`] for a device without such sensors, [`DeviceError::Unsuitable`] for a
    ///   name that it does not have.
    pub fn new(
        device: Arc<dyn Device>,
        kind: SensorKind,
        name: Option<&str>,
    ) -> Result<Self, DeviceError> {
        let missing = || DeviceError::NotSupported {
            what: kind.stock_name().to_owned(),
        };
        let sensors = device.analog_sensors().ok_or_else(missing)?;
        let infos = sensors.sensors(kind);
        let first = infos.first().ok_or_else(missing)?;
        let name = name.unwrap_or(&first.name);
        let index = infos.iter().position(|info| info.name == name);
        let index = index.ok_or_else(|| DeviceError::Unsuitable {
            what: "sensor",
            asked: name.to_owned(),
            expected: "the name of one that there is".to_owned(),
        })?;
        let channels = match kind.size() {
            Some(size) => size,
            None => sensors.read_sensor(kind, index)?.values.len(),
        };
        Ok(Self {
            device,
            kind,
            index,
            channels,
            offsets: Mutex::new(vec![0.0; channels]),
        })
    }

    fn read_raw(&self) -> SensorReading {
        let sensors = self.device.analog_sensors();
        let read = sensors.and_then(|sensors| sensors.read_sensor(self.kind, self.index).ok());
        read.unwrap_or_else(|| SensorReading {
            values: vec![f64::NAN; self.channels],
            time: 0.0,
            status: SensorStatus::Error,
        })
    }
}

impl AnalogSensor for ChannelSensor {
    fn channels(&self) -> usize {
        self.channels
    }

    fn read_channels(&self, reading: &mut SensorReading) {
        *reading = self.read_raw();
        let offsets = self.offsets.lock().unwrap_or_else(PoisonError::into_inner);
        for (value, offset) in reading.values.iter_mut().zip(offsets.iter()) {
            *value -= offset;
        }
    }

    fn calibrate(&self, channel: Option<usize>) -> Result<(), DeviceError> {
        let reading = self.read_raw();
        if reading.status != SensorStatus::Ok {
            return Err(DeviceError::NoDataYet {
                what: "sensor values",
            });
        }
        let mut offsets = self.offsets.lock().unwrap_or_else(PoisonError::into_inner);
        match channel {
            None => offsets.clone_from(&reading.values),
            Some(channel) if channel < self.channels => offsets[channel] = reading.values[channel],
            Some(channel) => {
                return Err(DeviceError::Unsuitable {
                    what: "channel",
                    asked: channel.to_string(),
                    expected: format!("one of {}, counted from 0", self.channels),
                });
            }
        }
        Ok(())
    }
}

impl Device for ChannelSensor {
    crate::offers! { analog_sensor: AnalogSensor }
}
