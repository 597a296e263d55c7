//! One sensor of several channels (`IAnalogSensor` of 3.x).

use crate::{DeviceError, SensorReading, SensorStatus};

/// A sensor whose channels are read together, as YARP 3.x knows it.
pub trait AnalogSensor: Send + Sync {
    /// Returns the number of channels.
    fn channels(&self) -> usize;

    /// Reads all channels into `reading`, whose buffer is reused.
    fn read_channels(&self, reading: &mut SensorReading);

    /// Returns the state of a channel; by default that of the sensor.
    fn channel_status(&self, channel: usize) -> SensorStatus {
        let _ = channel;
        let mut reading = SensorReading::default();
        self.read_channels(&mut reading);
        reading.status
    }

    /// Makes the present values zero, of one channel or of all (`calibrateSensor`, `calibrateChannel`).
    ///
    /// * Errors: [`DeviceError::NotSupported`] by default.
    fn calibrate(&self, channel: Option<usize>) -> Result<(), DeviceError> {
        let _ = channel;
        Err(DeviceError::NotSupported {
            what: "calibrating the sensor".to_owned(),
        })
    }
}
