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

/// Describes the requests about motor currents; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_current_control {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            current_control: CurrentControl, "iCurrentControl", "current control" {
                numbers {
                    /// Measured current.
                    Current: "" ["acu" "" "acus"] ["getCurrentOne" "" "getCurrentAll"]
                        => (by |control, axes| control.currents(axes));
                    /// The last commanded current.
                    ReferenceCurrent: "icur" ["ref" "" "refs"] ["getRefCurrentOne" "" "getRefCurrentAll"]
                        => (each reference_currents);
                }
                settings {
                    /// Feed the motor this current.
                    Current: "" ["" "" ""]
                        ["setRefCurrentOne" "setRefCurrentGroup" "setRefCurrentAll"]
                        => (each set_reference_currents "currents");
                }
                actions {}
                queries {
                    /// Smallest and largest current.
                    CurrentRange -> Vec<Limits>: "icur" ["rng" "" "rngs"] ["getCurrentRangeOne" "" "getCurrentRangeAll"]
                        => (each current_ranges);
                }
                commands {}
            }
        }
    };
}
