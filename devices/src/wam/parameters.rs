//! What the seven-joint arm is built like.
//!
//! Sources: D1001 is Barrett's *WAM Arm User's Manual* D1001 AH.00 (2008), tables 4 to 6; libbarrett and owd are the
//! public drivers of that name. They count in radians, which end in [`parameters`].

use crate::fake::AxisParameters;
use crate::{JointType, Limits};

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

/// Joint limits in rad: D1001 table 6, but 3.13 instead of 3.1 at the top of the elbow, so that home is inside.
const LIMITS: [(f64, f64); AXES] = [
    (-2.6, 2.6),
    (-2.0, 2.0),
    (-2.8, 2.8),
    (-0.9, 3.13),
    (-4.76, 1.24),
    (-1.6, 1.6),
    (-3.0, 3.0),
];

/// The folded pose the arm is put in before it starts, in rad (libbarrett, `zerocal.conf`).
const HOME: [f64; AXES] = [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0];

/// The largest joint speed in rad/s (owd).
const MAX_SPEED: f64 = 2.5;
/// The largest joint acceleration in rad/s²: the largest speed in 0.75 s (owd).
const MAX_ACCELERATION: f64 = MAX_SPEED / 0.75;
/// The speed of point-to-point moves in rad/s (libbarrett, `systems/wam.h`).
const REFERENCE_SPEED: f64 = 0.5;
/// The acceleration of point-to-point moves in rad/s² (libbarrett, `systems/wam.h`).
const REFERENCE_ACCELERATION: f64 = 0.5;

/// The parameters of the arm, base to tool, in degrees: the border between the radians of the sources and the
/// degrees of the interfaces.
///
/// ```
/// let elbow = &yarp_devices::wam::parameters()[3];
/// assert_eq!(elbow.name, "elbow");
/// assert_eq!(elbow.limits.max, 3.13_f64.to_degrees());
/// ```
pub fn parameters() -> [AxisParameters; AXES] {
    std::array::from_fn(|joint| {
        let (min, max) = LIMITS[joint];
        AxisParameters {
            name: NAMES[joint].to_owned(),
            joint_type: JointType::Revolute,
            limits: Limits::new(min.to_degrees(), max.to_degrees()),
            max_speed: MAX_SPEED.to_degrees(),
            max_acceleration: MAX_ACCELERATION.to_degrees(),
            reference_speed: REFERENCE_SPEED.to_degrees(),
            reference_acceleration: REFERENCE_ACCELERATION.to_degrees(),
            home: HOME[joint].to_degrees(),
        }
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
