//! Common part of position and velocity control.

use crate::{Axes, AxisInfo, DeviceError};

/// Accelerations of moves, and stopping them.
///
/// Stock has these methods twice, in `IPositionControl` and in `IVelocityControl`, for one and the same
/// setting; here both [`PositionControl`](crate::PositionControl) and
/// [`VelocityControl`](crate::VelocityControl) extend this trait.
pub trait MotionControl: AxisInfo {
    /// Stops the joints in any mode (`stop`): with their reference acceleration, in the direct modes, which have
    /// none, as hard as they can.
    ///
    /// Returns at once; the joints slow down without a jump and then hold their positions. In position mode the final
    /// position becomes the target, in velocity mode the reference velocity becomes 0, and an idle joint is not
    /// affected. Naming a joint twice does no harm: a stop is not refused over a detail.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; then none is stopped.
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError>;

    /// Sets how hard the joints speed up and slow down (`setRefAcceleration(s)`, in 4.0
    /// `setTrajAcceleration(s)`).
    ///
    /// * `accelerations`: deg/s² or m/s², above zero; they apply from the next command on. No interface returns the
    ///   maximum acceleration of an axis, so more than that is not refused but means the maximum, as with stock's
    ///   boards: `yarpmotorgui` sends 100000. [`reference_accelerations`](Self::reference_accelerations) returns the
    ///   value in force.
    /// * Errors: [`DeviceError::OutOfRange`] for values that are too small, [`DeviceError::NotFinite`], or an error
    ///   of the selection; then none is set.
    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError>;

    /// Returns the accelerations of the joints, deg/s² or m/s² (`getRefAcceleration(s)`, in 4.0
    /// `getTrajAcceleration(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}

/// Describes the requests about stops and accelerations; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_motion_control {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            motion_control: MotionControl, "", "velocity control" {
                numbers {
                    /// Acceleration of the joint.
                    ReferenceAcceleration: "" ["acc" "accg" "accs"]
                        ["getTrajAccelerationOne" "getTrajAccelerationGroup" "getTrajAccelerationAll"]
                        => (each reference_accelerations);
                }
                settings {
                    /// Acceleration of the joint.
                    ReferenceAcceleration: "" ["acc" "accg" "accs"]
                        ["setTrajAccelerationOne" "setTrajAccelerationsGroup" "setTrajAccelerationsAll"]
                        => (each set_reference_accelerations "reference accelerations");
                }
                actions {
                    /// Come to rest.
                    Stop: "" ["sto" "stog" "stos"] ["stopOne" "stopGroup" "stopAll"] => (axes stop "stop");
                }
                queries {}
                commands {}
            }
        }
    };
}
