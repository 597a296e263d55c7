//! Brakes at the joints.

use crate::{AxisIndex, AxisInfo, DeviceError};

/// Brakes, by hand or by themselves (stock: `IJointBrake`, new in 4.0).
pub trait JointBrake: AxisInfo {
    /// Returns whether a joint is held by its brake (`isJointBraked`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn is_braked(&self, axis: AxisIndex) -> Result<bool, DeviceError>;

    /// Puts the brake of a joint on, or takes it off (`setManualBrakeActive`).
    ///
    /// A moving joint comes to rest. A joint with the brake applied refuses to move until the brake is released.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn set_manual_brake(&self, axis: AxisIndex, active: bool) -> Result<(), DeviceError>;

    /// Returns whether the brake of a joint is applied automatically when the joint is idle (`getAutoBrakeEnabled`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn auto_brake(&self, axis: AxisIndex) -> Result<bool, DeviceError>;

    /// Sets whether the brake of a joint is applied automatically (`setAutoBrakeEnabled`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn set_auto_brake(&self, axis: AxisIndex, enabled: bool) -> Result<(), DeviceError>;
}

/// Describes the requests about brakes; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_joint_brake {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            joint_brake: JointBrake, "iJointBrake", "brakes" {
                numbers {}
                settings {}
                actions {}
                queries {
                    /// True if an axis is braked (4.0).
                    Braked -> bool: "" ["" "" ""] ["isJointBraked" "" ""] => (axis is_braked);
                    /// True if its brake is applied automatically (4.0).
                    AutoBrake -> bool: "" ["" "" ""] ["getAutoBrakeEnabled" "" ""] => (axis auto_brake);
                }
                commands {
                    /// The brake of an axis (4.0).
                    ManualBrake(axis: AxisIndex, active: bool): "" ["" "" ""] ["setManualBrakeActive" "" ""]
                        => (axis set_manual_brake);
                    /// Automatic braking (4.0).
                    AutoBrake(axis: AxisIndex, enabled: bool): "" ["" "" ""] ["setAutoBrakeEnabled" "" ""]
                        => (axis set_auto_brake);
                }
            }
        }
    };
}
