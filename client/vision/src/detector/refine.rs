//! Outlines moved onto the edges of the colour image.

use std::f64::consts::TAU;

use nalgebra::Point3;
use opencv::core::{Mat, MatTraitConst, Rect};

use super::outline::Outline;
use super::partial_polygon::EdgeSupport;
use crate::circle_fit::{circle_through, mean};
use crate::recognition::Edges;
use crate::{CameraModel, Result, VisionError};

/// Points of a circle and of each side that are compared with edges.
const CIRCLE_SAMPLES: usize = 96;
const SIDE_SAMPLES: usize = 32;
/// Part of a side at each of its ends that is not compared: corners are round.
const CORNER: f64 = 0.08;
/// Margin of the part of the image around an outline, pixels.
const MARGIN: i32 = 12;
/// Largest distance of an edge from the place at which a hidden side is tried, pixels, and the strength that counts of it,
/// grey values per pixel: a few strong edges across the side are no side.
const HIDDEN_REACH: f64 = 1.0;
const MAX_STRENGTH: f64 = 12.0;
/// Fewest supported samples of a side that move it.
const MIN_SIDE_SUPPORT: usize = 10;

/// The image around an outline at a known height.
pub(super) struct Surroundings<'a> {
    camera: &'a CameraModel,
    /// Height in the arm's base frame, m.
    height: f64,
    edges: Edges,
    corner: [f64; 2],
    gradient: f64,
}

impl<'a> Surroundings<'a> {
    /// Cuts the surroundings of an outline, `reach` m wide, out of the image; `None` if they are outside.
    pub(super) fn new(
        image: &Mat,
        camera: &'a CameraModel,
        outline: &Outline,
        height: f64,
        reach: f64,
        gradient: f64,
    ) -> Result<Option<Self>> {
        let pixels = pixels(camera, outline, height);
        let distance = (camera.pose.translation.vector.z - height).max(1e-3);
        let margin = MARGIN + (reach * camera.intrinsics.focal[0] / distance) as i32;
        let bounds = |axis: usize| {
            let values = pixels.iter().map(|pixel| pixel[axis]);
            let low = values.clone().fold(f64::INFINITY, f64::min) as i32 - margin;
            let high = values.fold(f64::NEG_INFINITY, f64::max) as i32 + margin;
            let size = if axis == 0 {
                image.cols()
            } else {
                image.rows()
            };
            [low.clamp(0, size), high.clamp(0, size)]
        };
        if pixels.is_empty() {
            return Ok(None);
        }
        let ([left, right], [top, bottom]) = (bounds(0), bounds(1));
        if right - left < 2 * MARGIN || bottom - top < 2 * MARGIN {
            return Ok(None);
        }
        let part = Rect::new(left, top, right - left, bottom - top);
        let part = image
            .roi(part)
            .map_err(VisionError::cv("cut out an object"))?;
        let part = part
            .try_clone()
            .map_err(VisionError::cv("cut out an object"))?;
        Ok(Some(Self {
            camera,
            height,
            edges: Edges::new(&part)?,
            corner: [f64::from(left), f64::from(top)],
            gradient,
        }))
    }

    /// Returns the point of the plane where the image has an edge near `point` across `normal`.
    fn edge(&self, point: [f64; 2], normal: [f64; 2], reach: f64) -> Option<[f64; 2]> {
        let pixel = |point: [f64; 2]| {
            let [u, v] = self
                .camera
                .project(&Point3::new(point[0], point[1], self.height))?;
            Some([u - self.corner[0], v - self.corner[1]])
        };
        let here = pixel(point)?;
        let beside = pixel([0, 1].map(|axis| point[axis] + 1e-3 * normal[axis]))?;
        let across = [beside[0] - here[0], beside[1] - here[1]];
        let length = across[0].hypot(across[1]).max(1e-9);
        let across = across.map(|value| value / length);
        let (offset, strength) = self.edges.strongest(here, across, reach)?;
        if strength < self.gradient {
            return None;
        }
        // Pixels per mm is what `length` is.
        let metres = offset / length * 1e-3;
        Some([0, 1].map(|axis| point[axis] + metres * normal[axis]))
    }

    /// Returns how much of a side lies on edges along it. Places beyond which the camera is `covered` are not in sight.
    pub(super) fn edges_along(
        &self,
        [a, b]: [[f64; 2]; 2],
        normal: [f64; 2],
        covered: impl Fn([f64; 2]) -> bool,
    ) -> EdgeSupport {
        let pixel = |point: [f64; 2]| {
            let [u, v] = self
                .camera
                .project(&Point3::new(point[0], point[1], self.height))?;
            Some([u - self.corner[0], v - self.corner[1]])
        };
        let (mut on, mut open, mut sum) = (0, 0, 0.0);
        for sample in 0..SIDE_SAMPLES {
            let part = (sample as f64 + 0.5) / SIDE_SAMPLES as f64;
            let part = CORNER + (1.0 - 2.0 * CORNER) * part;
            let point = [0, 1].map(|axis| a[axis] + part * (b[axis] - a[axis]));
            let beside = [0, 1].map(|axis| point[axis] + 1e-3 * normal[axis]);
            let (Some(here), Some(beside)) = (pixel(point), pixel(beside)) else {
                continue;
            };
            let across = [beside[0] - here[0], beside[1] - here[1]];
            let length = across[0].hypot(across[1]).max(1e-9);
            let across = across.map(|value| value / length);
            if covered(point) {
                continue;
            }
            open += 1;
            if let Some((_, strength)) = self.edges.strongest(here, across, HIDDEN_REACH)
                && strength >= self.gradient
            {
                on += 1;
                sum += strength.min(MAX_STRENGTH);
            }
        }
        let count = SIDE_SAMPLES as f64;
        EdgeSupport {
            share: f64::from(on) / count,
            open: f64::from(open) / count,
            strength: sum / count,
        }
    }

    /// Moves an outline onto the edges near it, and returns it with the share of it that lies on edges.
    pub(super) fn refine(&self, outline: &Outline, reach: f64) -> (Outline, f64) {
        match outline {
            Outline::Circle { centre, radius } => self.refine_circle(*centre, *radius, reach),
            Outline::Polygon(corners) => self.refine_polygon(corners, reach),
        }
    }

    fn refine_circle(&self, centre: [f64; 2], radius: f64, reach: f64) -> (Outline, f64) {
        let points: Vec<[f64; 2]> = (0..CIRCLE_SAMPLES)
            .filter_map(|index| {
                let angle = TAU * index as f64 / CIRCLE_SAMPLES as f64;
                let normal = [angle.cos(), angle.sin()];
                let point = [0, 1].map(|axis| centre[axis] + radius * normal[axis]);
                self.edge(point, normal, reach)
            })
            .collect();
        let support = points.len() as f64 / CIRCLE_SAMPLES as f64;
        let fitted = trimmed(points, circle_through, |(centre, radius), point| {
            (point[0] - centre[0]).hypot(point[1] - centre[1]) - radius
        });
        let outline = match fitted {
            Some((centre, radius)) if support > 0.3 => Outline::Circle { centre, radius },
            _ => Outline::Circle { centre, radius },
        };
        (outline, support)
    }

    fn refine_polygon(&self, corners: &[[f64; 2]], reach: f64) -> (Outline, f64) {
        let count = corners.len();
        let middle = mean(corners);
        let mut supported = 0;
        let lines: Vec<Line> = (0..count)
            .map(|index| {
                let (a, b) = (corners[index], corners[(index + 1) % count]);
                let side = Line::through(&[a, b]).unwrap_or(Line {
                    point: a,
                    direction: [1.0, 0.0],
                });
                let normal = [side.direction[1], -side.direction[0]];
                let points: Vec<[f64; 2]> = (0..SIDE_SAMPLES)
                    .filter_map(|sample| {
                        let part = (sample as f64 + 0.5) / SIDE_SAMPLES as f64;
                        let part = CORNER + (1.0 - 2.0 * CORNER) * part;
                        let point = [0, 1].map(|axis| a[axis] + part * (b[axis] - a[axis]));
                        self.edge(point, normal, reach)
                    })
                    .collect();
                supported += points.len();
                if points.len() < MIN_SIDE_SUPPORT {
                    return side;
                }
                let line = trimmed(points, Line::through, |line, point| line.distance(point));
                line.filter(|line| line.is_along(&side)).unwrap_or(side)
            })
            .collect();
        let support = supported as f64 / (count * SIDE_SAMPLES) as f64;
        let moved: Option<Vec<[f64; 2]>> = (0..count)
            .map(|index| lines[(index + count - 1) % count].meets(&lines[index]))
            .collect();
        let far = |moved: &[[f64; 2]]| {
            let centre = mean(moved);
            (centre[0] - middle[0]).hypot(centre[1] - middle[1])
        };
        let outline = match moved {
            Some(moved) if far(&moved) < 0.01 => moved,
            _ => corners.to_vec(),
        };
        (Outline::Polygon(outline), support)
    }
}

/// Returns the pixels of an outline at a height of the arm's base frame, in order.
pub(super) fn pixels(camera: &CameraModel, outline: &Outline, height: f64) -> Vec<[f64; 2]> {
    const CORNERS: usize = 32;
    let points = match outline {
        Outline::Circle { centre, radius } => (0..CORNERS)
            .map(|corner| TAU * corner as f64 / CORNERS as f64)
            .map(|angle| {
                [
                    centre[0] + radius * angle.cos(),
                    centre[1] + radius * angle.sin(),
                ]
            })
            .collect(),
        Outline::Polygon(corners) => corners.clone(),
    };
    let pixel = |point: &[f64; 2]| camera.project(&Point3::new(point[0], point[1], height));
    points.iter().filter_map(pixel).collect()
}

/// Fits a model, removes the points that lie farthest from it, and fits again.
fn trimmed<M>(
    mut points: Vec<[f64; 2]>,
    fit: impl Fn(&[[f64; 2]]) -> Option<M>,
    distance: impl Fn(&M, &[f64; 2]) -> f64,
) -> Option<M> {
    let mut model = fit(&points)?;
    for _ in 0..3 {
        let mut sizes: Vec<f64> = points.iter().map(|p| distance(&model, p).abs()).collect();
        sizes.sort_by(f64::total_cmp);
        // 2.5 standard deviations of a normal distribution, by the median; at least a tenth of a millimetre.
        let limit = (sizes[sizes.len() / 2] * 3.7).max(1e-4);
        let before = points.len();
        points.retain(|point| distance(&model, point).abs() <= limit);
        match fit(&points) {
            Some(better) => model = better,
            None => break,
        }
        if points.len() == before {
            break;
        }
    }
    Some(model)
}

struct Line {
    point: [f64; 2],
    direction: [f64; 2],
}

impl Line {
    /// Returns the line through points in the least squares sense.
    fn through(points: &[[f64; 2]]) -> Option<Self> {
        if points.len() < 2 {
            return None;
        }
        let point = mean(points);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for other in points {
            let [x, y] = [other[0] - point[0], other[1] - point[1]];
            xx += x * x;
            xy += x * y;
            yy += y * y;
        }
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        Some(Self {
            point,
            direction: [angle.cos(), angle.sin()],
        })
    }

    fn distance(&self, point: &[f64; 2]) -> f64 {
        let [x, y] = [point[0] - self.point[0], point[1] - self.point[1]];
        x * self.direction[1] - y * self.direction[0]
    }

    /// Returns whether the directions differ by less than 6 degrees.
    fn is_along(&self, other: &Self) -> bool {
        let dot = self.direction[0] * other.direction[0] + self.direction[1] * other.direction[1];
        dot.abs() > 0.9945
    }

    fn meets(&self, other: &Self) -> Option<[f64; 2]> {
        let cross = self.direction[0] * other.direction[1] - self.direction[1] * other.direction[0];
        if cross.abs() < 0.1 {
            return None;
        }
        let gap = [
            other.point[0] - self.point[0],
            other.point[1] - self.point[1],
        ];
        let along = (gap[0] * other.direction[1] - gap[1] * other.direction[0]) / cross;
        Some([0, 1].map(|axis| self.point[axis] + along * self.direction[axis]))
    }
}
