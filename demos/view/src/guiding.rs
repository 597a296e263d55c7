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

/// The arm whose tool is dragged.
#[derive(Debug)]
pub(crate) struct Guide {
    chain: Chain<7>,
}

impl Guide {
    pub(crate) fn new() -> Self {
        Self {
            chain: WamModel::<7>::new().chain,
        }
    }

    /// Returns joint positions inside the limits, degrees, that bring the tool plate from `present` to `place` (m, in the frame of
    /// the base), or as near to it as short steps come. The orientation of the tool is free.
    pub(crate) fn towards(&self, present: &[f64; 7], place: [f64; 3]) -> [f64; 7] {
        let place = Vector3::from(place);
        let start = Joints::<7>::from_iterator(present.iter().map(|angle| angle.to_radians()));
        let mut joints = self.chain.clamp(&start);
        for _ in 0..MAX_STEPS {
            let (pose, jacobian) = self.chain.forward_and_jacobian(&joints);
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
            joints = self
                .chain
                .clamp(&(joints + motion.transpose() * (inverse * step)));
        }
        std::array::from_fn(|joint| joints[joint].to_degrees())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOME: [f64; 7] = [0.0, 40.0, 0.0, 90.0, 0.0, 50.0, 0.0];

    fn place(joints: &[f64; 7]) -> Vector3<f64> {
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
            let found = guide.towards(&HOME, target.into());
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
            let found = guide.towards(&HOME, target);
            let joints = Joints::<7>::from_iterator(found.iter().map(|angle| angle.to_radians()));
            assert!(found.iter().all(|angle| angle.is_finite()), "{found:?}");
            assert!(
                joints.iter().zip(chain.limits()).all(|(angle, limits)| {
                    (limits.min - 1e-9..=limits.max + 1e-9).contains(angle)
                }),
                "{found:?}"
            );
        }
        let far = guide.towards(&HOME, [5.0, 0.0, 0.0]);
        assert!(place(&far).x > place(&HOME).x + 0.2, "{far:?}");
    }
}
