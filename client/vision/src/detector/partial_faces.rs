//! Faces of which something hides a part: completed from edges of the colour image, or from a print.

use std::sync::PoisonError;

use opencv::core::Mat;

use super::face_to_object::{Examiner, Named, sides};
use super::height_map::Face;
use super::outline::{Outline, RimPoint};
use super::partial_polygon::PartialPolygon;
use super::print_recognition::PlanePart;
use super::{FoundObject, KindFace, refine};
use crate::{Result, Shape};

/// Distance around the visible part of a face in which a print is looked for, m: what the colour camera sees beyond it.
const PRINT_MARGIN: f64 = 0.045;

impl Examiner<'_> {
    /// Returns the object whose rectangle or triangle is hidden in part.
    pub(super) fn partial_polygon(
        &self,
        image: &Mat,
        face: &Face,
        rim: &[RimPoint],
    ) -> Result<Option<FoundObject>> {
        let top = self.setup.surface + face.height;
        let gradient = self.parameters.gradient;
        for sides in [4, 3] {
            let fitted = PartialPolygon::fit(&face.points, rim, sides, face.height, &self.view);
            let Some(mut polygon) = fitted else {
                continue;
            };
            let Some(seen) = polygon.outline() else {
                continue;
            };
            if !polygon.is_complete() {
                let reach = self.largest_side(sides);
                let camera = &self.setup.camera;
                let around = refine::Surroundings::new(image, camera, &seen, top, reach, gradient)?;
                let Some(around) = around else { continue };
                let support = |ends, normal| {
                    around.edges_along(ends, normal, |point| {
                        self.view.is_covered_beyond(point, normal, face.height)
                    })
                };
                if !polygon.complete(reach, &self.view, support) {
                    continue;
                }
            }
            let Some(outline) = polygon.outline() else {
                continue;
            };
            if let Some(object) = self.refined(image, &outline, rim, face.height, 1.0)?
                && self.agrees(&object, face)
            {
                return Ok(Some(object));
            }
        }
        Ok(None)
    }

    /// Returns the printed object of which the face shows a part: the print says where it ends.
    pub(super) fn partial_print(&self, image: &Mat, face: &Face) -> Result<Option<FoundObject>> {
        let top = self.setup.surface + face.height;
        let mut part = None;
        let mut best: Option<(usize, [[f64; 2]; 4], usize)> = None;
        for (index, kind) in self.database.kinds.iter().enumerate() {
            if !kind.has_height(face.height) {
                continue;
            }
            for print in &self.prints[index] {
                if part.is_none() {
                    let bounds = bounds(&face.points, PRINT_MARGIN);
                    part = Some(PlanePart::new(image, &self.setup.camera, bounds, top)?);
                }
                let Some(part) = &part else { continue };
                let mut print = print.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some((corners, inliers)) = part.place(&mut print, self.parameters.ratio)?
                    && inliers >= self.parameters.min_inliers
                    && best.is_none_or(|(.., most)| inliers > most)
                {
                    best = Some((index, corners, inliers));
                }
            }
        }
        let Some((index, corners, inliers)) = best else {
            return Ok(None);
        };
        let outline = Outline::Polygon(corners.to_vec());
        if !self.is_within_image(&outline, top) {
            return Ok(None);
        }
        let lengths = sides(&corners);
        let kind = self.database.kinds[index].name.clone();
        let named = Named {
            shape: Shape::Textured {
                model: kind.clone(),
            },
            kind,
            size: [lengths[0].max(lengths[1]), lengths[0].min(lengths[1])],
            score: Some(inliers as f64),
        };
        let object = self.located(&outline, face.height, named, 1.0);
        Ok(object.filter(|object| self.agrees(object, face)))
    }

    /// Returns the longest side of a polygon with this many sides that the database has, m.
    fn largest_side(&self, sides: usize) -> f64 {
        let longest = self.database.kinds.iter().map(|kind| match &kind.face {
            KindFace::Rectangle { sides: [_, high] } if sides == 4 => *high,
            KindFace::Printed {
                sides: [_, high], ..
            } if sides == 4 => *high,
            KindFace::Triangle { sides: [_, high] } if sides == 3 => *high,
            _ => 0.0,
        });
        longest.fold(0.0, f64::max)
    }

    /// Returns whether an outline contains the points of a face, and nothing that the depth image shows to be free.
    pub(super) fn agrees(&self, object: &FoundObject, face: &Face) -> bool {
        let camera = &self.setup.camera;
        let top = self.setup.surface + face.height;
        let on_plane = |pixel: &[f64; 2]| -> Option<[f64; 2]> {
            let point = camera.on_plane(*pixel, top)?;
            Some([point.x, point.y])
        };
        let corners: Option<Vec<[f64; 2]>> =
            object.detection.contour.iter().map(on_plane).collect();
        corners.is_some_and(|corners| self.view.agrees(&corners, face))
    }
}

/// Returns the smallest and largest x and y of points, with a margin.
fn bounds(points: &[[f64; 2]], margin: f64) -> [[f64; 2]; 2] {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in points {
        for axis in 0..2 {
            low[axis] = low[axis].min(point[axis] - margin);
            high[axis] = high[axis].max(point[axis] + margin);
        }
    }
    [low, high]
}
