//! A device around a device.

use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::default_guards::known;
use super::watchdog::{WatchSettings, Watchdog};
use super::{JointLimits, RateLimits, TorqueLimits};
use crate::{Axes, Device, DeviceError};

/// Guards of a [`Guarded`] device; without any it passes everything on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GuardedOptions {
    /// Allowed positions of the joints.
    pub joint_limits: JointLimits,
    /// Allowed speeds and accelerations.
    pub rate_limits: RateLimits,
    /// Allowed torques.
    pub torque_limits: TorqueLimits,
    /// Largest current of each motor, A; motors beyond the end of the list are unlimited.
    pub current_limits: Vec<f64>,
    /// Maximum time for which a joint continues with a velocity without a new command; `None` is unlimited, as in the
    /// device itself.
    ///
    /// After it the joint is stopped and holds. A client that streams sends several commands within it.
    pub watchdog: Option<Duration>,
    /// The same for torques, currents and duty cycles: after it the joint is put into position mode and holds.
    pub effort_watchdog: Option<Duration>,
}

/// A driver behind guards: it has the interfaces of the driver that the guards support, and refuses forbidden
/// commands with the name of the guard.
///
/// Reference speeds and accelerations above the rate limits are reduced to them at the start. A dedicated thread monitors
/// joints that follow a velocity, torque, current or duty cycle; it ends when the device is dropped. Position moves and
/// direct positions need no watchdog: the joint ends at the target. Interfaces without commands to joints are those of
/// the device, among them its variables, one of which may move it, like `pose` of
/// [`EmbeddedWam`](crate::embedded::EmbeddedWam).
///
/// ```
/// use std::sync::Arc;
/// use yarp_devices::guard::{Guarded, GuardedOptions, JointLimits};
/// use yarp_devices::wam::SimulatedWam;
/// use yarp_devices::{Axes, Device, Limits};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let options = GuardedOptions {
///     joint_limits: JointLimits(vec![Limits::new(-90.0, 90.0)]),
///     ..GuardedOptions::default()
/// };
/// let arm = Guarded::around(Arc::new(SimulatedWam::new()), options)?;
/// let refused = arm.position_control().unwrap().position_move(Axes::One(0.into()), &[100.0]);
/// assert_eq!(
///     refused.unwrap_err().to_string(),
///     "the joint limits of the guard forbid it: joint 0 asked for position 100 deg, allowed -90 to 90 deg"
/// );
/// # Ok(())
/// # }
/// ```
pub struct Guarded {
    pub(super) watch: Arc<Watchdog>,
    pub(super) joint_limits: JointLimits,
    pub(super) rate_limits: RateLimits,
    pub(super) torque_limits: TorqueLimits,
    pub(super) current_limits: Vec<f64>,
    /// True without any guard.
    pub(super) is_unlimited: bool,
    thread: Option<JoinHandle<()>>,
}

impl Guarded {
    /// Puts guards around a device.
    ///
    /// Errors: [`DeviceError::Start`] if no thread can be started, or the device's error when its limits and
    /// references are read.
    pub fn around(device: Arc<dyn Device>, options: GuardedOptions) -> Result<Self, DeviceError> {
        let is_unlimited = options == GuardedOptions::default();
        slow_down(device.as_ref(), &options.rate_limits)?;
        let axes = device.axis_info().map_or(0, |info| info.axes());
        let limits = closer(device.as_ref(), &options.joint_limits, axes)?;
        let mut all = options.joint_limits.clone();
        all.0.truncate(axes);
        let settings = WatchSettings {
            limits,
            effort_limits: all,
            velocity_timeout: options.watchdog,
            effort_timeout: options.effort_watchdog,
        };
        let watch = Arc::new(Watchdog::new(device, settings, axes));
        let theirs = Arc::clone(&watch);
        let thread = thread::Builder::new()
            .name("guard".into())
            .spawn(move || theirs.run())
            .map_err(|source| DeviceError::Start {
                what: "the thread of the guard",
                source,
            })?;
        Ok(Self {
            watch,
            joint_limits: options.joint_limits,
            rate_limits: options.rate_limits,
            torque_limits: options.torque_limits,
            current_limits: options.current_limits,
            is_unlimited,
            thread: Some(thread),
        })
    }

    /// Checks torques before they are given to the device.
    ///
    /// Errors: [`DeviceError::Guarded`], or an error of the selection.
    pub fn check_torques(&self, axes: Axes<'_>, torques: &[f64]) -> Result<(), DeviceError> {
        let total = self.total();
        axes.check_command(total, "torques", torques.len())?;
        self.torque_limits.check(axes, total, torques)
    }

    pub(super) fn device(&self) -> &dyn Device {
        self.watch.device.as_ref()
    }

    pub(super) fn total(&self) -> usize {
        self.device().axis_info().map_or(0, |info| info.axes())
    }
}

impl Drop for Guarded {
    fn drop(&mut self) {
        self.watch.end();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread of the guard had panicked");
        }
    }
}

/// Brings references above the limits down to them.
fn slow_down(device: &dyn Device, rates: &RateLimits) -> Result<(), DeviceError> {
    let Some(control) = device.position_control() else {
        return Ok(());
    };
    for joint in (0..control.axes()).map(crate::AxisIndex::from) {
        let axes = Axes::One(joint);
        if let Some(most) = rates.speed(joint)
            && known(control.reference_speeds(axes))?
                .iter()
                .any(|speed| *speed > most)
        {
            control.set_reference_speeds(axes, &[most])?;
        }
        if let Some(most) = rates.acceleration(joint)
            && known(control.reference_accelerations(axes))?
                .iter()
                .any(|acceleration| *acceleration > most)
        {
            control.set_reference_accelerations(axes, &[most])?;
        }
    }
    Ok(())
}

/// Limits at which the guard must stop a joint: those that the device does not enforce itself, the others unlimited.
fn closer(
    device: &dyn Device,
    limits: &JointLimits,
    axes: usize,
) -> Result<JointLimits, DeviceError> {
    let Some(own) = device.control_limits() else {
        return Ok(limits.clone());
    };
    let mut closer = limits.clone();
    closer.0.truncate(axes);
    for (joint, ours) in closer.0.iter_mut().enumerate() {
        let theirs = own.position_limits(joint.into())?;
        if ours.min <= theirs.min {
            ours.min = f64::NEG_INFINITY;
        }
        if ours.max >= theirs.max {
            ours.max = f64::INFINITY;
        }
    }
    Ok(closer)
}
