//! Gravity compensation from measured moments.

use nalgebra::Vector3;

use crate::kinematics::{Chain, Joints};

/// Gravity compensation as libbarrett does it (`calgrav.c`): one constant vector per link, found by holding a real
/// arm in a few poses.
///
/// A vector is the first moment, kg m, of a link and of everything beyond it lumped at its end, about the origin
/// of the frame before the link, in the link's own frame. Measured and computed vectors differ, because not every component
/// shows in the torques; so do the torques, by some tenths of a newton metre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravityCalibration<const N: usize> {
    /// The moments, kg m, base to tool.
    pub moments: [Vector3<f64>; N],
    /// Downward along the base's z axis, m/s².
    pub gravity: f64,
}

impl<const N: usize> GravityCalibration<N> {
    /// The torques that hold the arm still, Nm.
    pub fn torques(&self, chain: &Chain<N>, joints: &Joints<N>) -> Joints<N> {
        let frames = chain.frames(joints);
        let down = Vector3::new(0.0, 0.0, -self.gravity);
        let mut torque = Vector3::zeros();
        let mut torques = Joints::<N>::zeros();
        for joint in (0..N).rev() {
            let inward = frames[joint].rotation.inverse();
            torque += (inward * down).cross(&self.moments[joint]);
            torque = chain.link_pose(joint, joints[joint]).rotation * torque;
            torques[joint] = torque.z;
        }
        torques
    }
}
