//! Round objects: Hough transform, then a fit whose outline must lie on edges.

use std::f64::consts::TAU;

use opencv::core::{Mat, Size, Vec3f, Vector};
use opencv::imgproc;

use super::edges::Edges;
use crate::circle_fit::circle_through;
use crate::{Detection, Result, Shape, VisionError};

/// Points of an outline that are compared with edges.
const SAMPLES: usize = 96;
/// Corners of the outline of a detection.
const CORNERS: usize = 32;
/// Largest distance of an edge from a circle of the Hough transform, pixels.
const REACH: f64 = 5.0;

/// Parameters of the search for round objects.
#[derive(Clone, Debug, PartialEq)]
pub struct CircleParameters {
    /// Smallest and largest radius in pixels.
    pub radius: [f64; 2],
    /// Images are scaled by this factor before the Hough transform; the outline is fitted at full size.
    pub scale: f64,
    /// Upper threshold of the edge detector of the Hough transform.
    pub edge_threshold: f64,
    /// Accumulator threshold of the Hough transform.
    pub votes: f64,
    /// Smallest gradient of an edge, grey values per pixel.
    pub gradient: f64,
    /// Smallest part of the outline on edges, 0 to 1.
    pub min_support: f64,
}

impl Default for CircleParameters {
    fn default() -> Self {
        Self {
            radius: [48.0, 205.0],
            scale: 0.5,
            edge_threshold: 60.0,
            votes: 18.0,
            gradient: 3.0,
            min_support: 0.77,
        }
    }
}

/// Returns circles, the best supported first; none has its centre in another.
pub(super) fn detect(
    grey: &Mat,
    edges: &Edges,
    parameters: &CircleParameters,
) -> Result<Vec<Detection>> {
    let candidates = hough(grey, parameters).map_err(VisionError::cv("search circles"))?;
    let mut fitted: Vec<(Circle, f64)> = candidates
        .into_iter()
        .filter_map(|circle| fit(edges, circle, parameters))
        .filter(|(circle, support)| {
            (parameters.radius[0]..=parameters.radius[1]).contains(&circle.radius)
                && *support >= parameters.min_support
        })
        .collect();
    // The rim of a glass is two circles: of those with nearly the same support the outer one is the object.
    fitted.sort_by(|one, other| {
        let rank = |entry: &(Circle, f64)| (entry.1 * 8.0).floor() * 1e4 + entry.0.radius;
        rank(other).total_cmp(&rank(one))
    });
    let mut kept = Vec::new();
    let found = fitted
        .into_iter()
        .map(|(circle, support)| circle.detection(support));
    super::extend(&mut kept, found.collect());
    Ok(kept)
}

#[derive(Clone, Copy)]
struct Circle {
    centre: [f64; 2],
    radius: f64,
}

impl Circle {
    fn point(&self, angle: f64) -> ([f64; 2], [f64; 2]) {
        let normal = [angle.cos(), angle.sin()];
        let point = [0, 1].map(|axis| self.centre[axis] + self.radius * normal[axis]);
        (point, normal)
    }

    fn detection(&self, support: f64) -> Detection {
        let angle = |corner: usize| TAU * corner as f64 / CORNERS as f64;
        Detection {
            shape: Shape::Cylinder {
                radius: self.radius,
            },
            centre: self.centre,
            contour: (0..CORNERS)
                .map(|corner| self.point(angle(corner)).0)
                .collect(),
            score: support,
        }
    }
}

fn hough(grey: &Mat, parameters: &CircleParameters) -> opencv::Result<Vec<Circle>> {
    let scale = parameters.scale;
    let (mut small, mut soft) = (Mat::default(), Mat::default());
    imgproc::resize(
        grey,
        &mut small,
        Size::new(0, 0),
        scale,
        scale,
        imgproc::INTER_AREA,
    )?;
    imgproc::gaussian_blur(
        &small,
        &mut soft,
        Size::new(5, 5),
        1.2,
        1.2,
        opencv::core::BORDER_REPLICATE,
    )?;
    let radius = parameters.radius.map(|radius| (radius * scale) as i32);
    let mut circles: Vector<Vec3f> = Vector::new();
    // Two ranges: the transform returns one radius per centre, and small circles lie within large ones.
    let middle = (radius[0] + radius[1]) / 2;
    let mut found = Vec::new();
    for [from, to] in [[radius[0], middle], [middle, radius[1]]] {
        imgproc::hough_circles(
            &soft,
            &mut circles,
            imgproc::HOUGH_GRADIENT,
            1.0,
            f64::from(radius[0]) * 0.3,
            parameters.edge_threshold,
            parameters.votes,
            from,
            to,
        )?;
        found.extend(circles.iter().map(|circle| Circle {
            centre: [0, 1].map(|axis| (f64::from(circle[axis]) + 0.5) / scale - 0.5),
            radius: f64::from(circle[2]) / scale,
        }));
    }
    Ok(found)
}

/// Moves a circle onto the edges near it, twice; returns it with the part of its outline that lies on edges.
fn fit(edges: &Edges, mut circle: Circle, parameters: &CircleParameters) -> Option<(Circle, f64)> {
    let mut support = 0.0;
    for reach in [REACH, REACH, 2.5] {
        let points: Vec<[f64; 2]> = (0..SAMPLES)
            .filter_map(|index| {
                let (point, normal) = circle.point(TAU * index as f64 / SAMPLES as f64);
                let (offset, strength) = edges.strongest(point, normal, reach)?;
                (strength >= parameters.gradient)
                    .then(|| [0, 1].map(|axis| point[axis] + offset * normal[axis]))
            })
            .collect();
        support = points.len() as f64 / SAMPLES as f64;
        if support < 0.3 {
            return None;
        }
        let (centre, radius) = circle_through(&points)?;
        circle = Circle { centre, radius };
    }
    Some((circle, support))
}
