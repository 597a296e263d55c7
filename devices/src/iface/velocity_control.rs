//! Moves at a given velocity.

use crate::{Axes, DeviceError, MotionControl};

/// Moves at a velocity until the next command (stock: `IVelocityControl`).
///
/// The joints must be in [`Mode::Velocity`](crate::Mode::Velocity). Velocity changes with the reference acceleration,
/// and a joint slows down in time to come to rest at its position limit. A velocity stays in force until the next
/// command: **nothing times out here**. Programs that drive a robot over a network should put a watchdog in between.
/// Acceleration and `stop` are in [`MotionControl`].
pub trait VelocityControl: MotionControl {
    /// Makes the joints move at `velocities` and returns at once (`velocityMove`).
    ///
    /// * `velocities`: deg/s or m/s, signed, of magnitude up to
    ///   [`ControlLimits::velocity_limits`](crate::ControlLimits::velocity_limits). More is refused, not clipped, so
    ///   that joints never move in an unintended direction. A velocity into a limit already reached is accepted and
    ///   does nothing.
    /// * Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    ///   the selection; then every joint continues as before. A device behind a network may send velocities without
    ///   waiting for a reply, and then cannot report a refusal.
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError>;

    /// Returns the last commanded velocities, deg/s or m/s; 0 after a stop or a change of mode (`getRefVelocity`,
    /// `getRefVelocities`, in 4.0 `getTargetVelocity`, `getTargetVelocities`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}

/// Describes the requests about moves at a given velocity; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_velocity_control {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            velocity_control: VelocityControl, "iVelocityControl", "velocity control" {
                numbers {
                    /// The last commanded velocity.
                    ReferenceVelocity: "" ["vmo" "vmog" "vmos"]
                        ["getTargetVelocityOne" "getTargetVelocityGroup" "getTargetVelocityAll"]
                        => (each reference_velocities);
                }
                settings {
                    /// Move at this velocity. Stock 3.x answers `[fail]` to the forms for one and for several joints.
                    Velocity: "" ["" "" "vmos"]
                        ["velocityMoveOne" "velocityMoveGroup" "velocityMoveAll"]
                        => (each velocity_move "velocities");
                }
                actions {}
                queries {}
                commands {}
            }
        }
    };
}
