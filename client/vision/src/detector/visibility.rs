//! Places of a plane above the table as the depth sensor sees them: part of a face, free, or hidden.

use std::sync::OnceLock;

use nalgebra::Point3;

use super::height_map::{Cloud, Face};
use super::outline::Outline;
use crate::CameraModel;
use crate::circle_fit::mean;

/// Largest difference between the height of a face and of a measured point of it, m.
const SAME_HEIGHT: f32 = 0.007;
/// Distance from an outline at which the depth image is asked beyond it, m: three of its pixels, for those at edges are
/// often lost.
const BEYOND: f64 = 0.005;
/// Places beside each side, and around a circle, that are asked.
const SIDE_PLACES: usize = 24;
const CIRCLE_PLACES: usize = 72;

/// Largest share of the points of a face beyond its outline, and of the places within the outline that are free.
const MAX_CONTRADICTION: f64 = 0.05;

/// Side of the squares of the colour image that one point of the depth image covers, pixels: colour cameras have more of them.
const COVER: usize = 4;
/// Least difference in height from which something hides what is below it from the colour camera, m.
const NEARER: f32 = 0.025;

/// A place of a plane in the depth image.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Sight {
    /// Something of the height of the plane is there.
    Face,
    /// The sensor sees something lower: nothing is there.
    Free,
    /// Something higher is in the way, or the sensor does not see so far.
    Hidden,
    /// Nothing was measured.
    Unmeasured,
}

/// The depth image of one moment and its sensor.
pub(super) struct DepthView<'a> {
    pub(super) camera: &'a CameraModel,
    pub(super) cloud: &'a Cloud,
    pub(super) colour: &'a CameraModel,
    /// Height of the table in the arm's base frame, m.
    pub(super) surface: f64,
    /// Largest height in each square of the colour image, computed when it is first asked for.
    pub(super) cover: OnceLock<Vec<f32>>,
}

impl DepthView<'_> {
    /// Returns the sight of a place at a height above the table.
    pub(super) fn at(&self, [x, y]: [f64; 2], height: f64) -> Sight {
        let Some(pixel) = self
            .camera
            .project(&Point3::new(x, y, self.surface + height))
        else {
            return Sight::Hidden;
        };
        let [width, rows] = self.camera.intrinsics.size;
        let inside = |value: f64, size: usize| value >= -0.5 && value < size as f64 - 0.5;
        if !(inside(pixel[0], width) && inside(pixel[1], rows)) {
            return Sight::Hidden;
        }
        let [column, row] = pixel.map(|value| value.round().max(0.0) as usize);
        match self.cloud.height(row * width + column) {
            None => Sight::Unmeasured,
            Some(there) if there > height as f32 + SAME_HEIGHT => Sight::Hidden,
            Some(there) if there < height as f32 - SAME_HEIGHT => Sight::Free,
            Some(_) => Sight::Face,
        }
    }

    /// Returns whether something higher hides the place just beyond a side from the colour camera: an edge there may be the
    /// border of what is in the way.
    pub(super) fn is_covered_beyond(&self, point: [f64; 2], normal: [f64; 2], height: f64) -> bool {
        let [x, y] = [0, 1].map(|axis| point[axis] + BEYOND * normal[axis]);
        let cover = self.cover.get_or_init(|| self.covered());
        let pixel = self
            .colour
            .project(&Point3::new(x, y, self.surface + height));
        pixel
            .and_then(|pixel| self.square(pixel))
            .is_none_or(|square| cover[square] > height as f32 + NEARER)
    }

    /// Returns the index of the square of a pixel of the colour image.
    fn square(&self, [u, v]: [f64; 2]) -> Option<usize> {
        let [width, height] = self.colour.intrinsics.size;
        let inside = u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64;
        let [column, row] = [u, v].map(|value| value as usize / COVER);
        inside.then(|| row * width.div_ceil(COVER) + column)
    }

    fn covered(&self) -> Vec<f32> {
        let [width, height] = self.colour.intrinsics.size;
        let mut cover = vec![f32::NEG_INFINITY; width.div_ceil(COVER) * height.div_ceil(COVER)];
        for point in self.cloud.points().iter().filter(|point| point.z > NEARER) {
            let mut there = point.cast::<f64>();
            there.z += self.surface;
            let square = self
                .colour
                .project(&there)
                .and_then(|pixel| self.square(pixel));
            if let Some(square) = square {
                cover[square] = cover[square].max(point.z);
            }
        }
        cover
    }

    /// Returns the share of the places just beyond a side, from `a` to `b` with this outward normal, that are free: the face
    /// ends there.
    pub(super) fn free_beyond(&self, [a, b]: [[f64; 2]; 2], normal: [f64; 2], height: f64) -> f64 {
        let places = (0..SIDE_PLACES).map(|place| {
            let part = (place as f64 + 0.5) / SIDE_PLACES as f64;
            [0, 1].map(|axis| a[axis] + part * (b[axis] - a[axis]) + BEYOND * normal[axis])
        });
        self.share(places, height)
    }

    /// Returns the least share of the places just beyond a side of an outline, or around a circle, that are free.
    pub(super) fn least_free(&self, outline: &Outline, height: f64) -> f64 {
        match outline {
            Outline::Circle { centre, radius } => {
                let places = (0..CIRCLE_PLACES).map(|place| {
                    let angle = std::f64::consts::TAU * place as f64 / CIRCLE_PLACES as f64;
                    let reach = radius + BEYOND;
                    [
                        centre[0] + reach * angle.cos(),
                        centre[1] + reach * angle.sin(),
                    ]
                });
                self.share(places, height)
            }
            Outline::Polygon(corners) => {
                let middle = outline.centre();
                (0..corners.len())
                    .map(|index| {
                        let ends = [corners[index], corners[(index + 1) % corners.len()]];
                        self.free_beyond(ends, outward(ends, middle), height)
                    })
                    .fold(1.0, f64::min)
            }
        }
    }

    /// Returns whether a polygon contains the points of a face, and nothing that is free.
    pub(super) fn agrees(&self, corners: &[[f64; 2]], face: &Face) -> bool {
        let middle = mean(corners);
        let side = |index: usize| [corners[index], corners[(index + 1) % corners.len()]];
        let beyond = |point: &[f64; 2]| {
            let distances = (0..corners.len()).map(|index| {
                let ends = side(index);
                let normal = outward(ends, middle);
                normal[0] * (point[0] - ends[0][0]) + normal[1] * (point[1] - ends[0][1])
            });
            distances.fold(f64::NEG_INFINITY, f64::max)
        };
        let outside = face.points.iter().filter(|point| beyond(point) > BEYOND);
        if outside.count() as f64 > MAX_CONTRADICTION * face.points.len() as f64 {
            return false;
        }
        // Places inside: on lines from the middle to each of many places of the outline.
        let places = (0..corners.len()).flat_map(|index| {
            let [a, b] = side(index);
            (0..SIDE_PLACES).flat_map(move |place| {
                let along = (f64::from(place as u32) + 0.5) / SIDE_PLACES as f64;
                [0.5, 0.7, 0.85].map(|out| {
                    [0, 1].map(|axis| {
                        let on = a[axis] + along * (b[axis] - a[axis]);
                        middle[axis] + out * (on - middle[axis])
                    })
                })
            })
        });
        self.share(places, face.height) <= MAX_CONTRADICTION
    }

    fn share(&self, places: impl Iterator<Item = [f64; 2]>, height: f64) -> f64 {
        let (mut free, mut measured) = (0, 0);
        for place in places {
            match self.at(place, height) {
                Sight::Unmeasured => {}
                Sight::Free => {
                    free += 1;
                    measured += 1;
                }
                Sight::Face | Sight::Hidden => measured += 1,
            }
        }
        f64::from(free) / f64::from(measured.max(1))
    }
}

/// Returns the unit normal of a side that points away from the middle.
pub(super) fn outward([a, b]: [[f64; 2]; 2], middle: [f64; 2]) -> [f64; 2] {
    let length = (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-9);
    let normal = [(b[1] - a[1]) / length, (a[0] - b[0]) / length];
    let away = normal[0] * (a[0] - middle[0]) + normal[1] * (a[1] - middle[1]);
    if away >= 0.0 {
        normal
    } else {
        normal.map(|value| -value)
    }
}
