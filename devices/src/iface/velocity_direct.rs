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

/// Describes the requests about streamed velocities; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_velocity_direct {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            velocity_direct: VelocityDirect, "iVelocityDirect", "direct velocities" {
                numbers {
                    /// The velocity last sent step by step.
                    DirectVelocity: "" ["" "" ""]
                        ["getRefVelocityOne" "getRefVelocityGroup" "getRefVelocityAll"]
                        => (each direct_velocities);
                }
                settings {
                    /// Have this velocity now.
                    DirectVelocity: "" ["" "" ""]
                        ["setRefVelocityOne" "setRefVelocityGroup" "setRefVelocityAll"]
                        => (each set_direct_velocities "velocities");
                }
                actions {}
                queries {}
                commands {}
            }
        }
    };
}
