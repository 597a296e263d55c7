//! What position and velocity control have in common.

use crate::{Axes, AxisInfo, DeviceError};

/// How hard moves accelerate, and how they are stopped.
///
/// Stock has these methods twice, in `IPositionControl` and in `IVelocityControl`, for one and the same
/// setting; here both [`PositionControl`](crate::PositionControl) and
/// [`VelocityControl`](crate::VelocityControl) extend this trait.
pub trait MotionControl: AxisInfo {
    /// Brings the joints to rest, in whatever mode they are (`stop`): with their reference acceleration, in the direct
    /// modes, which know none, as hard as they can.
    ///
    /// Returns at once; the joints slow down without a jump and then hold where they came to rest. In
    /// position mode that place becomes the target, in velocity mode the reference velocity becomes 0, and an idle
    /// joint stays as it is. Naming a joint twice does no harm: a stop is not refused over a detail.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; then none is stopped.
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError>;

    /// Sets how hard the joints speed up and slow down (`setRefAcceleration(s)`, in 4.0
    /// `setTrajAcceleration(s)`).
    ///
    /// * `accelerations`: deg/s² or m/s², above zero; they apply from the next command on. How hard an axis can accelerate
    ///   is told nowhere, so more than that is not refused but means as hard as it can, as with stock's boards:
    ///   `yarpmotorgui` asks for 100000. [`reference_accelerations`](Self::reference_accelerations) tells what is in force.
    /// * Errors: [`DeviceError::OutOfRange`] for too little, [`DeviceError::NotFinite`], or what is wrong with the
    ///   selection; then none is set.
    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError>;

    /// How hard the joints speed up and slow down, deg/s² or m/s² (`getRefAcceleration(s)`, in 4.0
    /// `getTrajAcceleration(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}
