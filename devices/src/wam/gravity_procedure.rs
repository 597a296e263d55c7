//! The measurement for a gravity calibration: the arm is held in some poses, and its torques are read.

use crate::dynamics::{GravityCalibration, HeldPose};
use crate::kinematics::{Chain, Joints};
use crate::wam::{AXES, WamModel};

/// Poses of libbarrett's gravity calibration, rad (`calibration.conf`, `gravitycal.wam7w`).
#[allow(clippy::approx_constant, reason = "the numbers of the file")]
const POSES: [[f64; AXES]; 9] = [
    [0.0, -1.5708, 0.0, 1.5708, 0.0, 0.0, 0.0],
    [0.7854, -1.5708, 1.5708, 1.5708, -1.5708, 0.0, 0.0],
    [-0.7854, -1.5708, -1.5708, 1.5708, -1.5708, 0.0, 0.0],
    [-0.7854, 1.5708, 1.5708, 1.5708, 0.0, 1.5, 0.0],
    [0.0, 0.7854, 0.0, 2.3562, 0.0, -0.7854, 0.0],
    [0.7854, 1.5708, -1.5708, 1.5708, 0.0, 1.5, 0.0],
    [0.0, 0.0, 0.7854, 1.5708, 0.7854, 0.7854, 0.7854],
    [0.0, 1.5708, -1.5708, -0.3927, 0.7854, -1.0781, -0.7854],
    [-0.7854, 0.7854, -0.7854, -0.7854, 0.7854, -0.7854, 0.7854],
];
/// Poses of the verification, rad: between those of the calibration, and none of them.
const VERIFIED: [[f64; AXES]; 3] = [
    [0.0, -1.0, 0.5, 1.8, -0.6, 0.5, 0.0],
    [0.3, 0.4, -0.6, 1.2, 0.4, -0.5, 0.4],
    [-0.3, 1.1, 0.4, 0.6, -0.5, 0.6, -0.5],
];
/// Distance from which a pose is approached, once from each side, rad: friction has opposite signs then (libbarrett).
const ANGLE_DIFFERENCE: f64 = 0.03;
/// Speed of the approach, and of the way to it, rad/s (libbarrett).
const SLOW_SPEED: f64 = 0.05;
const SPEED: f64 = 0.5;

/// An arm that can be moved and read.
pub trait MeasuredArm<const N: usize = AXES> {
    /// Reason why it cannot.
    type Error;

    /// Moves all joints to these angles, rad, at this speed, rad/s, and returns when they are there.
    fn move_to(&mut self, joints: &Joints<N>, speed: f64) -> Result<(), Self::Error>;

    /// Returns the means of joints and torques over a second, after the arm has come to rest.
    fn measure(&mut self) -> Result<HeldPose<N>, Self::Error>;
}

/// A gravity calibration, and how well it explains what was measured.
#[derive(Clone, Copy, Debug)]
pub struct GravityResult<const N: usize = AXES> {
    /// The moments.
    pub calibration: GravityCalibration<N>,
    /// Root mean square of the unexplained torques in the poses of the calibration, Nm.
    pub residual: Joints<N>,
    /// The same in other poses, with the moments before and the new ones.
    pub before: Joints<N>,
    /// With the new ones.
    pub verified: Joints<N>,
    /// Friction of the joints, Nm: a torque below it moves nothing.
    pub friction: Joints<N>,
}

impl<const N: usize> GravityResult<N> {
    /// Returns whether no joint has an unexplained torque beyond its friction in the verification.
    pub fn is_verified(&self) -> bool {
        let below = |joint: usize| self.verified[joint] <= self.friction[joint];
        (0..N).all(below)
    }
}

/// Returns the number of poses of a calibration with its verification.
pub const fn gravity_poses() -> usize {
    POSES.len() + VERIFIED.len()
}

/// Moves an arm through the poses of a gravity calibration, and returns the moments that explain its torques.
///
/// `progress` is called with the number of poses that are done. Errors: those of the arm, which holds where it is.
pub fn calibrate_gravity<A: MeasuredArm<N>, const N: usize>(
    arm: &mut A,
    model: &WamModel<N>,
    mut progress: impl FnMut(usize),
) -> Result<GravityResult<N>, A::Error> {
    let mut held = Vec::new();
    for pose in POSES.iter().chain(&VERIFIED) {
        held.push(hold(arm, &Joints::from_fn(|joint, _| pose[joint]))?);
        progress(held.len());
    }
    let (measured, others) = held.split_at(POSES.len());
    let chain: &Chain<N> = &model.chain;
    let calibration = model.calibration.fitted(chain, measured);
    Ok(GravityResult {
        calibration,
        residual: calibration.unexplained(chain, measured),
        before: model.calibration.unexplained(chain, others),
        verified: calibration.unexplained(chain, others),
        friction: Joints::from(model.friction.map(|friction| friction.coulomb)),
    })
}

/// Measures a pose from both sides.
fn hold<A: MeasuredArm<N>, const N: usize>(
    arm: &mut A,
    pose: &Joints<N>,
) -> Result<HeldPose<N>, A::Error> {
    let mut from = |side: f64| {
        arm.move_to(&pose.add_scalar(side * ANGLE_DIFFERENCE), SPEED)?;
        arm.move_to(pose, SLOW_SPEED)?;
        arm.measure()
    };
    let above = from(1.0)?;
    let below = from(-1.0)?;
    Ok(above.mean(&below))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torque_beyond_the_friction_of_a_joint_is_not_verified() {
        let model = WamModel::<AXES>::new();
        let friction = Joints::from(model.friction.map(|friction| friction.coulomb));
        let mut result = GravityResult {
            calibration: model.calibration,
            residual: Joints::zeros(),
            before: Joints::zeros(),
            verified: friction,
            friction,
        };
        assert!(result.is_verified());
        result.verified[6] += 0.01;
        assert!(!result.is_verified());
    }

    /// Within the limits also from both sides.
    #[test]
    fn poses_can_be_reached() {
        let model = WamModel::<AXES>::new();
        let limits = model.chain.limits();
        for pose in POSES.iter().chain(&VERIFIED) {
            for (angle, limits) in pose.iter().zip(limits) {
                assert!(limits.contains(angle - ANGLE_DIFFERENCE), "{pose:?}");
                assert!(limits.contains(angle + ANGLE_DIFFERENCE), "{pose:?}");
            }
        }
    }
}
