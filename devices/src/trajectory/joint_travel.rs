//! The distance that joints may turn for a motion of the tool.

use super::StraightLineOptions;

/// Maximum change of any joint while the tool makes one step, rad.
///
/// A larger change for so short a way is a change of posture: elbow and forearm sweep through space although the tool
/// hardly moves.
pub const MAX_JOINT_CHANGE_PER_STEP: f64 = 0.5;
/// Length of one step of the tool, m.
pub const STEP_LENGTH: f64 = 0.05;
/// Rotation of one step of the tool, rad. A wrist turns by the rotation itself; the other half of the allowance is for the
/// joints that keep the tool in its place.
pub const STEP_ANGLE: f64 = 0.25;
/// Tolerance of the number of steps, because of rounding: a way of exactly one step is one step.
const STEP_TOLERANCE: f64 = 1e-6;

impl StraightLineOptions {
    /// Returns the maximum change of any joint on a way of `distance` metres with a rotation of `angle` rad, rad: the
    /// allowance of a step for each step begun.
    pub fn largest_joint_change(&self, distance: f64, angle: f64) -> f64 {
        largest_joint_change(self.joint_change_per_step, distance, angle)
    }
}

/// Returns the maximum change of any joint with `per_step` rad for each step begun.
pub(crate) fn largest_joint_change(per_step: f64, distance: f64, angle: f64) -> f64 {
    let steps = (distance / STEP_LENGTH).max(angle / STEP_ANGLE);
    per_step * (steps - STEP_TOLERANCE).ceil().max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_step_begun_allows_half_a_radian() {
        let options = StraightLineOptions::default();
        for (distance, angle, expected) in [
            (0.0, 0.0, 0.5),
            (0.05, 0.0, 0.5),
            (0.051, 0.0, 1.0),
            (0.4, 0.0, 4.0),
            (0.0, 0.25, 0.5),
            (0.05, 0.6, 1.5),
        ] {
            assert_eq!(options.largest_joint_change(distance, angle), expected);
        }
    }
}
