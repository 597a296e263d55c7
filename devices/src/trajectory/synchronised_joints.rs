//! All joints together.

use crate::Limits;
use crate::fake::{MotionState, VelocityProfile};
use crate::kinematics::Joints;

/// Maximum speeds and accelerations of joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits<const N: usize> {
    /// rad/s, each above zero.
    pub speeds: Joints<N>,
    /// rad/s², each above zero.
    pub accelerations: Joints<N>,
}

impl<const N: usize> JointLimits<N> {
    /// The same for each joint: rad/s and rad/s².
    pub fn uniform(speed: f64, acceleration: f64) -> Self {
        Self {
            speeds: Joints::repeat(speed),
            accelerations: Joints::repeat(acceleration),
        }
    }
}

/// A move of all joints that begins and ends at the same time for each.
///
/// At every moment each joint has done the same share of its way, so the joints move on a straight line in joint
/// space; the joint with most to do for its limits decides how long it takes.
///
/// ```
/// use yarp_devices::kinematics::Joints;
/// use yarp_devices::trajectory::{JointLimits, SynchronisedMove};
///
/// let start = Joints::<2>::new(0.0, 1.0);
/// let mut path = SynchronisedMove::new(start, Joints::<2>::new(2.0, 0.0), &JointLimits::uniform(1.0, 1e9));
/// path.advance(1.0);
/// assert!((path.joints() - Joints::<2>::new(1.0, 0.5)).norm() < 1e-6);
/// ```
#[derive(Clone, Debug)]
pub struct SynchronisedMove<const N: usize> {
    start: Joints<N>,
    target: Joints<N>,
    share: VelocityProfile,
}

impl<const N: usize> SynchronisedMove<N> {
    /// The path from rest at `start` to rest at `target`.
    pub fn new(start: Joints<N>, target: Joints<N>, limits: &JointLimits<N>) -> Self {
        let way = (target - start).abs();
        let slowest = |most: &Joints<N>| {
            way.iter()
                .zip(most.iter())
                .filter(|(way, _)| **way > 0.0)
                .map(|(way, most)| most / way)
                .fold(f64::INFINITY, f64::min)
        };
        let (speed, acceleration) = (slowest(&limits.speeds), slowest(&limits.accelerations));
        Self {
            start,
            target,
            share: share(speed, acceleration),
        }
    }

    /// Lets time pass: `seconds`, not negative.
    pub fn advance(&mut self, seconds: f64) {
        self.share.advance(seconds);
    }

    /// Returns the present joint positions.
    pub fn joints(&self) -> Joints<N> {
        if self.is_done() {
            return self.target;
        }
        self.start.lerp(&self.target, self.share.state().position)
    }

    /// Returns whether the joints are at the target.
    pub fn is_done(&self) -> bool {
        self.share.is_done()
    }
}

/// Creates a move from 0 to 1 with at most this speed and acceleration; at once if they are infinite, for there is no
/// distance.
pub(super) fn share(speed: f64, acceleration: f64) -> VelocityProfile {
    if !speed.is_finite() || !acceleration.is_finite() {
        return VelocityProfile::at_rest(1.0);
    }
    VelocityProfile::towards(
        MotionState::default(),
        1.0,
        speed,
        acceleration,
        Limits::new(0.0, 1.0),
    )
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn joints_share_the_time_and_keep_their_limits(
            start in prop::array::uniform7(-3.0..3.0),
            target in prop::array::uniform7(-3.0..3.0),
            speeds in prop::array::uniform7(0.1..2.5),
            accelerations in prop::array::uniform7(0.1..5.0),
        ) {
            let limits = JointLimits::<7> {
                speeds: speeds.into(),
                accelerations: accelerations.into(),
            };
            let (start, target) = (Joints::<7>::from(start), Joints::<7>::from(target));
            let mut path = SynchronisedMove::new(start, target, &limits);
            prop_assert_eq!(path.joints(), start);
            let dt = 0.002;
            let mut velocity = Joints::<7>::zeros();
            let mut fastest = 0.0_f64;
            for _ in 0..200_000 {
                if path.is_done() { break; }
                let before = path.joints();
                path.advance(dt);
                let now = path.joints();
                let next = (now - before) / dt;
                for joint in 0..7 {
                    prop_assert!(next[joint].abs() <= limits.speeds[joint] * (1.0 + 1e-6));
                    let change = (next[joint] - velocity[joint]).abs() / dt;
                    prop_assert!(change <= limits.accelerations[joint] * (1.0 + 1e-6) + 1e-6);
                    fastest = fastest.max(next[joint].abs() / limits.speeds[joint]);
                }
                velocity = next;
                // On the straight line in joint space.
                let way = target - start;
                let done = (now - start).dot(&way) / way.norm_squared();
                prop_assert!((now - start - way * done).norm() < 1e-9);
            }
            prop_assert_eq!(path.joints(), target);
        }
    }

    #[test]
    fn no_way_takes_no_time() {
        let here = Joints::<2>::new(1.0, 2.0);
        let path = SynchronisedMove::new(here, here, &JointLimits::uniform(1.0, 1.0));
        assert!(path.is_done());
        assert_eq!(path.joints(), here);
    }
}
