//! From a face to an object: outline, size, print.

use std::sync::{Mutex, PoisonError};

use nalgebra::Point3;
use opencv::core::Mat;

use super::height_map::Face;
use super::outline::{self, Outline, RimPoint};
use super::partial_polygon::MIN_FREE;
use super::print_recognition::{Print, RectifiedFace};
use super::visibility::DepthView;
use super::{
    DetectorParameters, DetectorSetup, FoundObject, KindFace, ObjectDatabase, ObjectKind, refine,
};
use crate::circle_fit::mean;
use crate::{Detection, Elevation, Polygon, Result, Shape, VisionError};

/// Largest difference between a measured and a listed size, m.
const SIZE_TOLERANCE: f64 = 0.005;
/// Largest distance of an outline beyond the border of the image, pixels.
const BORDER_TOLERANCE: f64 = 2.0;
/// Largest error of the centre of a circle in the depth image that does not decrease with the number of its points, m.
const RIM_BIAS: f64 = 0.0005;
/// Largest deviation of the centre of a circle: three times as much is what a position may be off.
const MAX_DEVIATION: f64 = 0.005 / 3.0;
/// Largest difference in height of the parts of a face that something divides, m.
const SAME_FACE: f64 = 0.003;
/// Smallest free share of the places beyond each side of a face of which nothing is hidden.
const MIN_WHOLE: f64 = 0.8;
/// Threads that examine faces.
const THREADS: usize = 2;

/// The parts of a detector that threads share.
pub(super) struct Examiner<'a> {
    pub(super) setup: &'a DetectorSetup,
    pub(super) parameters: &'a DetectorParameters,
    pub(super) database: &'a ObjectDatabase,
    /// Prints of each kind.
    pub(super) prints: &'a [Vec<Mutex<Print>>],
    pub(super) view: DepthView<'a>,
}

impl Examiner<'_> {
    /// Returns the objects of all faces, in the order of the faces.
    pub(super) fn examine_all(&self, image: &Mat, faces: &[Face]) -> Result<Vec<FoundObject>> {
        let next = std::sync::atomic::AtomicUsize::new(0);
        let examine = || {
            let mut found = Vec::new();
            loop {
                let index = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                let Some(face) = faces.get(index) else {
                    return Ok(found);
                };
                let object = self.examine_divided(image, face, faces)?;
                found.extend(object.map(|object| (index, object)));
            }
        };
        let parts: Vec<Result<Vec<(usize, FoundObject)>>> = std::thread::scope(|scope| {
            let helpers: Vec<_> = (1..THREADS).map(|_| scope.spawn(examine)).collect();
            let mut parts = vec![examine()];
            for helper in helpers {
                parts.push(helper.join().expect("examining a face does not panic"));
            }
            parts
        });
        let mut all = Vec::new();
        for part in parts {
            all.extend(part?);
        }
        all.sort_by_key(|(index, _)| *index);
        Ok(all.into_iter().map(|(_, object)| object).collect())
    }

    /// Returns the object whose upper face this is, with the other parts of it if something divides it: a part alone has a
    /// short arc, or a side of what is in the way.
    fn examine_divided(
        &self,
        image: &Mat,
        face: &Face,
        faces: &[Face],
    ) -> Result<Option<FoundObject>> {
        let Some(found) = self.examine(image, face)? else {
            return Ok(None);
        };
        let top = self.setup.surface + face.height;
        let is_part = |other: &&Face| {
            let [x, y] = mean(&other.points);
            let pixel = self.setup.camera.project(&Point3::new(x, y, top));
            !std::ptr::eq(*other, face)
                && (other.height - face.height).abs() < SAME_FACE
                && pixel.is_some_and(|pixel| found.detection.contains(pixel))
        };
        let mut whole = face.clone();
        for part in faces.iter().filter(is_part) {
            whole.points.extend(&part.points);
            whole.hidden_beside.extend(&part.hidden_beside);
        }
        if whole.points.len() == face.points.len() {
            return Ok(Some(found));
        }
        Ok(Some(self.examine(image, &whole)?.unwrap_or(found)))
    }

    /// Returns the object whose upper face this is.
    fn examine(&self, image: &Mat, face: &Face) -> Result<Option<FoundObject>> {
        let rim = outline::rim(face);
        let fitted = outline::fit(face, &rim).map_err(VisionError::cv("fit an outline"))?;
        if let Some((outline, fill)) = fitted
            && fill >= self.parameters.min_fill
        {
            let free = self.view.least_free(&outline, face.height);
            let top = self.setup.surface + face.height;
            if self.parameters.beyond_image && !self.is_within_image(&outline, top) {
                return match free >= MIN_WHOLE {
                    true => self.named(image, &outline, face.height, fill),
                    false => Ok(None),
                };
            }
            if free >= MIN_FREE {
                let object = self.refined(image, &outline, &rim, face.height, fill)?;
                let is_concave = matches!(outline, Outline::Polygon(_))
                    && object
                        .as_ref()
                        .is_some_and(|found| !self.agrees(found, face));
                if !is_concave && (object.is_some() || free >= MIN_WHOLE) {
                    return Ok(object);
                }
            }
        }
        if let Some(circle) = outline::partial_circle(&rim)
            && self.view.least_free(&circle, face.height) >= MIN_FREE
            && let Some(object) = self.refined(image, &circle, &rim, face.height, 1.0)?
        {
            return Ok(Some(object));
        }
        // A print says where its face ends, which edges may be wrong about.
        if let Some(object) = self.partial_print(image, face)? {
            return Ok(Some(object));
        }
        self.partial_polygon(image, face, &rim)
    }

    /// Returns the object with about this outline.
    pub(super) fn refined(
        &self,
        image: &Mat,
        outline: &Outline,
        rim: &[RimPoint],
        height: f64,
        fill: f64,
    ) -> Result<Option<FoundObject>> {
        if outline
            .centre_uncertainty(rim)
            .is_some_and(|deviation| deviation > MAX_DEVIATION)
        {
            return Ok(None);
        }
        let top = self.setup.surface + height;
        let camera = &self.setup.camera;
        let gradient = self.parameters.gradient;
        let Some(around) = refine::Surroundings::new(image, camera, outline, top, 0.0, gradient)?
        else {
            return Ok(None);
        };
        let (moved, support) = self.moved_onto_edges(&around, outline, rim);
        // Edges beside one at the border may move it out of the image: it stays where the depth image has it.
        let stays = self.parameters.beyond_image && self.is_within_image(outline, top);
        let outline = match self.is_within_image(&moved, top) {
            true => &moved,
            false if stays => outline,
            false => return Ok(None),
        };
        if support < self.parameters.min_support {
            return Ok(None);
        }
        self.named(image, outline, height, fill * support)
    }

    /// Returns an outline moved onto edges of the colour image, and the share of it that lies on edges.
    ///
    /// Near the rim of a plate there are printed rings, near that of a glass its wall and what hides a part: a circle whose
    /// centre moves farther than the rim in the depth image allows has met such edges, and stays where it was.
    fn moved_onto_edges(
        &self,
        around: &refine::Surroundings<'_>,
        seen: &Outline,
        rim: &[RimPoint],
    ) -> (Outline, f64) {
        let reach = self.parameters.reach;
        let (outline, _) = around.refine(seen, reach);
        let (outline, support) = around.refine(&outline, reach / 2.0);
        let allowed = seen
            .centre_uncertainty(rim)
            .map(|deviation| RIM_BIAS + 3.0 * deviation);
        let [before, after] = [seen, &outline].map(Outline::centre);
        let moved = (after[0] - before[0]).hypot(after[1] - before[1]);
        match allowed {
            Some(allowed) if moved > allowed => (seen.clone(), support),
            _ => (outline, support),
        }
    }

    /// Returns whether an outline lies within the image: of one that does not, nobody knows where it ends.
    pub(super) fn is_within_image(&self, outline: &Outline, height: f64) -> bool {
        let pixels = refine::pixels(&self.setup.camera, outline, height);
        self.contains(&pixels)
    }

    /// Returns whether the image has all these pixels.
    fn contains(&self, pixels: &[[f64; 2]]) -> bool {
        let size = self.setup.camera.intrinsics.size;
        let inside = |pixel: &[f64; 2]| {
            let in_range = |axis: usize| {
                (-BORDER_TOLERANCE..=size[axis] as f64 - 1.0 + BORDER_TOLERANCE)
                    .contains(&pixel[axis])
            };
            in_range(0) && in_range(1)
        };
        pixels.iter().all(inside)
    }

    /// Returns the object with this outline, if the database has its kind.
    fn named(
        &self,
        image: &Mat,
        outline: &Outline,
        height: f64,
        score: f64,
    ) -> Result<Option<FoundObject>> {
        let camera = &self.setup.camera;
        let top = self.setup.surface + height;
        let contour = refine::pixels(camera, outline, top);
        let named = match outline {
            Outline::Circle { radius, .. } => self.circle(*radius, height),
            Outline::Polygon(corners) if corners.len() == 3 => {
                self.triangle(&sides(corners), &contour, height)
            }
            Outline::Polygon(corners) => {
                self.rectangle(image, &sides(corners), &contour, height)?
            }
        };
        Ok(named.and_then(|named| self.located(outline, height, named, score)))
    }

    /// Returns the object with this outline and name.
    pub(super) fn located(
        &self,
        outline: &Outline,
        height: f64,
        named: Named,
        score: f64,
    ) -> Option<FoundObject> {
        let camera = &self.setup.camera;
        let top = self.setup.surface + height;
        let [x, y] = outline.centre();
        let detection = Detection {
            shape: named.shape,
            centre: camera.project(&Point3::new(x, y, top))?,
            contour: refine::pixels(camera, outline, top),
            score: named.score.unwrap_or(score),
        };
        let pose = camera.pose_of(&detection, Elevation::Height(top));
        Some(FoundObject {
            kind: named.kind,
            detection,
            pose,
            height: Some(height),
            size: Some(named.size),
        })
    }

    fn circle(&self, radius: f64, height: f64) -> Option<Named> {
        let kind = self.kind_of(
            height,
            |face| matches!(face, KindFace::Circle { radius: range } if fits(radius, *range)),
        )?;
        Some(Named {
            kind,
            shape: Shape::Cylinder {
                radius: self.pixels(radius, height),
            },
            size: [2.0 * radius; 2],
            score: None,
        })
    }

    fn triangle(&self, sides: &[f64], contour: &[[f64; 2]], height: f64) -> Option<Named> {
        let longest = sides.iter().copied().fold(0.0, f64::max);
        let shortest = sides.iter().copied().fold(f64::INFINITY, f64::min);
        let side = sides.iter().sum::<f64>() / 3.0;
        let is_even = longest - shortest < 2.0 * SIZE_TOLERANCE;
        let kind = self.kind_of(height, |face| {
            matches!(face, KindFace::Triangle { sides: range } if is_even && fits(side, *range))
        })?;
        let shape = Shape::Polygon(Polygon::Triangle {
            side: self.pixels(side, height),
            angle: direction(contour),
        });
        Some(Named {
            kind,
            shape,
            size: [side; 2],
            score: None,
        })
    }

    fn rectangle(
        &self,
        image: &Mat,
        sides: &[f64],
        contour: &[[f64; 2]],
        height: f64,
    ) -> Result<Option<Named>> {
        let [one, other] = [0, 1].map(|index| (sides[index] + sides[index + 2]) / 2.0);
        let size = [one.max(other), one.min(other)];
        if let Some((kind, inliers)) = self.printed(image, contour, [one, other], height)? {
            let shape = Shape::Textured {
                model: kind.clone(),
            };
            return Ok(Some(Named {
                kind,
                shape,
                size,
                score: Some(inliers as f64),
            }));
        }
        let kind = self.kind_of(height, |face| {
            matches!(face, KindFace::Rectangle { sides: range }
                if fits(one, *range) && fits(other, *range))
        });
        let is_print_in_sight = self.contains(contour);
        let kind = kind.or_else(|| {
            self.kind_of(height, |face| {
                matches!(face, KindFace::Printed { sides: [low, high], .. }
                    if !is_print_in_sight && fits(size[1], [*low; 2]) && fits(size[0], [*high; 2]))
            })
        });
        let shape = Shape::Polygon(Polygon::Rectangle {
            sides: size.map(|side| self.pixels(side, height)),
            angle: direction(contour),
        });
        Ok(kind.map(|kind| Named {
            kind,
            shape,
            size,
            score: None,
        }))
    }

    /// Returns the first kind of this height whose upper face fits.
    fn kind_of(&self, height: f64, fits: impl Fn(&KindFace) -> bool) -> Option<String> {
        let at_height = |kind: &&ObjectKind| kind.has_height(height);
        let mut kinds = self.database.kinds.iter().filter(at_height);
        let kind = kinds.find(|kind| fits(&kind.face))?;
        Some(kind.name.clone())
    }

    /// Returns the length in the image of something at this height above the table.
    fn pixels(&self, metres: f64, height: f64) -> f64 {
        let camera = &self.setup.camera;
        let focal = (camera.intrinsics.focal[0] + camera.intrinsics.focal[1]) / 2.0;
        let distance = camera.pose.translation.vector.z - self.setup.surface - height;
        metres * focal / distance.max(1e-3)
    }

    /// Returns the printed kind that a rectangular face shows, with the number of agreeing features.
    fn printed(
        &self,
        image: &Mat,
        contour: &[[f64; 2]],
        sides: [f64; 2],
        height: f64,
    ) -> Result<Option<(String, usize)>> {
        let size = [sides[0].min(sides[1]), sides[0].max(sides[1])];
        let mut rectified = None;
        let mut best: Option<(String, usize)> = None;
        for (kind, prints) in self.database.kinds.iter().zip(self.prints) {
            let KindFace::Printed { sides: listed, .. } = &kind.face else {
                continue;
            };
            let near = |one: f64, other: f64| (one - other).abs() <= 2.0 * SIZE_TOLERANCE;
            let fits =
                near(size[0], listed[0]) && near(size[1], listed[1]) && kind.has_height(height);
            if !fits || contour.len() != 4 {
                continue;
            }
            if rectified.is_none() {
                rectified = Some(RectifiedFace::new(image, contour, sides)?);
            }
            let Some(face) = &rectified else { continue };
            for print in prints {
                let mut print = print.lock().unwrap_or_else(PoisonError::into_inner);
                let inliers = face.inliers(&mut print, self.parameters.ratio)?;
                let better = best.as_ref().is_none_or(|(_, most)| inliers > *most);
                if inliers >= self.parameters.min_inliers && better {
                    best = Some((kind.name.clone(), inliers));
                }
            }
        }
        Ok(best)
    }
}

/// Kind, shape and size of an outline.
pub(super) struct Named {
    pub(super) kind: String,
    pub(super) shape: Shape,
    /// Longer and shorter side or twice the diameter, m.
    pub(super) size: [f64; 2],
    /// Score that replaces that of the outline.
    pub(super) score: Option<f64>,
}

fn fits(value: f64, [low, high]: [f64; 2]) -> bool {
    (low - SIZE_TOLERANCE..=high + SIZE_TOLERANCE).contains(&value)
}

/// Returns the lengths of the sides of a polygon.
pub(super) fn sides(corners: &[[f64; 2]]) -> Vec<f64> {
    let ends = |index: usize| (corners[index], corners[(index + 1) % corners.len()]);
    (0..corners.len())
        .map(ends)
        .map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]))
        .collect()
}

/// Returns the direction of the longest side of a contour, rad, in -π/2..=π/2.
fn direction(contour: &[[f64; 2]]) -> f64 {
    let side = |index: usize| {
        let (a, b) = (contour[index], contour[(index + 1) % contour.len()]);
        [b[0] - a[0], b[1] - a[1]]
    };
    let longest = (0..contour.len())
        .map(side)
        .max_by(|one, other| one[0].hypot(one[1]).total_cmp(&other[0].hypot(other[1])));
    match longest {
        Some([dx, dy]) if dx != 0.0 => (dy / dx).atan(),
        _ => std::f64::consts::FRAC_PI_2,
    }
}
