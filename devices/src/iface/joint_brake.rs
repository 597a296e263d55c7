//! Brakes at the joints.

use crate::{AxisIndex, AxisInfo, DeviceError};

/// Brakes, by hand or by themselves (stock: `IJointBrake`, new in 4.0).
pub trait JointBrake: AxisInfo {
    /// Whether a joint is held by its brake (`isJointBraked`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn is_braked(&self, axis: AxisIndex) -> Result<bool, DeviceError>;

    /// Puts the brake of a joint on, or takes it off (`setManualBrakeActive`).
    ///
    /// A moving joint comes to rest. A joint whose brake was put on refuses to move until it is taken off.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn set_manual_brake(&self, axis: AxisIndex, active: bool) -> Result<(), DeviceError>;

    /// Whether the brake of a joint goes on by itself when the joint is idle (`getAutoBrakeEnabled`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn auto_brake(&self, axis: AxisIndex) -> Result<bool, DeviceError>;

    /// Sets whether the brake of a joint goes on by itself (`setAutoBrakeEnabled`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn set_auto_brake(&self, axis: AxisIndex, enabled: bool) -> Result<(), DeviceError>;
}
