//! Velocities given step by step.

use crate::{Axes, AxisInfo, DeviceError};

/// Velocities that the caller lays out itself (stock: `IVelocityDirect`, new in 4.0).
///
/// The joints must be in [`Mode::VelocityDirect`](crate::Mode::VelocityDirect). A joint takes each velocity as fast as
/// it can, without the ramp of [`VelocityControl`](crate::VelocityControl).
pub trait VelocityDirect: AxisInfo {
    /// Makes the joints move at `velocities`, deg/s or m/s, and returns at once (`setRefVelocity`).
    ///
    /// Errors: as [`VelocityControl::velocity_move`](crate::VelocityControl::velocity_move).
    fn set_direct_velocities(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError>;

    /// The velocities last sent, deg/s or m/s (`getRefVelocity`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn direct_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}
