//! Objects with straight sides: polygonal approximation of smooth areas.

use opencv::core::{Point, Point2f, RotatedRect, Vector};
use opencv::imgproc;

use super::edges::Edges;
use crate::object_shape::polygon_area;
use crate::{Detection, Polygon, Result, Shape, VisionError};

/// Largest distance of an edge from a side, pixels.
const REACH: f64 = 4.0;

/// Parameters of the search for polygons.
#[derive(Clone, Debug, PartialEq)]
pub struct PolygonParameters {
    /// Gradients that end a smooth area, grey values per pixel; each is tried.
    pub gradients: Vec<f64>,
    /// Smallest and largest area in square pixels.
    pub area: [f64; 2],
    /// Shortest side in pixels.
    pub min_side: f64,
    /// Largest distance between contour and polygon, part of the perimeter.
    pub tolerance: f64,
    /// Largest difference between the longest and the shortest side of a triangle, part of the longest.
    pub triangle_tolerance: f64,
    /// Smallest part of the minimum-area rectangle that a rectangle's contour fills.
    pub min_fill: f64,
    /// Smallest part of each side on edges, 0 to 1.
    pub min_support: f64,
}

impl Default for PolygonParameters {
    fn default() -> Self {
        Self {
            gradients: vec![3.0, 6.0, 12.0, 24.0],
            area: [4_000.0, 90_000.0],
            min_side: 55.0,
            tolerance: 0.03,
            triangle_tolerance: 0.12,
            min_fill: 0.93,
            min_support: 0.7,
        }
    }
}

/// Returns valid polygons, the best supported first; none has its centre in another.
pub(super) fn detect(edges: &Edges, parameters: &PolygonParameters) -> Result<Vec<Detection>> {
    let mut found = Vec::new();
    for gradient in &parameters.gradients {
        let areas =
            areas(edges, *gradient, parameters).map_err(VisionError::cv("search polygons"))?;
        found.extend(areas);
    }
    // Print on a face is smaller than the face.
    found.sort_by(|one: &Detection, other| {
        let rank = |entry: &Detection| (entry.score * 8.0).floor() * 1e6 + entry.area();
        rank(other).total_cmp(&rank(one))
    });
    let mut kept = Vec::new();
    super::extend(&mut kept, found);
    Ok(kept)
}

fn areas(
    edges: &Edges,
    gradient: f64,
    parameters: &PolygonParameters,
) -> opencv::Result<Vec<Detection>> {
    let smooth = edges.smooth_areas(gradient)?;
    let mut contours: Vector<Vector<Point>> = Vector::new();
    imgproc::find_contours_def(
        &smooth,
        &mut contours,
        imgproc::RETR_LIST,
        imgproc::CHAIN_APPROX_SIMPLE,
    )?;
    let mut found = Vec::new();
    for contour in &contours {
        let area = imgproc::contour_area_def(&contour)?;
        if !(parameters.area[0]..=parameters.area[1]).contains(&area) {
            continue;
        }
        let mut hull: Vector<Point> = Vector::new();
        imgproc::convex_hull_def(&contour, &mut hull)?;
        let perimeter = imgproc::arc_length(&hull, true)?;
        let mut corners: Vector<Point> = Vector::new();
        imgproc::approx_poly_dp(&hull, &mut corners, parameters.tolerance * perimeter, true)?;
        let candidate = match corners.len() {
            3 => triangle(&corners, parameters),
            4 => rectangle(&contour, area, parameters)?,
            _ => None,
        };
        let Some((shape, outline)) = candidate else {
            continue;
        };
        let shortest = sides(&outline).into_iter().fold(f64::INFINITY, f64::min);
        let score = support(edges, &outline, gradient.min(4.0));
        if shortest < parameters.min_side || score < parameters.min_support {
            continue;
        }
        let count = outline.len() as f64;
        let centre =
            [0, 1].map(|axis| outline.iter().map(|corner| corner[axis]).sum::<f64>() / count);
        found.push(Detection {
            shape,
            centre,
            contour: outline,
            score,
        });
    }
    Ok(found)
}

fn triangle(
    corners: &Vector<Point>,
    parameters: &PolygonParameters,
) -> Option<(Shape, Vec<[f64; 2]>)> {
    let outline: Vec<[f64; 2]> = corners
        .iter()
        .map(|corner| [corner.x.into(), corner.y.into()])
        .collect();
    let sides = sides(&outline);
    let longest = (0..3).max_by(|a, b| sides[*a].total_cmp(&sides[*b]))?;
    let shortest = sides.iter().copied().fold(f64::INFINITY, f64::min);
    if shortest < (1.0 - parameters.triangle_tolerance) * sides[longest] {
        return None;
    }
    let (a, b) = (outline[longest], outline[(longest + 1) % 3]);
    let side = sides.iter().sum::<f64>() / 3.0;
    let angle = direction(a, b);
    Some((Shape::Polygon(Polygon::Triangle { side, angle }), outline))
}

fn rectangle(
    contour: &Vector<Point>,
    area: f64,
    parameters: &PolygonParameters,
) -> opencv::Result<Option<(Shape, Vec<[f64; 2]>)>> {
    let around: RotatedRect = imgproc::min_area_rect(contour)?;
    let mut corners = [Point2f::default(); 4];
    around.points(&mut corners)?;
    let outline = corners
        .map(|corner| [f64::from(corner.x), f64::from(corner.y)])
        .to_vec();
    if area < parameters.min_fill * polygon_area(&outline) {
        return Ok(None);
    }
    let sides = sides(&outline);
    let (longer, from) = if sides[0] >= sides[1] {
        (sides[0], 0)
    } else {
        (sides[1], 1)
    };
    let shorter = sides[1 - from];
    let angle = direction(outline[from], outline[from + 1]);
    let shape = Shape::Polygon(Polygon::Rectangle {
        sides: [longer, shorter],
        angle,
    });
    Ok(Some((shape, outline)))
}

fn sides(outline: &[[f64; 2]]) -> Vec<f64> {
    let ends = |index: usize| (outline[index], outline[(index + 1) % outline.len()]);
    (0..outline.len())
        .map(|index| {
            let (a, b) = ends(index);
            (a[0] - b[0]).hypot(a[1] - b[1])
        })
        .collect()
}

/// Returns the direction of a line in -π/2..=π/2.
fn direction(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    if dx < 0.0 {
        (-dy).atan2(-dx)
    } else {
        dy.atan2(dx)
    }
}

/// Returns the least supported side's part on edges.
fn support(edges: &Edges, outline: &[[f64; 2]], threshold: f64) -> f64 {
    (0..outline.len())
        .map(|index| {
            let (a, b) = (outline[index], outline[(index + 1) % outline.len()]);
            edges.side_support(a, b, REACH, threshold)
        })
        .fold(1.0, f64::min)
}
