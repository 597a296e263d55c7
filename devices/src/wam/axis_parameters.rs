//! Parameters of the joints.
//!
//! Sources: D1001 is Barrett's *WAM Arm User's Manual* D1001 AH.00 (2008), tables 4 to 6; libbarrett and owd are the
//! public drivers of that name. They count in radians, which end in [`parameters`].

use super::wam_model::{HOME, LIMITS};
use super::wam_units::limits_in_degrees;
use crate::JointType;
use crate::fake::AxisParameters;

/// The number of joints.
pub const AXES: usize = 7;

/// Names after the joints of D1001, base to tool.
const NAMES: [&str; AXES] = [
    "base_yaw",
    "shoulder_pitch",
    "upper_arm_twist",
    "elbow",
    "wrist_yaw",
    "wrist_pitch",
    "palm_twist",
];

/// The largest joint speed in rad/s (owd).
const MAX_SPEED: f64 = 2.5;
/// The largest joint acceleration in rad/s²: the largest speed in 0.75 s (owd).
const MAX_ACCELERATION: f64 = MAX_SPEED / 0.75;
/// The speed of point-to-point moves in rad/s (libbarrett, `systems/wam.h`).
const REFERENCE_SPEED: f64 = 0.5;
/// The acceleration of point-to-point moves in rad/s² (libbarrett, `systems/wam.h`).
const REFERENCE_ACCELERATION: f64 = 0.5;

/// The parameters of the arm with seven joints, base to tool, in degrees: the border between the radians of the sources and the
/// degrees of the interfaces.
///
/// ```
/// let elbow = &yarp_devices::wam::parameters()[3];
/// assert_eq!(elbow.name, "elbow");
/// assert_eq!(elbow.limits.max, 3.13_f64.to_degrees());
/// ```
pub fn parameters() -> [AxisParameters; AXES] {
    parameters_of()
}

/// The parameters of the arm with `N` joints: those of its first joints.
///
/// ```
/// let [.., elbow] = yarp_devices::wam::parameters_of::<4>();
/// assert_eq!(elbow.name, "elbow");
/// ```
pub fn parameters_of<const N: usize>() -> [AxisParameters; N] {
    std::array::from_fn(|joint| AxisParameters {
        name: NAMES[joint].to_owned(),
        joint_type: JointType::Revolute,
        limits: limits_in_degrees(LIMITS[joint]),
        max_speed: MAX_SPEED.to_degrees(),
        max_acceleration: MAX_ACCELERATION.to_degrees(),
        reference_speed: REFERENCE_SPEED.to_degrees(),
        reference_acceleration: REFERENCE_ACCELERATION.to_degrees(),
        home: HOME[joint].to_degrees(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn home_is_inside_the_limits() {
        for axis in parameters() {
            assert!(axis.limits.contains(axis.home), "{axis:?}");
        }
    }
}
