//! Safety around any driver: a device that passes on safe commands and refuses others with a reason.
//!
//! * [`Guarded`]: a [`Device`](crate::Device) around another one, with any of the guards below.
//! * [`JointLimits`]: joints stay inside limits that may be closer than the device's own.
//! * [`RateLimits`]: maximum commanded speed and acceleration of joints.
//! * [`TorqueLimits`]: maximum commanded torque of joints.
//! * A watchdog: joints whose stream of velocities, torques, currents or duty cycles stops hold their positions.
//! * A software stop ([`SoftwareStop`](crate::SoftwareStop)): every joint comes to rest and holds, and every command is
//!   refused until it is released.
//!
//! A refusal is a [`crate::DeviceError::Guarded`]: it names the guard, the joint, the requested
//! and the allowed value. A refused command does not reach the device.

mod default_guards;
mod effort_interfaces;
mod guarded_device;
mod guarded_interfaces;
mod joint_limits;
mod machine_interfaces;
mod rate_limits;
mod stop_switch;
mod streaming_interfaces;
mod torque_limits;
mod watchdog;

pub use default_guards::{DEFAULT_EFFORT_TIMEOUT, DEFAULT_VELOCITY_TIMEOUT};
pub use guarded_device::{Guarded, GuardedOptions};
pub use joint_limits::JointLimits;
pub use rate_limits::RateLimits;
pub use torque_limits::TorqueLimits;

use crate::{Axes, AxisIndex, DeviceError, JointType, Limits};

/// The unit of a joint's position, velocity or acceleration.
fn unit(kind: JointType, order: u8) -> &'static str {
    let degrees = ["deg", "deg/s", "deg/s²"];
    let metres = ["m", "m/s", "m/s²"];
    let neither = ["units", "units/s", "units/s²"];
    let row = match kind {
        JointType::Revolute => degrees,
        JointType::Prismatic => metres,
        JointType::Unknown => neither,
    };
    row[usize::from(order).min(2)]
}

/// Checks a value against what a guard allows; `None` allows everything.
///
/// Values that are not numbers are left to the device, which refuses them.
fn check(
    guard: &'static str,
    joint: AxisIndex,
    quantity: &'static str,
    asked: f64,
    allowed: Option<Limits>,
    unit: &'static str,
) -> Result<(), DeviceError> {
    match allowed {
        Some(limits) if asked.is_finite() => {
            limits
                .check(joint, quantity, asked, unit)
                .map_err(|source| DeviceError::Guarded {
                    guard,
                    source: Box::new(source),
                })
        }
        _ => Ok(()),
    }
}

/// The selected axes with their values; a selection that does not add up is left to the device, which refuses it.
fn pairs<'a>(
    axes: Axes<'a>,
    total: usize,
    values: &'a [f64],
) -> impl Iterator<Item = (AxisIndex, f64)> + 'a {
    axes.iter(total).zip(values.iter().copied())
}
