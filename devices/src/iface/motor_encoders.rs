//! Motor positions.

use crate::{Axes, AxisIndex, AxisInfo, DeviceError, EncoderReading};

/// The motor side of the joints (stock: `IMotorEncoders`). MotorSet are numbered as the axes.
pub trait MotorEncoders: AxisInfo {
    /// One reading per motor, in degrees of the motor's shaft or the device's own unit (`getMotorEncoder(s)Timed`,
    /// `getMotorEncoderSpeed(s)`, `getMotorEncoderAcceleration(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; behind a network also [`DeviceError::NoDataYet`] and
    /// [`DeviceError::Stale`].
    fn motor_readings(&self, axes: Axes<'_>) -> Result<Vec<EncoderReading>, DeviceError>;

    /// Declares that the motors are now at `positions`; nothing moves (`setMotorEncoder(s)`).
    ///
    /// Errors: [`DeviceError::NotFinite`], or an error of the selection; then none is set.
    fn set_motor_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError>;

    /// Declares that the motors are now at 0 (`resetMotorEncoder(s)`).
    ///
    /// Errors: as [`set_motor_encoders`](Self::set_motor_encoders).
    fn reset_motor_encoders(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(self.axes())?;
        self.set_motor_encoders(axes, &vec![0.0; axes.len(self.axes())])
    }

    /// Counts of the encoder per turn of the motor (`getMotorEncoderCountsPerRevolution`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn counts_per_revolution(&self, axis: AxisIndex) -> Result<f64, DeviceError>;

    /// Sets the counts of the encoder per turn of the motor (`setMotorEncoderCountsPerRevolution`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`].
    fn set_counts_per_revolution(&self, axis: AxisIndex, counts: f64) -> Result<(), DeviceError>;
}
