//! Positions given step by step.

use crate::{Axes, AxisInfo, DeviceError};

/// Positions that the caller lays out itself, one small step after the other (stock: `IPositionDirect`).
///
/// The joints must be in [`Mode::PositionDirect`](crate::Mode::PositionDirect). A joint moves to each position as
/// fast as it can, so a distant one makes it jump: the caller has to plan the path.
pub trait PositionDirect: AxisInfo {
    /// Sends the joints to `positions`, degrees or metres, and returns at once (`setPosition(s)`).
    ///
    /// Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    /// the selection; then no joint moves. A device behind a network may not get a refusal.
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError>;

    /// The positions last sent, degrees or metres (`getRefPosition(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn direct_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}

/// Describes the requests about streamed positions; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_position_direct {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            position_direct: PositionDirect, "iPositionDirect", "direct positions" {
                numbers {
                    /// The position last sent step by step.
                    DirectPosition: "" ["dpo" "dpog" "dpos"]
                        ["getRefPositionOne" "getRefPositionGroup" "getRefPositionAll"]
                        => (each direct_positions);
                }
                settings {
                    /// Be there now.
                    DirectPosition: "" ["" "" ""]
                        ["setRefPositionOne" "setRefPositionGroup" "setRefPositionAll"]
                        => (each set_direct_positions "positions");
                }
                actions {}
                queries {}
                commands {}
            }
        }
    };
}
