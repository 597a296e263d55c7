//! Forward and inverse kinematics of a finger.
//!
//! The form is Craig's (modified) one of Denavit and Hartenberg, unlike the arm's:
//! `T(i-1 -> i) = Rx(alpha) Tx(a) Rz(theta) Tz(d)`, from the palm's frame.
//!
//! | row | a | alpha | d | theta |
//! | --- | --- | --- | --- | --- |
//! | 1 | r Aw | 0 | Dw | r spread - j 90° |
//! | 2 | A1 | 90° | 0 | inner + Phi2 |
//! | 3 | A2 | 0 | 0 | outer + Phi3 |
//! | 4 | A3 | -90° | D3 | 0 |
//!
//! r is -1, 1, 0 and j is 1, 1, -1 for F1, F2, F3. All is in metres and **radians**. Source: chapter 9.5 of the manual;
//! the lengths from programs that drive the hand. The sources give Phi3 as 39.6 to 50 degrees; 42 is taken here.
//!
//! The thesis leaves moving the hand "in the Cartesian domain" as future work (chapter 9): this is it.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, Translation3, UnitVector3, Vector2, Vector3};

use super::finger_coupling::{self, INNER_LIMIT, Links, OUTER_LIMIT};
use super::gcl::Finger;

/// The distance of the axes about which F1 and F2 spread from the palm's middle, m.
const PALM_HALF: f64 = 0.025;
/// From the palm's frame to the plane of the inner joints, m.
const PALM_HEIGHT: f64 = 0.076;
/// From the spread's axis to the inner joint, m.
const A1: f64 = 0.050;
/// The inner link, m.
const A2: f64 = 0.070;
/// The outer link along itself, m.
const A3: f64 = 0.050;
/// The fingertip beside the outer link, m.
const D3: f64 = 0.0095;
/// Angle of the inner link when it is open.
const PHI2: f64 = 2.46 * PI / 180.0;
/// Angle of the outer link against the inner one when both are open.
const PHI3: f64 = 42.0 * PI / 180.0;

/// The spread's limit, rad: 180 degrees.
const SPREAD_LIMIT: f64 = PI;

/// The joints of a finger, rad; 0 is open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FingerJoints {
    /// The spread; means nothing to F3.
    pub spread: f64,
    /// The two links.
    pub links: Links,
}

/// Joint positions of a finger for a tip position, and the remaining distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FingerSolution {
    /// The joints, inside their limits.
    pub joints: FingerJoints,
    /// From the tip to the requested point, m.
    pub distance: f64,
}

/// The pose of a finger's tip: z points out of the fingertip's pad side, along the last row of the table.
pub type TipPose = IsometryMatrix3<f64>;

/// Geometry of one finger.
///
/// ```
/// use yarp_devices::hand::{FingerJoints, Links, gcl::Finger, finger_kinematics};
///
/// // Closed until the tips of opposite fingers nearly meet.
/// let links = Links { inner: 90f64.to_radians(), outer: 30f64.to_radians() };
/// let tip = finger_kinematics::tip(Finger::F3, &FingerJoints { spread: 0.0, links });
/// assert!((tip.translation.vector.z - 0.1502).abs() < 1e-4);
/// ```
pub fn tip(finger: Finger, joints: &FingerJoints) -> TipPose {
    let (_, _, outer) = frames(finger, joints);
    outer * row(A3, -FRAC_PI_2, D3, 0.0)
}

/// Returns the frames of the finger's three links in the palm's frame: the one that spreads, the inner and the outer one.
///
/// The x axis of the inner and of the outer frame is along the link, away from its joint, which is the origin.
pub fn link_frames(finger: Finger, joints: &FingerJoints) -> [TipPose; 3] {
    let (spread, inner, outer) = frames(finger, joints);
    [spread, inner, outer]
}

/// The place of the outer joint in the palm's frame, m.
pub fn outer_joint(finger: Finger, joints: &FingerJoints) -> Vector3<f64> {
    frames(finger, joints).2.translation.vector
}

/// Returns the Jacobian of the tip with respect to spread, inner and outer joint, m per rad; a column each.
pub fn jacobian(finger: Finger, joints: &FingerJoints) -> Matrix3<f64> {
    let (spread, inner, outer) = frames(finger, joints);
    let tip = tip(finger, joints).translation.vector;
    let column = |frame: &TipPose, direction: f64| {
        let axis = frame.rotation * Vector3::z() * direction;
        axis.cross(&(tip - frame.translation.vector))
    };
    Matrix3::from_columns(&[
        column(&spread, sides(finger).0),
        column(&inner, 1.0),
        column(&outer, 1.0),
    ])
}

/// Computes the joints that bring the tip to `point`, with the clutch released if needed.
///
/// In closed form. If the point cannot be reached, the nearest of the configurations inside the limits.
pub fn inverse(finger: Finger, point: &Vector3<f64>) -> FingerSolution {
    nearest(finger, point, |reach, height| {
        let elbows = elbows(reach, height);
        elbows.into_iter().map(|links| {
            let inner = links.inner.clamp(0.0, INNER_LIMIT);
            // The motor cannot open the outer link further than the inner one turns it.
            let outer = links
                .outer
                .clamp(inner * finger_coupling::RATIO, OUTER_LIMIT);
            Links { inner, outer }
        })
    })
}

/// Computes the joints that bring the tip nearest to `point` with the clutch engaged.
///
/// The tip then moves on a surface, so most points are only neared.
pub fn inverse_engaged(finger: Finger, point: &Vector3<f64>) -> FingerSolution {
    nearest(finger, point, |reach, height| {
        let target = Vector2::new(reach, height);
        let at = |inner: f64| (planar(engaged(inner)) - target).norm_squared();
        [engaged(minimum(at, INNER_LIMIT))]
    })
}

fn engaged(inner: f64) -> Links {
    Links {
        inner,
        outer: inner * finger_coupling::RATIO,
    }
}

/// Tries both ways of turning the finger's plane through the point, and takes the nearer.
fn nearest<L: IntoIterator<Item = Links>>(
    finger: Finger,
    point: &Vector3<f64>,
    in_plane: impl Fn(f64, f64) -> L,
) -> FingerSolution {
    let (side, turn) = sides(finger);
    let across = Vector2::new(point.x - side * PALM_HALF, point.y);
    let height = point.z - PALM_HEIGHT;
    let direction = across.y.atan2(across.x);
    let spreads: &[f64] = match finger {
        Finger::F3 => &[0.0],
        // The tip may also be behind the axis.
        _ => &[0.0, PI],
    };
    spreads
        .iter()
        .flat_map(|behind| {
            let spread = match finger {
                Finger::F3 => 0.0,
                _ => within_spread(side * (direction + behind + turn * FRAC_PI_2)),
            };
            let heading = side * spread - turn * FRAC_PI_2;
            let reach = across.dot(&Vector2::new(heading.cos(), heading.sin()));
            in_plane(reach, height)
                .into_iter()
                .map(move |links| FingerJoints { spread, links })
        })
        .map(|joints| FingerSolution {
            joints,
            distance: (tip(finger, &joints).translation.vector - point).norm(),
        })
        .min_by(|one, other| one.distance.total_cmp(&other.distance))
        .expect("there is at least one way to stand")
}

/// The tip in the finger's own plane: away from the spread's axis, and above the inner joint.
fn planar(links: Links) -> Vector2<f64> {
    let inner = links.inner + PHI2;
    let outer = inner + links.outer + PHI3;
    let along = Vector2::new(outer.cos(), outer.sin());
    let beside = Vector2::new(-along.y, along.x);
    Vector2::new(A1 + A2 * inner.cos(), A2 * inner.sin()) + along * A3 + beside * D3
}

/// Returns both solutions of two links for a point of the plane; the nearest stretched one if it is too far.
fn elbows(reach: f64, height: f64) -> [Links; 2] {
    let (x, y) = (reach - A1, height);
    let length = A3.hypot(D3);
    let lean = D3.atan2(A3);
    let cosine = (x * x + y * y - A2 * A2 - length * length) / (2.0 * A2 * length);
    let bend = cosine.clamp(-1.0, 1.0).acos();
    [bend, -bend].map(|bend| {
        let inner = y.atan2(x) - (length * bend.sin()).atan2(A2 + length * bend.cos());
        Links {
            inner: turned(inner - PHI2),
            outer: turned(bend - lean - PHI3),
        }
    })
}

/// Returns the position of the minimum of a smooth function from 0 to `end`: samples, then golden sections.
fn minimum(value: impl Fn(f64) -> f64, end: f64) -> f64 {
    const SAMPLES: usize = 64;
    const SECTIONS: usize = 60;
    let step = end / SAMPLES as f64;
    let best = (0..=SAMPLES)
        .map(|sample| sample as f64 * step)
        .min_by(|one, other| value(*one).total_cmp(&value(*other)))
        .expect("there are samples");
    let (mut low, mut high) = ((best - step).max(0.0), (best + step).min(end));
    let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
    for _ in 0..SECTIONS {
        let left = high - golden * (high - low);
        let right = low + golden * (high - low);
        if value(left) < value(right) {
            high = right;
        } else {
            low = left;
        }
    }
    let middle = (low + high) / 2.0;
    // At an end the minimum is no valley.
    [0.0, end, middle]
        .into_iter()
        .min_by(|one, other| value(*one).total_cmp(&value(*other)))
        .expect("there are three")
}

/// The nearest angle to which the fingers spread.
fn within_spread(angle: f64) -> f64 {
    let angle = angle.rem_euclid(2.0 * PI);
    if angle <= SPREAD_LIMIT {
        angle
    } else if angle - SPREAD_LIMIT < 2.0 * PI - angle {
        SPREAD_LIMIT
    } else {
        0.0
    }
}

/// The same angle from -180 to 180 degrees.
fn turned(angle: f64) -> f64 {
    (angle + PI).rem_euclid(2.0 * PI) - PI
}

/// r and j of the table.
fn sides(finger: Finger) -> (f64, f64) {
    match finger {
        Finger::F1 => (-1.0, 1.0),
        Finger::F2 => (1.0, 1.0),
        Finger::F3 => (0.0, -1.0),
    }
}

/// The frames that turn with the spread, the inner and the outer joint.
fn frames(finger: Finger, joints: &FingerJoints) -> (TipPose, TipPose, TipPose) {
    let (side, turn) = sides(finger);
    let heading = side * joints.spread - turn * FRAC_PI_2;
    let spread = row(side * PALM_HALF, 0.0, PALM_HEIGHT, heading);
    let inner = spread * row(A1, FRAC_PI_2, 0.0, joints.links.inner + PHI2);
    let outer = inner * row(A2, 0.0, 0.0, joints.links.outer + PHI3);
    (spread, inner, outer)
}

/// `Rx(alpha) Tx(a) Rz(theta) Tz(d)`.
fn row(a: f64, alpha: f64, d: f64, theta: f64) -> TipPose {
    let about = |axis: UnitVector3<f64>, angle| Rotation3::from_axis_angle(&axis, angle);
    let twist = TipPose::from_parts(Translation3::identity(), about(Vector3::x_axis(), alpha));
    let turn = TipPose::from_parts(
        Translation3::new(a, 0.0, 0.0),
        about(Vector3::z_axis(), theta),
    );
    twist * turn * Translation3::new(0.0, 0.0, d)
}
