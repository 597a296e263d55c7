//! Joint targets that bring the tool towards a place, for guiding the arm by dragging its tool in the page.

use nalgebra::{Matrix3, Vector3};
use yarp_devices::kinematics::{Chain, Joints};
use yarp_devices::wam::WamModel;

/// Maximum number of steps towards the place.
const MAX_STEPS: usize = 60;
/// Maximum length of a step, m: the Jacobian is accurate for short ones alone.
const MAX_STEP: f64 = 0.05;
/// Distance at which the tool has arrived, m.
const TOLERANCE: f64 = 5e-4;
/// Damping of the inverse, m²: near a stretched arm the joints stay slow.
const DAMPING: f64 = 4e-4;

/// The arms whose tool is dragged: one with four joints, one with seven.
#[derive(Debug)]
pub(crate) struct Guide {
    four: Chain<4>,
    seven: Chain<7>,
}

impl Guide {
    pub(crate) fn new() -> Self {
        Self {
            four: WamModel::<4>::new().chain,
            seven: WamModel::<7>::new().chain,
        }
    }

    /// Returns joint positions inside the limits, degrees, that bring the tool plate from `present` to `place` (m, in the frame of
    /// the base), or as near to it as short steps come; `None` for an arm with another number of joints. The orientation of the tool
    /// is free.
    pub(crate) fn towards(&self, present: &[f64], place: [f64; 3]) -> Option<Vec<f64>> {
        let place = Vector3::from(place);
        match present.len() {
            4 => Some(towards(&self.four, present, &place)),
            7 => Some(towards(&self.seven, present, &place)),
            _ => None,
        }
    }
}

fn towards<const N: usize>(chain: &Chain<N>, present: &[f64], place: &Vector3<f64>) -> Vec<f64> {
    let start = Joints::<N>::from_fn(|joint, _| present[joint].to_radians());
    let mut joints = chain.clamp(&start);
    for _ in 0..MAX_STEPS {
        let (pose, jacobian) = chain.forward_and_jacobian(&joints);
        let error = place - pose.translation.vector;
        if error.norm() < TOLERANCE {
            break;
        }
        let step = error.cap_magnitude(MAX_STEP);
        let motion = jacobian.fixed_rows::<3>(0);
        let damped = motion * motion.transpose() + Matrix3::identity() * DAMPING;
        let Some(inverse) = damped.try_inverse() else {
            break;
        };
        joints = chain.clamp(&(joints + motion.transpose() * (inverse * step)));
    }
    joints.iter().map(|angle| angle.to_degrees()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOME: [f64; 7] = [0.0, 40.0, 0.0, 90.0, 0.0, 50.0, 0.0];

    fn place(joints: &[f64]) -> Vector3<f64> {
        let joints = Joints::<7>::from_iterator(joints.iter().map(|angle| angle.to_radians()));
        WamModel::<7>::new()
            .chain
            .forward(&joints)
            .translation
            .vector
    }

    #[test]
    fn the_tool_arrives_at_places_within_reach() {
        let guide = Guide::new();
        for step in [[0.1, 0.0, 0.0], [0.0, 0.2, -0.1], [-0.15, -0.1, 0.1]] {
            let target = place(&HOME) + Vector3::from(step);
            let found = guide.towards(&HOME, target.into()).unwrap();
            assert!((place(&found) - target).norm() < 1e-3, "{found:?}");
        }
    }

    #[test]
    fn places_beyond_reach_are_approached_inside_the_limits() {
        let guide = Guide::new();
        let chain = WamModel::<7>::new().chain;
        for target in [
            [5.0, 0.0, 0.0],
            [0.0, 0.0, 9.0],
            [0.0, 0.0, 0.0],
            [1e300, 0.0, 0.0],
        ] {
            let found = guide.towards(&HOME, target).unwrap();
            let joints = Joints::<7>::from_iterator(found.iter().map(|angle| angle.to_radians()));
            assert!(found.iter().all(|angle| angle.is_finite()), "{found:?}");
            assert!(
                joints.iter().zip(chain.limits()).all(|(angle, limits)| {
                    (limits.min - 1e-9..=limits.max + 1e-9).contains(angle)
                }),
                "{found:?}"
            );
        }
        let far = guide.towards(&HOME, [5.0, 0.0, 0.0]).unwrap();
        assert!(place(&far).x > place(&HOME).x + 0.2, "{far:?}");
    }

    #[test]
    fn an_arm_without_a_wrist_is_guided_by_its_end() {
        let chain = WamModel::<4>::new().chain;
        let place = |joints: &[f64]| {
            let joints = Joints::<4>::from_iterator(joints.iter().map(|angle| angle.to_radians()));
            chain.forward(&joints).translation.vector
        };
        let target = place(&HOME[..4]) + Vector3::new(0.05, 0.1, -0.05);
        let found = Guide::new().towards(&HOME[..4], target.into()).unwrap();
        assert!((place(&found) - target).norm() < 1e-3, "{found:?}");
        assert_eq!(Guide::new().towards(&HOME[..5], target.into()), None);
    }
}
