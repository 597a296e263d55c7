//! Interfaces of a device, queried at run time.

use crate::MotionControl;

/// In an `impl Device`: the interfaces that the type itself implements.
///
/// ```
/// # use yarp_devices::{AxisIndex, AxisInfo, Device, DeviceError, JointType, offers};
/// # struct Ruler;
/// # impl AxisInfo for Ruler {
/// #     fn axes(&self) -> usize { 1 }
/// #     fn axis_name(&self, _: AxisIndex) -> Result<String, DeviceError> { Ok("slide".into()) }
/// #     fn joint_type(&self, _: AxisIndex) -> Result<JointType, DeviceError> { Ok(JointType::Prismatic) }
/// # }
/// impl Device for Ruler {
///     offers! { axis_info: AxisInfo }
/// }
/// assert!(Ruler.axis_info().is_some());
/// ```
#[macro_export]
macro_rules! offers {
    ($($method:ident: $interface:ident),* $(,)?) => {
        $(fn $method(&self) -> Option<&dyn $crate::$interface> {
            Some(self)
        })*
    };
}

/// Defines [`Device`] by the list of interfaces.
macro_rules! device {
    ($($(#[$about:meta])* $method:ident: $interface:ident;)*) => {
        /// A device, seen as the set of interfaces it has.
        ///
        /// This is what `view()` of the stock `PolyDriver` is: one query per interface, answered with the interface or with
        /// `None`. A network wrapper takes an `Arc<dyn Device>`, serves its interfaces and refuses the others. A device is
        /// released by dropping it.
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
            $(
                $(#[$about])*
                fn $method(&self) -> Option<&dyn crate::$interface> {
                    None
                }
            )*

            /// Returns the common part of position and velocity control, from whichever exists.
            fn motion_control(&self) -> Option<&dyn MotionControl> {
                match self.position_control() {
                    Some(position) => Some(position),
                    None => Some(self.velocity_control()?),
                }
            }
        }
    };
}

crate::device_interfaces!(device);
