//! What of a pose is asked for, and how far it is away.

use nalgebra::Vector6;

use super::{Jacobian, Pose, rotation_vector};

/// What of a target pose a solver shall reach.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Task {
    /// Place and orientation.
    #[default]
    Pose,
    /// The place alone; all that an arm with four joints can promise.
    Position,
    /// The orientation alone.
    Orientation,
}

impl Task {
    /// From `pose` to `target`: metres, then an axis times an angle in rad, both in the base frame.
    ///
    /// What the task does not ask for is 0.
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

    /// The Jacobian without the rows the task does not ask for: they are 0.
    pub(super) fn select<const N: usize>(self, mut jacobian: Jacobian<N>) -> Jacobian<N> {
        match self {
            Self::Pose => {}
            Self::Position => jacobian.fixed_rows_mut::<3>(3).fill(0.0),
            Self::Orientation => jacobian.fixed_rows_mut::<3>(0).fill(0.0),
        }
        jacobian
    }
}

/// How far a place is off, m, and an orientation, rad.
pub(crate) fn distances(error: &Vector6<f64>) -> (f64, f64) {
    (
        error.fixed_rows::<3>(0).norm(),
        error.fixed_rows::<3>(3).norm(),
    )
}
