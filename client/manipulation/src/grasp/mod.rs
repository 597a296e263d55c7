//! Grasps from above, per shape.
//!
//! The hand points down. With the frame of the object as in section 6.3.3 of the thesis (y along its longest side, z up) the
//! hand's x goes on the object's y and z points down: rows of `R_g` are (0 1 0), (1 0 0), (0 0 -1). F3 comes to the middle
//! of the longest side.
//!
//! | shape | spread | fingers |
//! | --- | --- | --- |
//! | cuboid | 0 | F3 opposite F1 and F2, across the shorter side |
//! | prism | 0 to 650 counts, by its side | one finger in the middle of each side |
//! | prism beside another object | 0 | F1 and F2 on one side, F3 on the edge opposite |
//! | cylinder | 300 to 850 counts, by its radius | three fingers touch at equal angles |
//!
//! F1 and F2 turn about axes 25 mm beside the middle of the hand. With a spread, the middle of the object is therefore not in
//! the middle of the hand, so that all fingers touch it at the same time.
//!
//! `fingers` has the kinematics, `scripts` the grasps that an object database lists.

mod fingers;
mod scripts;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Matrix3, Rotation3, Vector3};
use yarp_devices::hand::FingerJoints;
use yarp_devices::kinematics::Pose;

use crate::item::{Item, ItemShape};

pub(crate) use fingers::finger_joints;
use fingers::{FINGER_STOP, Reach, SPREAD_COUNTS, TIP_RADIUS, reach, side_clearance};
pub use scripts::{GraspScripts, ScriptError};

/// Angle between the place that F1 touches and the one opposite F3, when the fingers are equally far from each other, rad.
const EQUAL_ANGLE: f64 = std::f64::consts::FRAC_PI_3;
/// Motion of the fingers after the first contact, until all of them press, counts.
const SQUEEZE: i32 = 350;
/// Distance of the axes about which F1 and F2 spread from the middle of the hand, m.
const PALM_HALF: f64 = 0.025;
/// Smallest distance of the middles of F1 and F2 from the ends of a side that both press on, m.
const SIDE_END: f64 = 0.004;
/// Number of directions that are tried around a cylinder.
const DIRECTIONS: u32 = 12;
/// Height of the palm's face above the frame of the hand, with the roundness of the palm, m.
const PALM_DEPTH: f64 = 0.078;

/// Height of an object from which on the fingertips keep more distance from the table, and how much more, m.
const HIGH: f64 = 0.04;
const HIGH_CLEARANCE: f64 = 0.006;

/// Smallest distance of the open fingers from the side of an object, m, and the part of the object that their inner links may
/// overlap at the contact, which is that of the tips.
const KNUCKLE_CLEARANCE: f64 = 0.005;
const CONTACT_TOLERANCE: f64 = 0.001;
/// Step by which the hand is raised until its fingers are clear of the object, m.
const HEIGHT_STEP: f64 = 0.002;

/// Further opening of the fingers at a release, counts.
const RELEASE_COUNTS: i32 = 800;

/// Options of grasps.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct GraspOptions {
    /// Height of the table's surface, m.
    pub surface: f64,
    /// Distance of the fingertips from the table at their lowest point, m; 2 mm by default. For objects that are high enough
    /// it is 8 mm: a heavy one pulls the arm down while it is squeezed.
    pub table_clearance: f64,
    /// Distance of the palm from the top of the object, m; 12 mm by default.
    pub palm_clearance: f64,
    /// Distance between the open fingertips and the object, m; 18 mm by default.
    pub opening: f64,
}

impl Default for GraspOptions {
    fn default() -> Self {
        Self {
            surface: -0.05,
            table_clearance: 0.002,
            palm_clearance: 0.012,
            opening: 0.018,
        }
    }
}

/// A grasp: the pose of the hand, and the commands of its motors.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// Pose of the hand's frame while it grasps.
    pub hand: Pose,
    /// Spread of F1 and F2, counts.
    pub spread: i32,
    /// Position of the fingers before the grasp, counts.
    pub open: i32,
    /// Position of the fingers where they touch the object, counts.
    pub contact: i32,
    /// Distance of the lowest fingertip from the hand's frame along z while the fingers close, m.
    pub depth: f64,
}

impl Grasp {
    /// Returns the joints of the fingers while they are open for the grasp.
    pub fn fingers(&self) -> [FingerJoints; 3] {
        [finger_joints(f64::from(self.open), f64::from(self.spread)); 3]
    }

    /// Returns the position of the fingers after a release, counts: a little wider than before the grasp.
    pub(crate) fn released(&self) -> i32 {
        (self.open - RELEASE_COUNTS).max(0)
    }
}

/// Returns the grasps of an object, the preferred ones first; none if it does not fit into the hand.
pub fn grasps(item: &Item, options: &GraspOptions) -> Vec<Grasp> {
    let yaw = item.yaw();
    // Directions of F3 seen from the object's middle, and how the fingers meet the object.
    let mut wanted: Vec<(f64, Meeting)> = Vec::new();
    match item.shape {
        ItemShape::Cuboid { size } => {
            for (turn, half) in [
                (0.0, size[0] / 2.0),
                (PI, size[0] / 2.0),
                (FRAC_PI_2, size[1] / 2.0),
                (-FRAC_PI_2, size[1] / 2.0),
            ] {
                wanted.push((yaw + turn, Meeting::opposed(half)));
            }
        }
        ItemShape::Prism { side, .. } => {
            // Each side is this far from the middle; the first one is at negative x.
            let apothem = side / (2.0 * 3.0_f64.sqrt());
            let directions = (0..3).map(|side| yaw + PI + TAU * f64::from(side) / 3.0);
            for direction in directions.clone() {
                wanted.push((direction, Meeting::of_circle(apothem)));
            }
            // One finger in the middle of each side has no room beside another object.
            if side / 2.0 >= PALM_HALF + SIDE_END {
                for direction in directions {
                    wanted.push((direction + PI, Meeting::side_and_edge(apothem)));
                }
            }
        }
        ItemShape::Cylinder { radius, .. } => {
            for step in 0..DIRECTIONS {
                let direction = TAU * f64::from(step) / f64::from(DIRECTIONS);
                wanted.push((direction, Meeting::of_circle(radius)));
            }
        }
    }
    wanted
        .into_iter()
        .filter_map(|(direction, meeting)| grasp(item, options, direction, meeting))
        .collect()
}

/// Contact of three fingers with an object.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    /// Distance of the fingers' inner sides from their own axes in the middle of the hand, m.
    inner: f64,
    /// Place of the object's middle along the hand's y axis, m.
    shift: f64,
    /// Spread, counts.
    spread: i32,
}

impl Meeting {
    /// F3 opposite F1 and F2, which press on parallel sides.
    fn opposed(half: f64) -> Self {
        Self {
            inner: half,
            shift: 0.0,
            spread: 0,
        }
    }

    /// F1 and F2 on one side of a prism, F3 on the edge opposite, which is twice as far from the middle as the side.
    fn side_and_edge(apothem: f64) -> Self {
        Self {
            inner: 1.5 * apothem,
            shift: -0.5 * apothem,
            spread: 0,
        }
    }

    /// All fingers touch a circle at equal angles: a cylinder, or the circle inside a triangle.
    ///
    /// With `D` the distance of a fingertip's middle from that of the circle, `ρ` from its finger's axis and `s` the spread:
    /// `PALM_HALF + ρ sin(s) = D sin(60°)` and `ρ (1 + cos(s)) = 1.5 D`.
    fn of_circle(radius: f64) -> Self {
        let distance = radius + TIP_RADIUS;
        let aside = (distance * EQUAL_ANGLE.sin() - PALM_HALF).max(0.0);
        let spread = 2.0 * (aside / (1.5 * distance)).atan();
        let tip = 1.5 * distance / (1.0 + spread.cos());
        Self {
            inner: tip - TIP_RADIUS,
            shift: tip - distance,
            spread: (spread.to_degrees() * SPREAD_COUNTS).round() as i32,
        }
    }
}

/// Returns the grasp with F3 on this side of an object.
fn grasp(item: &Item, options: &GraspOptions, direction: f64, meeting: Meeting) -> Option<Grasp> {
    let contact = counts_at(meeting.inner)?;
    let open = counts_at(meeting.inner + options.opening);
    let open = open.unwrap_or(0).min(contact);
    let surface = options.surface;
    // The tips go down while the fingers close; the palm stays above the object.
    let lowest = deepest(open, contact + SQUEEZE) + TIP_RADIUS;
    let more = match item.shape.height() >= HIGH {
        true => HIGH_CLEARANCE,
        false => 0.0,
    };
    let by_tips = surface + options.table_clearance + more + lowest;
    let by_palm = item.top() + options.palm_clearance + PALM_DEPTH;
    let mut height = by_tips.max(by_palm);
    // Knuckles that come down on the edge of a wide object block the arm, or press it down while the fingers close.
    let is_free = |height: f64| {
        let clearance =
            |counts: i32| side_clearance(f64::from(counts), meeting.inner, height - item.top());
        clearance(open) >= KNUCKLE_CLEARANCE && clearance(contact) >= -CONTACT_TOLERANCE
    };
    while !is_free(height) {
        height += HEIGHT_STEP;
        if height > item.top() + lowest {
            return None;
        }
    }
    // The tips must touch the object, not the air above it.
    let tip = height - reach(f64::from(contact)).depth;
    if tip > item.top() {
        return None;
    }
    let middle = item.pose.translation.vector;
    let (sine, cosine) = direction.sin_cos();
    let place = Vector3::new(
        middle.x - meeting.shift * cosine,
        middle.y - meeting.shift * sine,
        height,
    );
    Some(Grasp {
        hand: hand_pose(place, direction),
        spread: meeting.spread,
        open,
        contact,
        depth: lowest,
    })
}

/// Returns the pose of a hand that looks down, with F3 in this direction.
fn hand_pose(place: Vector3<f64>, direction: f64) -> Pose {
    let (sine, cosine) = direction.sin_cos();
    // Columns: x, y and z of the hand.
    let rotation = Matrix3::new(-sine, cosine, 0.0, cosine, sine, 0.0, 0.0, 0.0, -1.0);
    Pose::from_parts(place.into(), Rotation3::from_matrix_unchecked(rotation))
}

/// Returns the largest distance of a fingertip from the hand's frame along z while the fingers close, m.
fn deepest(open: i32, contact: i32) -> f64 {
    let steps = 20;
    let counts = |step: i32| f64::from(open + (contact - open) * step / steps);
    let depths = (0..=steps).map(|step| reach(counts(step)).depth);
    depths.fold(0.0, f64::max)
}

/// Returns the position of the fingers at which their inner side is this far from the middle, counts.
fn counts_at(half: f64) -> Option<i32> {
    let inner = |counts: i32| {
        let Reach { inner, .. } = reach(f64::from(counts));
        inner
    };
    if inner(0) < half {
        return None;
    }
    let (mut low, mut high) = (0, FINGER_STOP);
    while high - low > 10 {
        let middle = (low + high) / 2;
        match inner(middle) >= half {
            true => low = middle,
            false => high = middle,
        }
    }
    Some(low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::item::Class;

    fn item(shape: ItemShape, yaw: f64) -> Item {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        let place = Vector3::new(0.5, 0.1, -0.05 + shape.height() / 2.0);
        Item {
            id: 1,
            label: "test".into(),
            class: Class::Polygon,
            shape,
            pose: Pose::from_parts(place.into(), turn),
        }
    }

    #[test]
    fn the_first_grasp_of_a_box_is_that_of_the_thesis() {
        let cuboid = item(
            ItemShape::Cuboid {
                size: [0.05, 0.10, 0.08],
            },
            0.4,
        );
        let first = &grasps(&cuboid, &GraspOptions::default())[0];
        let expected = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        let relative = cuboid.pose.rotation.inverse() * first.hand.rotation;
        assert!((relative.matrix() - expected).norm() < 1e-9, "{relative}");
        assert_eq!(first.spread, 0);
        assert!(first.open < first.contact);
    }

    #[test]
    fn fingertips_stay_above_the_table() {
        for (height, clearance) in [(0.03, 0.002), (0.063, 0.008)] {
            let size = [0.06, 0.09, height];
            let item = item(ItemShape::Cuboid { size }, 0.0);
            let grasp = &grasps(&item, &GraspOptions::default())[0];
            let lowest = grasp.hand.translation.z - grasp.depth + 0.05;
            assert!((lowest - clearance).abs() < 1e-9, "{height}: {lowest}");
        }
    }

    /// The inner links of the fingers came down on the edges of wide boxes, and the arm stopped.
    #[test]
    fn knuckles_are_beside_wide_objects_and_tips_below_their_tops() {
        let options = GraspOptions::default();
        for width in [0.04, 0.06, 0.08, 0.10] {
            for height in [0.03, 0.06, 0.11] {
                let size = [width, width + 0.01, height];
                let item = item(ItemShape::Cuboid { size }, 0.0);
                for grasp in grasps(&item, &options) {
                    let hand = grasp.hand.translation.z;
                    for counts in [grasp.open, grasp.contact] {
                        let joints = finger_joints(f64::from(counts), 0.0);
                        let frames = yarp_devices::hand::finger_kinematics::link_frames(
                            yarp_devices::hand::gcl::Finger::F3,
                            &joints,
                        );
                        // The inner link's middle line, where it is below the top of the object.
                        for along in [0.0, 0.02, 0.04, 0.06, 0.07] {
                            let place = frames[1] * nalgebra::Point3::new(along, 0.0, 0.0);
                            let is_below = hand - place.z - 0.010 < item.top();
                            let beside = place.y - 0.010 - width / 2.0;
                            assert!(!is_below || beside > -0.002, "{size:?}: {beside}");
                        }
                    }
                    let tip = hand - reach(f64::from(grasp.contact)).depth;
                    assert!(tip < item.top(), "{size:?}");
                }
            }
        }
    }

    /// F1 and F2 are 25 mm beside the middle of the hand.
    #[test]
    fn a_prism_is_held_by_a_side_and_the_edge_opposite() {
        let of_side = |side: f64| {
            let shape = ItemShape::Prism { side, height: 0.06 };
            (
                item(shape, 0.3),
                grasps(&item(shape, 0.3), &GraspOptions::default()),
            )
        };
        assert_eq!(of_side(0.056).1.len(), 3, "F1 and F2 beside the side");
        let (prism, all) = of_side(0.09);
        for grasp in &all[3..] {
            assert_eq!(grasp.spread, 0);
            let inner = reach(f64::from(grasp.contact)).inner;
            let touched = |aside: f64, along: f64| {
                let place = grasp.hand * nalgebra::Point3::new(aside, along, 0.0);
                prism.pose.inverse() * place
            };
            // From the middle of a triangle it is as far to its sides as half of the way to its corners.
            let apothem = 0.09 / (2.0 * 3.0_f64.sqrt());
            let edge = touched(0.0, inner);
            assert!(
                (edge.x.hypot(edge.y) - 2.0 * apothem).abs() < 1e-3,
                "{edge}"
            );
            for aside in [-PALM_HALF, PALM_HALF] {
                let on_side = touched(aside, -inner);
                let normal = -edge.coords.xy().normalize();
                assert!(
                    (on_side.coords.xy().dot(&normal) - apothem).abs() < 1e-3,
                    "{on_side}"
                );
            }
        }
    }

    #[test]
    fn every_shape_of_the_table_has_grasps_and_a_wide_one_has_none() {
        let count = |shape| grasps(&item(shape, 0.2), &GraspOptions::default()).len();
        assert_eq!(
            count(ItemShape::Cuboid {
                size: [0.04, 0.05, 0.03]
            }),
            4
        );
        assert_eq!(
            count(ItemShape::Prism {
                side: 0.06,
                height: 0.04
            }),
            6
        );
        for (radius, height) in [(0.03, 0.08), (0.0425, 0.15), (0.1, 0.015), (0.09, 0.025)] {
            assert_eq!(
                count(ItemShape::Cylinder { radius, height }),
                12,
                "{radius}"
            );
        }
        assert_eq!(
            count(ItemShape::Cylinder {
                radius: 0.2,
                height: 0.02
            }),
            0
        );
    }
}
