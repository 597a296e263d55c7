//! Sensors of any kind, as rows of numbers.

use crate::{DeviceError, SensorReading};

/// A sensor with a row of channels, such as an inertial sensor of twelve (stock: `IGenericSensor`).
///
/// YARP 3.x serves it as the device `inertial`. [`AnalogSensor`](super::AnalogSensor) is its sibling with a state per channel.
pub trait GenericSensor: Send + Sync {
    /// Returns the number of channels (`getChannels`); does not change.
    fn generic_channels(&self) -> usize;

    /// Reads all channels into `reading`, whose buffer is reused (`read`).
    fn read_generic(&self, reading: &mut SensorReading);

    /// Makes a channel read `value` from now on, as long as the sensor measures what it measures now (`calibrate`).
    ///
    /// * Errors: [`DeviceError::NotSupported`] by default; [`DeviceError::Unsuitable`] for a channel that it does not have, or a value that is
    ///   not finite.
    fn calibrate_generic(&self, channel: usize, value: f64) -> Result<(), DeviceError> {
        let _ = (channel, value);
        Err(DeviceError::NotSupported {
            what: "calibrating a channel of the sensor".to_owned(),
        })
    }
}
