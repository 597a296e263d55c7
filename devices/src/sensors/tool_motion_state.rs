//! Motion of a tool, out of that of the joints.

use nalgebra::{Rotation3, SVector, Vector3};

use crate::EncoderReading;
use crate::kinematics::{Chain, Joints};

/// Step of the numerical derivative of the Jacobian, s.
const DERIVATIVE_STEP: f64 = 1e-4;
/// Gravity in the base frame, whose z axis points up, m/s².
pub(super) const GRAVITY: f64 = 9.80665;

/// Motion of the tool in the base frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct ToolMotionState {
    /// Metres.
    pub(super) position: Vector3<f64>,
    /// Orientation of the tool.
    pub(super) rotation: Rotation3<f64>,
    /// m/s.
    pub(super) velocity: Vector3<f64>,
    /// rad/s.
    pub(super) angular_velocity: Vector3<f64>,
    /// m/s².
    pub(super) acceleration: Vector3<f64>,
    /// rad/s².
    pub(super) angular_acceleration: Vector3<f64>,
}

impl ToolMotionState {
    /// Computes the motion from readings of all joints in degrees; unknown speeds and accelerations count as 0.
    pub(super) fn of<const N: usize>(chain: &Chain<N>, readings: &[EncoderReading; N]) -> Self {
        let part = |part: fn(&EncoderReading) -> f64| {
            Joints::<N>::from_fn(|joint, _| {
                let value = part(&readings[joint]);
                if value.is_finite() {
                    value.to_radians()
                } else {
                    0.0
                }
            })
        };
        let joints = part(|reading| reading.position);
        let speeds = part(|reading| reading.speed);
        let accelerations = part(|reading| reading.acceleration);
        let (pose, jacobian) = chain.forward_and_jacobian(&joints);
        let (_, later) = chain.forward_and_jacobian(&(joints + speeds * DERIVATIVE_STEP));
        let derivative = (later - jacobian) / DERIVATIVE_STEP;
        let velocity: SVector<f64, 6> = jacobian * speeds;
        let acceleration: SVector<f64, 6> = jacobian * accelerations + derivative * speeds;
        let part = |vector: &SVector<f64, 6>, row| vector.fixed_rows::<3>(row).into_owned();
        Self {
            position: pose.translation.vector,
            rotation: pose.rotation,
            velocity: part(&velocity, 0),
            angular_velocity: part(&velocity, 3),
            acceleration: part(&acceleration, 0),
            angular_acceleration: part(&acceleration, 3),
        }
    }

    /// Turns a vector of the base frame into the frame of the tool.
    pub(super) fn in_tool(&self, vector: Vector3<f64>) -> Vector3<f64> {
        self.rotation.inverse() * vector
    }

    /// Returns the proper acceleration of a point fixed to the tool, `offset` in the frame of the tool; both in that
    /// frame, m and m/s². At rest it is gravity, upwards.
    pub(super) fn proper_acceleration(&self, offset: Vector3<f64>) -> Vector3<f64> {
        let arm = self.rotation * offset;
        let turn = self.angular_acceleration.cross(&arm);
        let centripetal = self
            .angular_velocity
            .cross(&self.angular_velocity.cross(&arm));
        let up = Vector3::new(0.0, 0.0, GRAVITY);
        self.in_tool(self.acceleration + turn + centripetal + up)
    }
}
