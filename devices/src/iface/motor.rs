//! The motors themselves.

use crate::{Axes, AxisIndex, AxisInfo, DeviceError};

/// Temperatures and gears of the motors (stock: `IMotor`). MotorSet are numbered as the axes.
pub trait Motor: AxisInfo {
    /// Temperatures, °C (`getTemperature(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn temperatures(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;

    /// Returns the maximum temperature of a motor, °C (`getTemperatureLimit`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn temperature_limit(&self, axis: AxisIndex) -> Result<f64, DeviceError>;

    /// Sets how hot a motor may become, °C (`setTemperatureLimit`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`].
    fn set_temperature_limit(&self, axis: AxisIndex, limit: f64) -> Result<(), DeviceError>;

    /// Turns of the motor per turn of the joint (`getGearboxRatio`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn gearbox_ratio(&self, axis: AxisIndex) -> Result<f64, DeviceError>;

    /// Sets the turns of the motor per turn of the joint (`setGearboxRatio`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`], [`DeviceError::OutOfRange`].
    fn set_gearbox_ratio(&self, axis: AxisIndex, ratio: f64) -> Result<(), DeviceError>;
}
