//! Moves from the present position of a joint to a target.

use crate::{Axes, DeviceError, MotionControl};

/// Point-to-point moves along a path the device makes (stock: `IPositionControl`).
///
/// The joints must be in [`Mode::Position`](crate::Mode::Position). A move keeps within the reference speed
/// and acceleration of its joint. A new target takes the place of the old one at any time, also during a move,
/// without a jump in velocity. Acceleration and `stop` are in [`MotionControl`].
pub trait PositionControl: MotionControl {
    /// Starts moving the joints to `targets` and returns at once (`positionMove`).
    ///
    /// * `targets`: degrees or metres, inside [`ControlLimits::position_limits`](crate::ControlLimits::position_limits).
    /// * Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    ///   the selection; then no joint moves.
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError>;

    /// Starts moving the joints by `distances` from where they are now, and returns at once (`relativeMove`).
    ///
    /// Now is the present position, not the last target. Errors as for [`position_move`](Self::position_move),
    /// judged by the place to arrive at.
    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError>;

    /// Returns whether all these joints are at rest, their moves and stops ended (`checkMotionDone`).
    ///
    /// True for an empty selection. A joint in velocity mode is done when it is at rest, also at a limit.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError>;

    /// Returns the last targets of the joints, degrees or metres (`getTargetPosition(s)`).
    ///
    /// After a stop or a change to position mode, the position at which the joint comes to rest.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;

    /// Sets how fast moves may become (`setRefSpeed(s)`, in 4.0 `setTrajSpeed(s)`).
    ///
    /// * `speeds`: deg/s or m/s, above zero, up to the velocity limit; they apply from the next move on.
    /// * Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], or an error of the selection; then none is
    ///   set.
    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Result<(), DeviceError>;

    /// Returns the speeds of point-to-point moves, deg/s or m/s (`getRefSpeed(s)`, in 4.0 `getTrajSpeed(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}

/// Describes the requests about point-to-point moves; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_position_control {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            position_control: PositionControl, "iPositionControl", "position control" {
                numbers {
                    /// The last target of the joint.
                    TargetPosition: "" ["pos" "posg" "poss"]
                        ["getTargetPositionOne" "getTargetPositionGroup" "getTargetPositionAll"]
                        => (each target_positions);
                    /// Speed of point-to-point moves.
                    ReferenceSpeed: "" ["vel" "velg" "vels"]
                        ["getTrajSpeedOne" "getTrajSpeedsGroup" "getTrajSpeedsAll"]
                        => (each reference_speeds);
                }
                settings {
                    /// Go there.
                    Position: "" ["pos" "posg" "poss"]
                        ["positionMoveOne" "positionMoveGroup" "positionMoveAll"]
                        => (each position_move "target positions");
                    /// Go so far.
                    Distance: "" ["rel" "relg" "rels"]
                        ["relativeMoveOne" "relativeMoveGroup" "relativeMoveAll"]
                        => (each relative_move "distances");
                    /// Speed of point-to-point moves.
                    ReferenceSpeed: "" ["vel" "velg" "vels"]
                        ["setTrajSpeedOne" "setTrajSpeedGroup" "setTrajSpeedAll"]
                        => (each set_reference_speeds "reference speeds");
                }
                actions {}
                queries {
                    /// True if the joints are at rest.
                    MotionDone -> bool: "" ["don" "dong" "dons"]
                        ["checkMotionDoneOne" "checkMotionDoneGroup" "checkMotionDoneAll"]
                        => (axes motion_done);
                }
                commands {}
            }
        }
    };
}
