//! Measurements that another program makes for a device (`IVirtualAnalogSensor`).

use crate::DeviceError;

/// A board that takes the torques of its joints from outside, as one without torque sensors does.
pub trait VirtualSensor: Send + Sync {
    /// Returns the number of channels, one for each joint.
    fn virtual_channels(&self) -> usize;

    /// Sets the torques that are measured from now on, Nm or N, of the first channels.
    ///
    /// * Errors: [`DeviceError::WrongCount`] for more values than channels, [`DeviceError::NotFinite`]; then nothing
    ///   changes.
    fn set_virtual_measures(&self, values: &[f64]) -> Result<(), DeviceError>;
}
