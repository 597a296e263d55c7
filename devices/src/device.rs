//! What a device can do, asked at run time.

use crate::{AxisInfo, ControlLimits, ControlMode, Encoders, PositionControl, VelocityControl};

/// A device, seen as the set of interfaces it has.
///
/// This is what `view()` of the stock `PolyDriver` is: one question per interface, answered with the
/// interface or with `None`. A network wrapper takes an `Arc<dyn Device>`, offers what is there and
/// refuses the rest. A device is released by dropping it.
///
/// ```
/// use yarp_devices::{AxisInfo, Device, DeviceError, AxisIndex, JointType};
///
/// struct Ruler;
///
/// impl AxisInfo for Ruler {
///     fn axes(&self) -> usize { 1 }
///     fn axis_name(&self, _: AxisIndex) -> Result<String, DeviceError> { Ok("slide".into()) }
///     fn joint_type(&self, _: AxisIndex) -> Result<JointType, DeviceError> { Ok(JointType::Prismatic) }
/// }
///
/// impl Device for Ruler {
///     fn axis_info(&self) -> Option<&dyn AxisInfo> { Some(self) }
/// }
///
/// assert_eq!(Ruler.axis_info().map(|info| info.axes()), Some(1));
/// assert!(Ruler.position_control().is_none());
/// ```
pub trait Device: Send + Sync {
    /// Number, names and kinds of the axes (`IAxisInfo`).
    fn axis_info(&self) -> Option<&dyn AxisInfo> {
        None
    }

    /// Point-to-point moves (`IPositionControl`).
    fn position_control(&self) -> Option<&dyn PositionControl> {
        None
    }

    /// Moves at a given velocity (`IVelocityControl`).
    fn velocity_control(&self) -> Option<&dyn VelocityControl> {
        None
    }

    /// Where the joints are (`IEncodersTimed`).
    fn encoders(&self) -> Option<&dyn Encoders> {
        None
    }

    /// What each joint takes orders for (`IControlMode`).
    fn control_mode(&self) -> Option<&dyn ControlMode> {
        None
    }

    /// How far and how fast each joint may go (`IControlLimits`).
    fn control_limits(&self) -> Option<&dyn ControlLimits> {
        None
    }
}
