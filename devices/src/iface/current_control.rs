//! Currents of the motors.

use crate::{Axes, AxisInfo, DeviceError, Limits};

/// Measured and commanded currents, A (stock: `ICurrentControl`).
///
/// References need [`Mode::Current`](crate::Mode::Current).
pub trait CurrentControl: AxisInfo {
    /// The currents measured now (`getCurrent(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; behind a network also [`DeviceError::NoDataYet`] and
    /// [`DeviceError::Stale`].
    fn currents(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;

    /// The smallest and largest current of each motor (`getCurrentRange(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn current_ranges(&self, axes: Axes<'_>) -> Result<Vec<Limits>, DeviceError>;

    /// Commands these currents until the next command, and returns at once (`setRefCurrent(s)`).
    ///
    /// Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    /// the selection; then every motor continues as before. A device behind a network may not get a refusal.
    fn set_reference_currents(&self, axes: Axes<'_>, currents: &[f64]) -> Result<(), DeviceError>;

    /// Returns the last commanded currents; 0 after a change of mode (`getRefCurrent(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn reference_currents(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}
