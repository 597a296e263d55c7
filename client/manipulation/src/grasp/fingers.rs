//! Places of the fingertips while the fingers close, from the kinematics of the hand.

use nalgebra::Point3;
use yarp_devices::hand::gcl::Finger;
use yarp_devices::hand::{FingerJoints, finger_coupling, finger_kinematics};

/// Counts of the spread per degree.
pub(super) const SPREAD_COUNTS: f64 = 17.5;
/// Position of a closed finger, counts.
pub(crate) const FINGER_STOP: i32 = 17_500;
/// Position of fingers spread as far as they go, 180 degrees, counts.
pub(super) const SPREAD_STOP: i32 = 3150;
/// Radius of the outer link with its rubber cover, m.
pub(super) const TIP_RADIUS: f64 = 0.0095;
/// Length of the outer link, m.
const OUTER_LENGTH: f64 = 0.050;

/// The place of a finger in the plane that it closes in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// Distance of the inner side of the outer link from the middle of the hand, m.
    pub(super) inner: f64,
    /// Distance of the middle of the fingertip from the hand's frame along z, m.
    pub(super) depth: f64,
}

/// Returns the joints of a finger for motor positions in counts, with the clutch engaged.
pub(crate) fn finger_joints(counts: f64, spread: f64) -> FingerJoints {
    FingerJoints {
        spread: (spread / SPREAD_COUNTS).to_radians(),
        links: finger_coupling::links(counts, None),
    }
}

/// Link, length along its x axis and radius of the links of a finger that may touch an object, m: the one that spreads, the
/// inner and the outer one.
const LINKS: [(usize, f64, f64); 3] = [
    (0, 0.045, 0.0125),
    (1, 0.070, 0.011),
    (2, OUTER_LENGTH, TIP_RADIUS),
];
/// Number of places along a link that are examined.
const LINK_SAMPLES: u32 = 14;

/// Returns the smallest distance along the finger's plane between its links and an object, m: whose side is this far from
/// the middle of the hand, and whose top is at this depth below the hand's frame. Infinite if no link is so deep.
pub(super) fn side_clearance(counts: f64, side: f64, top: f64) -> f64 {
    let frames = finger_kinematics::link_frames(Finger::F3, &finger_joints(counts, 0.0));
    let mut least = f64::INFINITY;
    for (link, length, radius) in LINKS {
        for sample in 0..=LINK_SAMPLES {
            let along = length * f64::from(sample) / f64::from(LINK_SAMPLES);
            let place = frames[link] * Point3::new(along, 0.0, 0.0);
            if place.z + radius > top {
                least = least.min(place.y - radius - side);
            }
        }
    }
    least
}

/// Returns the place of a finger for a motor position in counts.
pub(super) fn reach(counts: f64) -> Reach {
    let frames = finger_kinematics::link_frames(Finger::F3, &finger_joints(counts, 0.0));
    let tip = frames[2] * Point3::new(OUTER_LENGTH, 0.0, 0.0);
    Reach {
        inner: tip.y - TIP_RADIUS,
        depth: tip.z,
    }
}
