//! Number, names and kinds of the axes.

use crate::{AxisIndex, DeviceError};

/// Number, names and types of the axes of a device (stock: `IAxisInfo`, and `getAxes` of every other interface).
///
/// Every other interface extends this one, since none makes sense without the number of axes.
pub trait AxisInfo: Send + Sync {
    /// The number of axes (`getAxes`); it does not change while the device lives.
    fn axes(&self) -> usize;

    /// The name of an axis (`getAxisName`), distinct within the device.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError>;

    /// Returns whether an axis is revolute or prismatic (`getJointType`), which determines the units of its values.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError>;
}

/// Type of a joint: revolute or prismatic (stock: `JointTypeEnum`).
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq)]
#[non_exhaustive]
pub enum JointType {
    /// Turns: degrees, deg/s, deg/s².
    Revolute,
    /// Slides: metres, m/s, m/s².
    Prismatic,
    /// Not known; the units are the device's own.
    #[default]
    Unknown,
}

/// Describes the requests about number, names and kinds of the axes; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_axis_info {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            axis_info: AxisInfo, "iAxisInfo", "axis information" {
                numbers {}
                settings {}
                actions {}
                queries {
                    /// Number of axes.
                    Axes -> usize: "" ["" "" "axes"] ["" "" "getAxes"] => (by |info, _| Ok(info.axes()));
                    /// Name of an axis.
                    Name -> String: "" ["name" "" ""] ["getAxisName" "" ""] => (axis axis_name);
                    /// Kind of an axis.
                    Type -> JointType: "" ["type" "" ""] ["getJointType" "" ""] => (axis joint_type);
                }
                commands {}
            }
        }
    };
}
