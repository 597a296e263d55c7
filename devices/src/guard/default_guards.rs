//! The guards that programs put in front of an arm unless told otherwise.

use std::time::Duration;

use super::{GuardedOptions, JointLimits, RateLimits, TorqueLimits};
use crate::{Axes, AxisIndex, Device, DeviceError, Limits};

/// Maximum time for which a joint continues with a velocity without a new command.
pub const DEFAULT_VELOCITY_TIMEOUT: Duration = Duration::from_secs(1);
/// Maximum time for which a joint continues with a torque, a current or a duty cycle without a new command.
pub const DEFAULT_EFFORT_TIMEOUT: Duration = Duration::from_millis(200);

impl GuardedOptions {
    /// Returns guards at the limits that the device itself has now, so that no client can widen them, with
    /// [`DEFAULT_VELOCITY_TIMEOUT`] and [`DEFAULT_EFFORT_TIMEOUT`]. Quantities that the device has no limits of stay
    /// unlimited.
    ///
    /// Errors: those of the device, other than [`DeviceError::NotSupported`].
    pub fn of_device(device: &dyn Device) -> Result<Self, DeviceError> {
        let axes = device.axis_info().map_or(0, |info| info.axes());
        let mut options = Self {
            watchdog: Some(DEFAULT_VELOCITY_TIMEOUT),
            effort_watchdog: Some(DEFAULT_EFFORT_TIMEOUT),
            ..Self::default()
        };
        if let Some(limits) = device.control_limits() {
            let joints = || (0..axes).map(AxisIndex::from);
            let positions = joints().map(|joint| limits.position_limits(joint));
            options.joint_limits = JointLimits(known(positions.collect())?);
            let speeds = joints().map(|joint| Ok(limits.velocity_limits(joint)?.max));
            options.rate_limits = RateLimits {
                speeds: known(speeds.collect())?,
                accelerations: Vec::new(),
            };
        }
        if let Some(control) = device.torque_control() {
            options.torque_limits = TorqueLimits(largest(control.torque_ranges(Axes::All))?);
        }
        if let Some(control) = device.current_control() {
            options.current_limits = largest(control.current_ranges(Axes::All))?;
        }
        Ok(options)
    }
}

/// Returns what a device tells, nothing if it cannot.
pub(super) fn known<T>(told: Result<Vec<T>, DeviceError>) -> Result<Vec<T>, DeviceError> {
    match told {
        Err(DeviceError::NotSupported { .. }) => Ok(Vec::new()),
        told => told,
    }
}

fn largest(ranges: Result<Vec<Limits>, DeviceError>) -> Result<Vec<f64>, DeviceError> {
    let magnitude = |range: &Limits| range.max.abs().max(range.min.abs());
    Ok(known(ranges)?.iter().map(magnitude).collect())
}
