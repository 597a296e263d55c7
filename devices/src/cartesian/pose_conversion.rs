//! Poses as the interface has them, and as the mathematics has them.

use nalgebra::{Rotation3, Translation3, Unit, Vector3};

use crate::kinematics::{Pose, rotation_vector};
use crate::{DeviceError, TaskPose};

/// An axis shorter than this is none.
const MIN_AXIS_LENGTH: f64 = 1e-9;

fn unsuitable(what: &'static str, asked: String, expected: &str) -> DeviceError {
    DeviceError::Unsuitable {
        what,
        asked,
        expected: expected.to_owned(),
    }
}

/// Refuses values that are not finite.
pub(super) fn finite(what: &'static str, numbers: &[f64]) -> Result<(), DeviceError> {
    if numbers.iter().all(|number| number.is_finite()) {
        Ok(())
    } else {
        Err(unsuitable(what, format!("{numbers:?}"), "finite numbers"))
    }
}

/// Checks that a number lies between two others.
pub(super) fn within(
    what: &'static str,
    asked: f64,
    (min, max): (f64, f64),
) -> Result<f64, DeviceError> {
    if (min..=max).contains(&asked) {
        Ok(asked)
    } else {
        let expected = format!("{min} to {max}");
        Err(unsuitable(what, asked.to_string(), &expected))
    }
}

/// Returns a rotation by `angle` about an axis of any length; no axis is needed for an angle of 0.
pub(super) fn turn(axis: [f64; 3], angle: f64) -> Result<Vector3<f64>, DeviceError> {
    finite("axis and angle", &[axis[0], axis[1], axis[2], angle])?;
    match Unit::try_new(Vector3::from(axis), MIN_AXIS_LENGTH) {
        Some(unit) => Ok(unit.into_inner() * angle),
        None if angle == 0.0 => Ok(Vector3::zeros()),
        None => {
            let asked = format!("{axis:?}");
            Err(unsuitable("axis", asked, "one that is not all zeros"))
        }
    }
}

/// A pose out of an interface.
pub(super) fn to_pose(pose: &TaskPose) -> Result<Pose, DeviceError> {
    finite("place", &pose.position)?;
    let turn = turn(pose.axis, pose.angle)?;
    Ok(Pose::from_parts(
        Translation3::from(pose.position),
        Rotation3::new(turn),
    ))
}

/// A pose for an interface: its axis has the length 1, its angle is 0 to π.
pub(super) fn from_pose(pose: &Pose) -> TaskPose {
    let turn = rotation_vector(&pose.rotation);
    let (axis, angle) = axis_and_angle(turn);
    TaskPose {
        position: pose.translation.vector.into(),
        axis,
        angle,
    }
}

/// A turn as an axis of length 1, that of z for no turn, and an angle.
pub(super) fn axis_and_angle(turn: Vector3<f64>) -> ([f64; 3], f64) {
    match Unit::try_new_and_get(turn, MIN_AXIS_LENGTH) {
        Some((axis, angle)) => (axis.into_inner().into(), angle),
        None => ([0.0, 0.0, 1.0], 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_come_back_with_an_axis_of_length_one() {
        let given = TaskPose::from_array([0.1, -0.2, 0.3, 0.0, 2.0, 0.0, 1.5]);
        let back = from_pose(&to_pose(&given).unwrap()).to_array();
        let expected = [0.1, -0.2, 0.3, 0.0, 1.0, 0.0, 1.5];
        for (found, expected) in back.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{back:?}");
        }
        let none = from_pose(&to_pose(&TaskPose::default()).unwrap());
        assert_eq!(none.to_array(), [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn what_is_no_pose_is_refused() {
        for wrong in [
            [f64::NAN, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, f64::INFINITY],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ] {
            assert!(to_pose(&TaskPose::from_array(wrong)).is_err(), "{wrong:?}");
        }
    }
}
