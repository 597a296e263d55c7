//! Outlines of faces in the plane of the table: circles, rectangles, triangles through measured points.

use nalgebra::{Matrix2, Matrix3, Vector3};
use opencv::core::{Point2f, RotatedRect, Vector};
use opencv::imgproc;

use super::height_map::Face;
use crate::circle_fit::{circle_through, mean};
use crate::object_shape::polygon_area;

/// Directions from the middle of a face in which its farthest point is looked for.
const DIRECTIONS: usize = 72;
/// Largest distance of a point from its circle, m.
const CIRCLE_REACH: f64 = 0.0018;
/// Smallest share of the rim in sight of a round face that lies on its circle, and of one of which a part is hidden.
const MIN_CIRCLE: f64 = 0.7;
const MIN_ARC: f64 = 0.8;
/// Fewest points of the rim in sight of a circle, and of one of which a part is hidden.
const MIN_CIRCLE_RIM: usize = DIRECTIONS / 3;
const MIN_ARC_RIM: usize = DIRECTIONS / 6;
/// Least deviation of a point of the rim from its circle, m: pixels of the depth image are 1.7 mm apart.
const RIM_NOISE: f64 = 0.0005;
/// Circles through three points that are tried.
const TRIALS: usize = 120;
/// OpenCV's outlines have single precision: they are computed in mm about the middle of the face.
const MILLIMETRE: f64 = 1e-3;

/// An outline, m.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Outline {
    Circle {
        centre: [f64; 2],
        radius: f64,
    },
    /// Three or four corners in order.
    Polygon(Vec<[f64; 2]>),
}

impl Outline {
    /// Returns the centre of a circle, or the mean of the corners.
    pub(super) fn centre(&self) -> [f64; 2] {
        match self {
            Self::Circle { centre, .. } => *centre,
            Self::Polygon(corners) => mean(corners),
        }
    }

    /// Returns the standard deviation of the centre of a circle through the rim in sight, m, in the direction in which it is
    /// known least: large for short arcs, infinite for points on a line. `None` for polygons.
    pub(super) fn centre_uncertainty(&self, rim: &[RimPoint]) -> Option<f64> {
        let Self::Circle { centre, radius } = self else {
            return None;
        };
        // Derivatives of a point's distance from the circle by centre and radius.
        let (mut normal, mut squares, mut count) = (Matrix3::zeros(), 0.0, 0.0);
        for [x, y] in in_sight(rim) {
            let [x, y] = [x - centre[0], y - centre[1]];
            let distance = x.hypot(y);
            if (distance - radius).abs() < CIRCLE_REACH {
                let row = Vector3::new(x / distance.max(1e-9), y / distance.max(1e-9), 1.0);
                normal += row * row.transpose();
                squares += (distance - radius) * (distance - radius);
                count += 1.0;
            }
        }
        let Some(inverse) = normal.try_inverse() else {
            return Some(f64::INFINITY);
        };
        let noise = (squares / f64::max(count, 1.0)).sqrt().max(RIM_NOISE);
        let covariance: Matrix2<f64> = inverse.fixed_view::<2, 2>(0, 0).into_owned();
        Some(noise * covariance.symmetric_eigenvalues().max().max(0.0).sqrt())
    }
}

/// The farthest point of a face in some direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct RimPoint {
    pub(super) point: [f64; 2],
    /// True if something nearer may hide more of the face beyond it.
    pub(super) hidden: bool,
}

/// Returns the outline that fits a face best, with the share of it that the points agree with, 0 to 1.
pub(super) fn fit(face: &Face, rim: &[RimPoint]) -> opencv::Result<Option<(Outline, f64)>> {
    let points = &face.points;
    if points.len() < 3 {
        return Ok(None);
    }
    let middle = mean(points);
    let rim = in_sight(rim);
    if rim.len() >= MIN_CIRCLE_RIM
        && let Some((outline, share)) = circle(&rim)
        && share >= MIN_CIRCLE
    {
        return Ok(Some((outline, share)));
    }
    let local = |point: &[f64; 2]| {
        let [x, y] = [0, 1].map(|axis| ((point[axis] - middle[axis]) / MILLIMETRE) as f32);
        Point2f::new(x, y)
    };
    let back = |point: Point2f| {
        [
            middle[0] + f64::from(point.x) * MILLIMETRE,
            middle[1] + f64::from(point.y) * MILLIMETRE,
        ]
    };
    let all: Vector<Point2f> = points.iter().map(local).collect();
    let mut hull: Vector<Point2f> = Vector::new();
    imgproc::convex_hull_def(&all, &mut hull)?;
    if hull.len() < 3 {
        return Ok(None);
    }
    let area = imgproc::contour_area_def(&hull)? * MILLIMETRE * MILLIMETRE;
    let around: RotatedRect = imgproc::min_area_rect(&hull)?;
    let mut corners = [Point2f::default(); 4];
    around.points(&mut corners)?;
    let rectangle = corners.map(back).to_vec();
    let mut triangle: Vector<Point2f> = Vector::new();
    imgproc::min_enclosing_triangle(&hull, &mut triangle)?;
    let triangle: Vec<[f64; 2]> = triangle.iter().map(back).collect();
    let fill = |outline: &[[f64; 2]]| match outline.len() {
        3 | 4 => area / polygon_area(outline).max(1e-12),
        _ => 0.0,
    };
    let (of_rectangle, of_triangle) = (fill(&rectangle), fill(&triangle));
    Ok(Some(if of_rectangle >= of_triangle {
        (Outline::Polygon(rectangle), of_rectangle)
    } else {
        (Outline::Polygon(triangle), of_triangle)
    }))
}

/// Returns the circle through the rim of a face of which a part is hidden; `None` if too little of the rim lies on it.
pub(super) fn partial_circle(rim: &[RimPoint]) -> Option<Outline> {
    let rim = in_sight(rim);
    if rim.len() < MIN_ARC_RIM {
        return None;
    }
    let (outline, share) = circle(&rim)?;
    (share >= MIN_ARC).then_some(outline)
}

fn in_sight(rim: &[RimPoint]) -> Vec<[f64; 2]> {
    let seen = rim.iter().filter(|point| !point.hidden);
    seen.map(|point| point.point).collect()
}

/// Returns the farthest point of a face in each direction.
pub(super) fn rim(face: &Face) -> Vec<RimPoint> {
    let middle = mean(&face.points);
    let mut farthest: Vec<Option<(f64, RimPoint)>> = vec![None; DIRECTIONS];
    for (&point, &hidden) in face.points.iter().zip(&face.hidden_beside) {
        let [x, y] = [point[0] - middle[0], point[1] - middle[1]];
        let turn = y.atan2(x) / std::f64::consts::TAU + 0.5;
        let slot = &mut farthest[(turn * DIRECTIONS as f64) as usize % DIRECTIONS];
        let distance = x.hypot(y);
        if slot.is_none_or(|(other, _)| distance > other) {
            *slot = Some((distance, RimPoint { point, hidden }));
        }
    }
    farthest.iter().flatten().map(|(_, point)| *point).collect()
}

/// Returns the circle through the rim of a face, and the share of the rim that lies on it.
fn circle(rim: &[[f64; 2]]) -> Option<(Outline, f64)> {
    let on = |(centre, radius): &([f64; 2], f64)| -> Vec<[f64; 2]> {
        let near = |point: &&[f64; 2]| {
            let distance = (point[0] - centre[0]).hypot(point[1] - centre[1]);
            (distance - radius).abs() < CIRCLE_REACH
        };
        rim.iter().filter(near).copied().collect()
    };
    // Spread over the rim, the same for the same points.
    let trial = |index: usize| {
        let pick =
            |step: usize| rim[(index * 7 + step * rim.len() / 3 + index / 9 * step) % rim.len()];
        circle_through(&[pick(0), pick(1), pick(2)])
    };
    let best = (0..TRIALS)
        .filter_map(trial)
        .max_by_key(|circle| on(circle).len())?;
    let refined = circle_through(&on(&best)).unwrap_or(best);
    let supporters = on(&refined).len();
    let share = supporters as f64 / rim.len() as f64;
    let (centre, radius) = refined;
    Some((Outline::Circle { centre, radius }, share))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rim of a circle of 40 mm about the origin, seen over this angle, rad, with 0.5 mm of noise.
    fn arc(angle: f64) -> Vec<RimPoint> {
        let count = (angle / std::f64::consts::TAU * DIRECTIONS as f64).round() as usize;
        let point = |index: usize| {
            let turn = angle * index as f64 / count as f64;
            let radius = 0.040 + if index.is_multiple_of(2) { 5e-4 } else { -5e-4 };
            [radius * turn.cos(), radius * turn.sin()]
        };
        let rim = (0..count).map(point);
        let seen = rim.map(|point| RimPoint {
            point,
            hidden: false,
        });
        seen.collect()
    }

    #[test]
    fn a_short_arc_leaves_the_centre_uncertain() {
        let circle = Outline::Circle {
            centre: [0.0, 0.0],
            radius: 0.040,
        };
        let of = |degrees: f64| circle.centre_uncertainty(&arc(degrees.to_radians()));
        // A whole circle: sigma times the root of 2 / points.
        let whole = of(360.0).unwrap();
        assert!(
            (whole - 5e-4 * (2.0_f64 / 72.0).sqrt()).abs() < 1e-6,
            "{whole}"
        );
        let (half, third, eighth) = (of(180.0).unwrap(), of(120.0).unwrap(), of(45.0).unwrap());
        assert!(
            whole < half && half < third && third < 0.001,
            "{half} {third}"
        );
        assert!(eighth > 0.003, "{eighth}");
        let line = [0.0395, 0.0405].map(|x| RimPoint {
            point: [x, 0.0],
            hidden: false,
        });
        assert_eq!(circle.centre_uncertainty(&line), Some(f64::INFINITY));
        let polygon = Outline::Polygon(vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        assert_eq!(polygon.centre_uncertainty(&arc(3.0)), None);
    }

    #[test]
    fn points_off_the_circle_do_not_make_its_centre_more_certain() {
        let circle = Outline::Circle {
            centre: [0.0, 0.0],
            radius: 0.040,
        };
        let mut rim = arc(1.0);
        let before = circle.centre_uncertainty(&rim);
        let mut far = arc(std::f64::consts::TAU);
        far.iter_mut()
            .for_each(|point| point.point = point.point.map(|value| 0.9 * value));
        rim.extend(far);
        assert_eq!(circle.centre_uncertainty(&rim), before);
    }
}
