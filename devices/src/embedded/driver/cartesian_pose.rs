//! Position and orientation of the tool in the units of callers: metres and degrees.

use crate::DeviceError;
use crate::embedded::protocol::POSE;

/// Pose of the tool in the base frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CartesianPose {
    /// x, y, z in metres.
    pub place: [f64; 3],
    /// Degrees about the fixed x, y and z axes, in this order: see [`EulerXyz`](crate::kinematics::EulerXyz).
    pub turn: [f64; 3],
}

impl CartesianPose {
    pub(super) fn from_wire(pose: [f64; POSE]) -> Self {
        let [x, y, z, roll, pitch, yaw] = pose;
        Self {
            place: [x, y, z],
            turn: [roll, pitch, yaw].map(f64::to_degrees),
        }
    }

    pub(super) fn to_wire(self) -> [f64; POSE] {
        let [x, y, z] = self.place;
        let [roll, pitch, yaw] = self.turn.map(f64::to_radians);
        [x, y, z, roll, pitch, yaw]
    }

    pub(super) fn check(&self) -> Result<(), DeviceError> {
        let mut numbers = self.place.into_iter().chain(self.turn).enumerate();
        match numbers.find(|(_, number)| !number.is_finite()) {
            None => Ok(()),
            Some((place, asked)) => Err(DeviceError::NotFinite {
                joint: place.into(),
                quantity: "coordinate of the pose",
                asked,
            }),
        }
    }
}
