//! Gravity moments from poses in which an arm was held.

use nalgebra::{DMatrix, DVector, Vector3};

use super::GravityCalibration;
use crate::kinematics::{Chain, Joints};

/// Part of the largest singular value below which a combination of moments does not show in the torques.
const MIN_SINGULAR_VALUE: f64 = 1e-3;

/// A pose in which an arm was held, and the torques that held it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldPose<const N: usize> {
    /// rad.
    pub joints: Joints<N>,
    /// Nm.
    pub torques: Joints<N>,
}

impl<const N: usize> HeldPose<N> {
    /// Returns the mean of two measurements.
    pub fn mean(&self, other: &Self) -> Self {
        Self {
            joints: (self.joints + other.joints) / 2.0,
            torques: (self.torques + other.torques) / 2.0,
        }
    }
}

impl<const N: usize> GravityCalibration<N> {
    /// Returns the moments that explain the measured torques best, by least squares.
    ///
    /// Combinations of moments that do not show in these poses stay as they are here. Allocates; for a person who waits.
    pub fn fitted(&self, chain: &Chain<N>, poses: &[HeldPose<N>]) -> Self {
        if poses.is_empty() {
            return *self;
        }
        let mut matrix = DMatrix::zeros(poses.len() * N, 3 * N);
        let mut rest = DVector::zeros(poses.len() * N);
        for (index, pose) in poses.iter().enumerate() {
            for unknown in 0..3 * N {
                let mut unit = Self {
                    moments: [Vector3::zeros(); N],
                    gravity: self.gravity,
                };
                unit.moments[unknown / 3][unknown % 3] = 1.0;
                let torques = unit.torques(chain, &pose.joints);
                for joint in 0..N {
                    matrix[(index * N + joint, unknown)] = torques[joint];
                }
            }
            let missing = pose.torques - self.torques(chain, &pose.joints);
            for joint in 0..N {
                rest[index * N + joint] = missing[joint];
            }
        }
        let decomposition = matrix.svd(true, true);
        let least = decomposition.singular_values.max() * MIN_SINGULAR_VALUE;
        let mut fitted = *self;
        // Both factors were asked for.
        if let Ok(change) = decomposition.solve(&rest, least) {
            for unknown in 0..3 * N {
                fitted.moments[unknown / 3][unknown % 3] += change[unknown];
            }
        }
        fitted
    }

    /// Returns the root mean square of the torques that the moments do not explain, Nm; zeros without poses.
    pub fn unexplained(&self, chain: &Chain<N>, poses: &[HeldPose<N>]) -> Joints<N> {
        let mut sum = Joints::<N>::zeros();
        for pose in poses {
            let missing = pose.torques - self.torques(chain, &pose.joints);
            sum += missing.component_mul(&missing);
        }
        (sum / poses.len().max(1) as f64).map(f64::sqrt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::Body;
    use crate::wam::WamModel;

    fn poses(model: &WamModel<7>, count: u32) -> Vec<HeldPose<7>> {
        let dynamics = model.dynamics();
        let at = |index: u32| {
            let joints = Joints::<7>::from_fn(|joint, _| {
                let step = f64::from(index) * (0.61 + 0.17 * joint as f64);
                1.4 * (step - step.round()) * 2.0
            });
            HeldPose {
                joints,
                torques: dynamics.gravity(&joints),
            }
        };
        (1..=count).map(at).collect()
    }

    #[test]
    fn an_unknown_load_is_found_from_torques() {
        let load = Body::point(1.2, [0.02, -0.01, 0.07].into());
        let model = WamModel::<7>::new();
        let loaded = model.clone().with_load(load);
        let measured = poses(&loaded, 9);
        let others = poses(&loaded, 30);
        let before = model.calibration.unexplained(&model.chain, &others);
        assert!(before[1] > 3.0, "{before}");
        let fitted = model.calibration.fitted(&model.chain, &measured);
        let after = fitted.unexplained(&model.chain, &others);
        assert!(after.amax() < 1e-6, "{after}");
    }

    /// The mean does not grow with the number of poses.
    #[test]
    fn the_unexplained_is_a_mean_over_the_poses() {
        let model = WamModel::<7>::new();
        let off = |joint: usize| if joint == 3 { 2.0 } else { 0.0 };
        let held = |joints: Joints<7>| HeldPose {
            joints,
            torques: model.calibration.torques(&model.chain, &joints)
                + Joints::<7>::from_fn(|joint, _| off(joint)),
        };
        for count in [1, 4, 25] {
            let poses: Vec<_> = poses(&model, count)
                .into_iter()
                .map(|pose| held(pose.joints))
                .collect();
            let unexplained = model.calibration.unexplained(&model.chain, &poses);
            assert!((unexplained[3] - 2.0).abs() < 1e-9, "{unexplained}");
            assert!(unexplained[1].abs() < 1e-9, "{unexplained}");
        }
    }

    /// Moments about the vertical first axis never show.
    #[test]
    fn what_does_not_show_stays() {
        let model = WamModel::<7>::new();
        let fitted = model.calibration.fitted(&model.chain, &poses(&model, 1));
        let change = fitted.moments[6] - model.calibration.moments[6];
        assert!(change.norm() < 0.1, "{change}");
        let unmeasured = model.calibration.fitted(&model.chain, &[]);
        assert_eq!(unmeasured, model.calibration);
    }
}
