//! Tasks: the parts of a pose that are required, and the distance from them.

use nalgebra::Vector6;

use super::{Jacobian, Pose, rotation_vector};

/// The part of a target pose that a solver must reach.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Task {
    /// Place and orientation.
    #[default]
    Pose,
    /// The position alone; all that an arm with four joints can reach.
    Position,
    /// The orientation alone.
    Orientation,
}

impl Task {
    /// From `pose` to `target`: metres, then an axis times an angle in rad, both in the base frame.
    ///
    /// Components outside the task are 0.
    pub fn error(self, target: &Pose, pose: &Pose) -> Vector6<f64> {
        let place = match self {
            Self::Pose | Self::Position => target.translation.vector - pose.translation.vector,
            Self::Orientation => Default::default(),
        };
        let turn = match self {
            Self::Pose | Self::Orientation => {
                rotation_vector(&(target.rotation * pose.rotation.inverse()))
            }
            Self::Position => Default::default(),
        };
        Vector6::new(place.x, place.y, place.z, turn.x, turn.y, turn.z)
    }

    /// Returns the Jacobian with the rows outside the task set to 0.
    pub(super) fn select<const N: usize>(self, mut jacobian: Jacobian<N>) -> Jacobian<N> {
        match self {
            Self::Pose => {}
            Self::Position => jacobian.fixed_rows_mut::<3>(3).fill(0.0),
            Self::Orientation => jacobian.fixed_rows_mut::<3>(0).fill(0.0),
        }
        jacobian
    }
}

/// Returns the errors of position, m, and orientation, rad.
pub(crate) fn distances(error: &Vector6<f64>) -> (f64, f64) {
    (
        error.fixed_rows::<3>(0).norm(),
        error.fixed_rows::<3>(3).norm(),
    )
}
