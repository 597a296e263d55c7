//! Duty cycles of the motors.

use crate::{Axes, AxisInfo, DeviceError};

/// Duty cycles given out and asked for, percent, -100 to 100 (stock: `IPWMControl`).
///
/// References need [`Mode::Pwm`](crate::Mode::Pwm).
pub trait PwmControl: AxisInfo {
    /// The duty cycles given out now (`getDutyCycle(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; behind a network also [`DeviceError::NoDataYet`] and
    /// [`DeviceError::Stale`].
    fn duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;

    /// Gives the motors these duty cycles until told otherwise, and returns at once (`setRefDutyCycle(s)`).
    ///
    /// Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or what is wrong
    /// with the selection; then every motor goes on as before. A device behind a network may not hear of a refusal.
    fn set_reference_duty_cycles(
        &self,
        axes: Axes<'_>,
        duty_cycles: &[f64],
    ) -> Result<(), DeviceError>;

    /// The duty cycles last asked for; 0 after a change of mode (`getRefDutyCycle(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn reference_duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}
