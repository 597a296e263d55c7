//! Faults of joints.

use crate::{AxisIndex, AxisInfo, DeviceError};

/// The last fault of each joint (stock: `IJointFault`, 3.6 and later).
pub trait JointFault: AxisInfo {
    /// The last fault of a joint (`getLastJointFault`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn last_fault(&self, axis: AxisIndex) -> Result<Fault, DeviceError>;
}

/// A fault in the device's own code; 0 is none.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Fault {
    /// The code.
    pub code: i32,
    /// Its meaning.
    pub message: String,
}

/// Describes the requests about faults of the joints; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_joint_fault {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            joint_fault: JointFault, "iJointFault", "joint faults" {
                numbers {}
                settings {}
                actions {}
                queries {
                    /// The last fault of an axis.
                    Fault -> Fault: "ijfl" ["jhfl" "" ""] ["getLastJointFault" "" ""] => (axis last_fault);
                }
                commands {}
            }
        }
    };
}
