//! Posture of arm and hand: solids for rendering and contact, and a frame for each moving part.
//!
//! Parts are counted: 0 is the base, 1 to 7 the links of the arm, then three per finger (the one that spreads, inner, outer).
//! The hand's frame is the tool plate, frame 7: owd has the inner joints 0.135 m beyond the wrist, which is the
//! 0.0609 m of the plate and the 0.076 m of the hand.

use nalgebra::Point3;
use yarp_devices::hand::gcl::Finger;
use yarp_devices::hand::{FingerJoints, Links, finger_kinematics};
use yarp_devices::kinematics::{Chain, Joints};

use crate::Pose;

/// Number of parts.
pub const PARTS: usize = 17;
/// Part to which the palm belongs: link 7.
pub const PALM: usize = 7;

/// The first of the parts of a finger.
const fn finger_part(finger: usize) -> usize {
    8 + 3 * finger
}

/// Posture of the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandPosture {
    /// Of F1 and F2, rad; 0 is opposite F3.
    pub spread: f64,
    /// Inner and outer joint of F1, F2 and F3, rad.
    pub fingers: [Links; 3],
}

/// Posture of arm and hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotPosture {
    /// Joint angles, rad.
    pub joints: Joints<7>,
    /// The hand, if one is mounted.
    pub hand: Option<HandPosture>,
}

/// A solid of the robot in the frame of its part: a cylinder with round ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotSolid {
    /// To which it belongs.
    pub part: usize,
    /// Middle of one round end, m.
    pub from: Point3<f64>,
    /// Middle of the other.
    pub to: Point3<f64>,
    /// m.
    pub radius: f64,
}

const fn solid(part: usize, from: [f64; 3], to: [f64; 3], radius: f64) -> RobotSolid {
    RobotSolid {
        part,
        from: Point3::new(from[0], from[1], from[2]),
        to: Point3::new(to[0], to[1], to[2]),
        radius,
    }
}

/// Solids of the arm. Axes and lengths are those of the DH table; radii are estimated from pictures of the arm.
const ARM: [RobotSolid; 9] = [
    // The base stands 0.346 m below the shoulder.
    solid(0, [0.0, 0.0, -0.22], [0.0, 0.0, -0.17], 0.12),
    // MotorSet on both sides of the shoulder's pitch axis, which is z of frame 1.
    solid(1, [0.0, 0.0, -0.09], [0.0, 0.0, 0.09], 0.10),
    // Upper arm: frame 3 is at the elbow, the shoulder at (-0.045, 0.55, 0).
    solid(3, [-0.045, 0.50, 0.0], [-0.045, 0.08, 0.0], 0.060),
    // Elbow, whose axis is z of frame 3.
    solid(3, [0.0, 0.0, -0.035], [0.0, 0.0, 0.035], 0.055),
    // Forearm: along z of frame 4.
    solid(4, [0.0, 0.0, 0.04], [0.0, 0.0, 0.25], 0.048),
    // Wrist: axis 6 is z of frame 5.
    solid(5, [0.0, 0.0, -0.03], [0.0, 0.0, 0.03], 0.045),
    solid(6, [0.0, 0.0, 0.0], [0.0, 0.0, 0.035], 0.043),
    // Palm: 0.077 m from the tool plate to its face.
    solid(PALM, [0.0, -0.018, 0.030], [0.0, -0.018, 0.038], 0.038),
    solid(PALM, [0.0, 0.018, 0.030], [0.0, 0.018, 0.038], 0.038),
];

/// Solids of a finger in the frames of its three links; lengths from the hand's DH table, radii estimated.
const FINGER: [RobotSolid; 3] = [
    solid(0, [0.005, 0.0, -0.012], [0.045, 0.0, 0.0], 0.012),
    solid(1, [0.0, 0.0, 0.0], [0.070, 0.0, 0.0], 0.0105),
    // The tip's pad is 9.5 mm beside the link's axis, as in row 4.
    solid(2, [0.0, 0.0, 0.0], [0.050, 0.0, 0.0], 0.0095),
];

/// Returns all solids; those of the hand only `with_hand`.
pub fn solids(with_hand: bool) -> Vec<RobotSolid> {
    let mut all: Vec<RobotSolid> = ARM
        .into_iter()
        .filter(|solid| with_hand || solid.part != PALM)
        .collect();
    if with_hand {
        for finger in 0..3 {
            let part = |solid: RobotSolid| RobotSolid {
                part: finger_part(finger) + solid.part,
                ..solid
            };
            all.extend(FINGER.map(part));
        }
    }
    all
}

/// Returns the frame of each part in the arm's base frame. Without a hand its parts are at the tool plate.
pub fn frames(chain: &Chain<7>, posture: &RobotPosture) -> [Pose; PARTS] {
    let links = chain.frames(&posture.joints);
    let mut all = [Pose::identity(); PARTS];
    all[1..=PALM].copy_from_slice(&links);
    let palm = links[PALM - 1];
    let hand = posture.hand.unwrap_or_default();
    for (index, finger) in Finger::ALL.into_iter().enumerate() {
        let joints = FingerJoints {
            spread: hand.spread,
            links: hand.fingers[index],
        };
        let local = finger_kinematics::link_frames(finger, &joints);
        for (link, frame) in local.into_iter().enumerate() {
            all[finger_part(index) + link] = palm * frame;
        }
    }
    all
}

/// Returns the finger (0 to 2) and link (0 spreads, 1 inner, 2 outer) of a part; `None` for parts of the arm.
pub const fn finger_of(part: usize) -> Option<(usize, usize)> {
    match part.checked_sub(8) {
        Some(beyond) if part < PARTS => Some((beyond / 3, beyond % 3)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use yarp_devices::wam::WamModel;

    use super::*;

    #[test]
    fn fingertips_are_where_the_kinematics_of_the_hand_say() {
        let chain = WamModel::<7>::new().chain;
        let posture = RobotPosture {
            joints: Joints::<7>::zeros(),
            hand: Some(HandPosture::default()),
        };
        let frames = frames(&chain, &posture);
        // Upright arm: the plate is at 0.9109; barretthand.md: the tip of F3 at (0, 0.1490, 0.1208) of the palm.
        let tip = frames[16] * Point3::new(0.050, 0.0095, 0.0);
        let expected = Point3::new(0.0, 0.1490, 0.9109 + 0.1208);
        assert!((tip - expected).norm() < 1e-4, "{tip}");
        assert_eq!(finger_of(16), Some((2, 2)));
        assert_eq!(finger_of(7), None);
        // The elbow and the shoulder of the upper arm's solid.
        let upper = ARM[2];
        assert!((frames[3] * upper.from).xy().coords.norm() < 1e-9);
    }
}
