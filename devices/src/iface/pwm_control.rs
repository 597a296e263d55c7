//! Duty cycles of the motors.

use crate::{Axes, AxisInfo, DeviceError};

/// Measured and commanded duty cycles, percent, -100 to 100 (stock: `IPWMControl`).
///
/// References need [`Mode::Pwm`](crate::Mode::Pwm).
pub trait PwmControl: AxisInfo {
    /// The duty cycles given out now (`getDutyCycle(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; behind a network also [`DeviceError::NoDataYet`] and
    /// [`DeviceError::Stale`].
    fn duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;

    /// Commands these duty cycles until the next command, and returns at once (`setRefDutyCycle(s)`).
    ///
    /// Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    /// the selection; then every motor continues as before. A device behind a network may not get a refusal.
    fn set_reference_duty_cycles(
        &self,
        axes: Axes<'_>,
        duty_cycles: &[f64],
    ) -> Result<(), DeviceError>;

    /// Returns the last commanded duty cycles; 0 after a change of mode (`getRefDutyCycle(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn reference_duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}
