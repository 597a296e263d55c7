//! Checks of a whole motion, without gaps.

use yarp_devices::kinematics::Joints;

use super::CollisionModel;
use super::collision_model::Travels;

/// Smallest part of a motion that a check advances by.
///
/// A motion that grazes an obstacle at exactly the margin would otherwise need infinitely many steps. Within such a step no
/// sphere moves farther than `MIN_TRAVEL / 2` into the margin.
const MIN_TRAVEL: f64 = 0.004;

impl CollisionModel {
    /// Returns whether the straight motion between two postures collides with nothing and stays within the joint limits.
    ///
    /// The check is continuous: between two examined postures, no sphere can come closer to anything than the margin less
    /// 2 mm.
    pub fn is_motion_free(&self, from: &Joints<7>, to: &Joints<7>) -> bool {
        if !self.chain.contains(from) || !self.chain.contains(to) {
            return false;
        }
        let travels = self.travels(from, to);
        if travels.iter().all(|travel| *travel == 0.0) {
            return self.is_free(from);
        }
        // The end is often close to something, and the bisection would come to it last.
        self.is_free(to) && self.interval_is_free(from, to, &travels, 0.0, 1.0)
    }

    /// Bisects the motion until each part is proven free by the clearance at its middle.
    fn interval_is_free(
        &self,
        from: &Joints<7>,
        to: &Joints<7>,
        travels: &Travels,
        begin: f64,
        end: f64,
    ) -> bool {
        let middle = (begin + end) / 2.0;
        let half = (end - begin) / 2.0;
        // Joints below both of two links move them as one, so two spheres approach each other no faster than one can move.
        let free = self.free_fraction(&from.lerp(to, middle), travels, half);
        if free < 0.0 {
            return false;
        }
        let fastest = travels.iter().copied().fold(0.0, f64::max);
        // What is already proven around the middle.
        let proven = free.max(MIN_TRAVEL / 2.0 / fastest);
        if proven >= half {
            return true;
        }
        self.interval_is_free(from, to, travels, begin, middle - proven)
            && self.interval_is_free(from, to, travels, middle + proven, end)
    }
}
