//! Paths through joint space, and when the arm is where on them.

mod shortcut;
mod time_parameterisation;

use yarp_devices::kinematics::Joints;

use crate::rrt_connect::distance;

pub(crate) use shortcut::shorten;
pub use time_parameterisation::{Trajectory, TrajectoryError};

/// A sequence of postures, connected by straight motions in joint space that collide with nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    postures: Vec<Joints<7>>,
}

impl Path {
    /// Returns a path through these postures; successive equal postures are merged.
    pub(crate) fn new(mut postures: Vec<Joints<7>>) -> Self {
        postures.dedup_by(|next, previous| (*next - *previous).norm() < 1e-9);
        Self { postures }
    }

    /// Returns the path through these postures, in rad, whose motions the caller has checked; `None` without a posture or
    /// with one that is not finite.
    pub fn through(postures: Vec<Joints<7>>) -> Option<Self> {
        let finite = postures
            .iter()
            .all(|joints| joints.iter().all(|angle| angle.is_finite()));
        (finite && !postures.is_empty()).then(|| Self::new(postures))
    }

    /// Returns the postures, in rad.
    pub fn postures(&self) -> &[Joints<7>] {
        &self.postures
    }

    /// Returns the length: the sum of the Euclidean distances of successive postures, in rad.
    pub fn length(&self) -> f64 {
        let pairs = self.postures.windows(2);
        pairs.map(|pair| (pair[1] - pair[0]).norm()).sum()
    }

    /// Returns the length in the planner's weighted distance.
    pub(crate) fn weighted_length(&self) -> f64 {
        let pairs = self.postures.windows(2);
        pairs.map(|pair| distance(&pair[0], &pair[1])).sum()
    }

    /// Returns the last posture.
    pub fn goal(&self) -> Joints<7> {
        *self.postures.last().expect("a path has a posture")
    }
}
