//! Detection of a camera that has moved since its calibration.

use opencv::calib3d::{RANSAC, estimate_affine_partial_2d};
use opencv::core::{
    CV_32F, Mat, MatTraitConst, Point, Point2f, Rect, Size, Vector, mean_def, min_max_loc,
    no_array, subtract_def,
};
use opencv::imgproc::{
    TM_CCOEFF_NORMED, gaussian_blur_def, good_features_to_track, match_template_def,
};

use super::calibration_error::at;
use super::chessboard::check_light;
use super::{CalibrationError, Result};
use crate::{Image, Intrinsics, mat};

/// Columns and rows of tiles of the reference image, and maximum number of points of each that are looked for.
const TILES: [i32; 2] = [8, 6];
const POINTS_PER_TILE: i32 = 3;
/// Distance between two of them as part of the width of the image.
const SPACING: f64 = 0.03;
/// Quality of the weakest point of a tile relative to the strongest.
const MIN_QUALITY: f64 = 0.02;
/// Half the side of what is compared around a point, in pixels.
const PATCH: i32 = 20;
/// Largest displacement that is measured, in pixels.
const MAX_DISPLACEMENT: i32 = 40;
/// Smallest correlation of a point that is found again.
const MIN_CORRELATION: f32 = 0.6;
/// Standard deviation of the blur against noise, in pixels.
const NOISE_BLUR: f64 = 1.5;
/// Standard deviation of the blur that leaves differences of brightness only, in pixels. They are subtracted: shadows of an arm move, and what is
/// finer is the same within them and outside.
const SHADE_BLUR: f64 = 8.0;
/// Mean grey level below which an image without contrast is that of a covered lens.
const DARK: f64 = 20.0;
/// Minimum number of points that must agree on one displacement.
const MIN_MATCHES: usize = 12;
/// Largest distance of a point from the common displacement, in pixels.
const AGREEMENT: f64 = 1.5;
/// Distance within which a point has not moved, in pixels.
const MAX_UNMOVED: f64 = 1.0;
/// Smallest share of points that have not moved which contradicts a displacement: on a table without a pattern some of the others agree on one by
/// chance. Of 1 080 images of a camera at rest at least 27 % were so, of 120 of one that had moved by 2.4 to 3.6 pixels at most 13 %.
const MIN_UNMOVED: f64 = 0.2;
/// Share of the points from which on nothing contradicts them. Most of a camera's own displacement has more.
const MAJORITY: f64 = 0.5;

/// An image of the static scene, taken when the camera was calibrated.
///
/// Objects on the table may come and go, and the arm may hide a part: only what agrees on one displacement counts.
#[derive(Debug)]
pub struct CameraReference {
    points: Vec<[i32; 2]>,
    image: SceneImage,
}

/// An image that is prepared for comparison.
#[derive(Debug)]
pub(super) struct SceneImage {
    /// The image without the finest noise.
    grey: Mat,
    /// Its structure, without differences of brightness from place to place.
    detail: Mat,
    size: [usize; 2],
    /// Name in errors.
    name: &'static str,
}

/// Displacement of the static scene in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// Largest displacement of the middle and of the four points halfway to the corners, in pixels.
    pub pixels: f64,
    /// Number of points that agree on it.
    pub matches: usize,
    /// Displacement of each of these five.
    pub(super) shifts: Shifts,
}

/// Displacements of the middle of an image and of the four points halfway to its corners, in pixels.
pub(super) type Shifts = [[f64; 2]; 5];

/// Returns the length of the largest displacement, in pixels.
pub(super) fn largest(shifts: &Shifts) -> f64 {
    let lengths = shifts.iter().map(|[x, y]| x.hypot(*y));
    lengths.fold(0.0, f64::max)
}

impl CameraReference {
    /// Remembers the static scene of an image.
    ///
    /// Errors: [`CalibrationError::Covered`], [`CalibrationError::SceneNotRecognised`] if the scene has too few distinct
    /// points.
    pub fn new(image: &Image) -> Result<Self> {
        Self::of(SceneImage::new(image, "the reference image")?)
    }

    /// Remembers the static scene of a prepared image.
    ///
    /// Errors: those of [`new`](Self::new).
    pub(super) fn of(image: SceneImage) -> Result<Self> {
        let points = distinct_points(&image.detail)?;
        if points.len() < MIN_MATCHES {
            return Err(image.unrecognised(points.len()));
        }
        Ok(Self { points, image })
    }

    /// Prepares an image of the same camera for [`displacement_in`](Self::displacement_in).
    ///
    /// Errors: [`CalibrationError::Covered`], [`CalibrationError::Size`].
    pub(super) fn prepare(&self, image: &Image) -> Result<SceneImage> {
        let [expected_width, expected_height] = self.image.size;
        let (width, height) = (image.width(), image.height());
        if [width, height] != self.image.size {
            return Err(CalibrationError::Size {
                image: "the image".to_owned(),
                width,
                height,
                expected_width,
                expected_height,
            });
        }
        SceneImage::new(image, "the image")
    }

    /// Returns how far the static scene has moved in another image.
    ///
    /// Errors: [`CalibrationError::Covered`], [`CalibrationError::SceneNotRecognised`], [`CalibrationError::Size`].
    pub fn displacement(&self, image: &Image) -> Result<Displacement> {
        self.displacement_in(&self.prepare(image)?)
    }

    /// Returns how far the static scene has moved in an image of [`prepare`](Self::prepare).
    ///
    /// Errors: those of [`displacement`](Self::displacement).
    pub(super) fn displacement_in(&self, image: &SceneImage) -> Result<Displacement> {
        let (mut from, mut to) = (Vector::<Point2f>::new(), Vector::<Point2f>::new());
        for point in &self.points {
            if let Some(found) = self.find_again(&image.detail, *point)? {
                from.push(Point2f::new(point[0] as f32, point[1] as f32));
                to.push(found);
            }
        }
        if from.len() < MIN_MATCHES {
            return Err(image.unrecognised(from.len()));
        }
        let mut mask = Vector::<u8>::new();
        let motion =
            estimate_affine_partial_2d(&from, &to, &mut mask, RANSAC, AGREEMENT, 2000, 0.999, 10);
        let motion = motion.map_err(at("comparing with the reference image"))?;
        let matches = mask.iter().filter(|agrees| *agrees != 0).count();
        if matches < MIN_MATCHES || motion.empty() {
            return Err(image.unrecognised(matches));
        }
        let shifts = shifts(&motion, image.size)?;
        let unmoved = count_unmoved(&from, &to);
        if is_chance(&shifts, matches, unmoved, from.len()) {
            return Ok(Displacement {
                pixels: 0.0,
                matches: unmoved,
                shifts: Shifts::default(),
            });
        }
        Ok(Displacement {
            pixels: largest(&shifts),
            matches,
            shifts,
        })
    }

    /// Returns the number of points that are looked for.
    pub(super) fn points(&self) -> usize {
        self.points.len()
    }

    /// Checks that the camera is where it was when it was calibrated: to be called before an image is used to move the arm.
    ///
    /// * `tolerance`: largest displacement, in pixels; 2 are usual.
    /// * `distance`: from the camera to the table, in m, for the message.
    ///
    /// Errors: those of [`displacement`](Self::displacement), [`CalibrationError::CameraMoved`]. In any case nothing should
    /// move before the camera is calibrated again.
    pub fn check(
        &self,
        image: &Image,
        intrinsics: &Intrinsics,
        tolerance: f64,
        distance: f64,
    ) -> Result<Displacement> {
        let found = self.displacement(image)?;
        check_pixels(found.pixels, intrinsics, tolerance, distance)?;
        Ok(found)
    }

    /// Returns where the surroundings of a point of the reference are in another image.
    fn find_again(&self, detail: &Mat, [x, y]: [i32; 2]) -> Result<Option<Point2f>> {
        let step = "comparing with the reference image";
        let around = |reach: i32| Rect::new(x - reach, y - reach, 2 * reach + 1, 2 * reach + 1);
        let patch = self.image.detail.roi(around(PATCH)).map_err(at(step))?;
        let window = detail
            .roi(around(PATCH + MAX_DISPLACEMENT))
            .map_err(at(step))?;
        let mut scores = Mat::default();
        match_template_def(&window, &patch, &mut scores, TM_CCOEFF_NORMED).map_err(at(step))?;
        let mut best = Point::default();
        min_max_loc(&scores, None, None, None, Some(&mut best), &no_array()).map_err(at(step))?;
        let score = |dx: i32, dy: i32| -> Result<f32> {
            let place = scores.at_2d::<f32>(best.y + dy, best.x + dx);
            place.copied().map_err(at(step))
        };
        let inside = |value: i32| (1..2 * MAX_DISPLACEMENT).contains(&value);
        let top = score(0, 0)?;
        // A maximum at the border is none; neither is one of a uniform patch.
        if !(inside(best.x) && inside(best.y) && top >= MIN_CORRELATION) {
            return Ok(None);
        }
        let peak = |before: f32, after: f32| {
            let curve = before - 2.0 * top + after;
            if curve < 0.0 {
                0.5 * (before - after) / curve
            } else {
                0.0
            }
        };
        let right = peak(score(-1, 0)?, score(1, 0)?);
        let down = peak(score(0, -1)?, score(0, 1)?);
        let place =
            |start: i32, shift: i32, part: f32| (start + shift - MAX_DISPLACEMENT) as f32 + part;
        Ok(Some(Point2f::new(
            place(x, best.x, right),
            place(y, best.y, down),
        )))
    }
}

impl SceneImage {
    /// Prepares an image.
    ///
    /// Errors: [`CalibrationError::Covered`] for one of a sensor in the dark, whose noise has points everywhere.
    fn new(image: &Image, name: &'static str) -> Result<Self> {
        let grey = mat::grey_of_image(image).map_err(|error| CalibrationError::Image {
            image: name.to_owned(),
            source: Box::new(error),
        })?;
        let step = "blurring an image";
        let mut exact = Mat::default();
        grey.convert_to_def(&mut exact, CV_32F).map_err(at(step))?;
        let blur = |by: f64| -> Result<Mat> {
            let mut smooth = Mat::default();
            gaussian_blur_def(&exact, &mut smooth, Size::new(0, 0), by).map_err(at(step))?;
            Ok(smooth)
        };
        let smooth = blur(NOISE_BLUR)?;
        if mean_def(&smooth).map_err(at("measuring the brightness"))?[0] < DARK {
            check_light(&smooth, name)?;
        }
        let mut detail = Mat::default();
        subtract_def(&smooth, &blur(SHADE_BLUR)?, &mut detail).map_err(at(step))?;
        Ok(Self {
            grey: smooth,
            detail,
            size: [image.width(), image.height()],
            name,
        })
    }

    /// Returns the reason why too few points were found: a cover on the lens, if the image is uniform. An empty table may be so, too, and
    /// be recognised all the same.
    fn unrecognised(&self, matches: usize) -> CalibrationError {
        let expected = MIN_MATCHES;
        let otherwise = CalibrationError::SceneNotRecognised { matches, expected };
        check_light(&self.grey, self.name)
            .err()
            .unwrap_or(otherwise)
    }
}

/// Returns points whose surroundings are distinct in both directions, away from the border: the strongest ones of each tile.
///
/// The strongest ones of the whole image would be those of objects, which leave, and none of the table below them.
fn distinct_points(detail: &Mat) -> Result<Vec<[i32; 2]>> {
    let step = "finding points of the scene";
    let reach = PATCH + MAX_DISPLACEMENT;
    let spacing = SPACING * f64::from(detail.cols());
    let [columns, rows] = TILES;
    let (width, height) = (detail.cols() - 2 * reach, detail.rows() - 2 * reach);
    let mut points = Vec::new();
    if width < columns || height < rows {
        return Ok(points);
    }
    for tile in 0..columns * rows {
        let (column, row) = (tile % columns, tile / columns);
        let edge = |index: i32, count: i32, length: i32| reach + index * length / count;
        let (left, top) = (edge(column, columns, width), edge(row, rows, height));
        let right = edge(column + 1, columns, width);
        let bottom = edge(row + 1, rows, height);
        let part = detail.roi(Rect::new(left, top, right - left, bottom - top));
        let mut corners = Vector::<Point2f>::new();
        good_features_to_track(
            &part.map_err(at(step))?,
            &mut corners,
            POINTS_PER_TILE,
            MIN_QUALITY,
            spacing,
            &no_array(),
            9,
            false,
            0.04,
        )
        .map_err(at(step))?;
        let in_image = |corner: Point2f| {
            [
                left + corner.x.round() as i32,
                top + corner.y.round() as i32,
            ]
        };
        points.extend(corners.iter().map(in_image));
    }
    Ok(points)
}

/// Refuses a displacement above the tolerance, both in pixels.
pub(super) fn check_pixels(
    pixels: f64,
    intrinsics: &Intrinsics,
    tolerance: f64,
    distance: f64,
) -> Result<()> {
    if pixels <= tolerance {
        return Ok(());
    }
    Err(CalibrationError::CameraMoved {
        pixels,
        millimetres: pixels / intrinsics.focal[0] * distance * 1e3,
        tolerance,
    })
}

/// Returns the number of points that are where they were.
fn count_unmoved(from: &Vector<Point2f>, to: &Vector<Point2f>) -> usize {
    let is_near =
        |(from, to): &(Point2f, Point2f)| (from.x - to.x).hypot(from.y - to.y) < MAX_UNMOVED as f32;
    from.iter().zip(to.iter()).filter(is_near).count()
}

/// Returns whether a displacement on which a minority of the points agrees is contradicted by those that are where they were.
fn is_chance(shifts: &Shifts, matches: usize, unmoved: usize, all: usize) -> bool {
    let share = |count: usize| count as f64 / all.max(1) as f64;
    largest(shifts) > MAX_UNMOVED && share(matches) < MAJORITY && share(unmoved) >= MIN_UNMOVED
}

fn shifts(motion: &Mat, [width, height]: [usize; 2]) -> Result<Shifts> {
    let value = |row: i32, column: i32| -> Result<f64> {
        let found = motion.at_2d::<f64>(row, column);
        found.copied().map_err(at("reading a displacement"))
    };
    let mut shifts = Shifts::default();
    let parts = [
        (0.5, 0.5),
        (0.25, 0.25),
        (0.75, 0.25),
        (0.25, 0.75),
        (0.75, 0.75),
    ];
    for (shift, (x, y)) in shifts.iter_mut().zip(parts) {
        let (x, y) = (x * width as f64, y * height as f64);
        let row = |row: i32| -> Result<f64> {
            Ok(value(row, 0)? * x + value(row, 1)? * y + value(row, 2)?)
        };
        *shift = [row(0)? - x, row(1)? - y];
    }
    Ok(shifts)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A demo ended on an empty table, as if the camera had moved.
    #[test]
    fn points_that_are_where_they_were_outvote_a_minority() {
        let aside = |pixels: f64| [[pixels, 0.0]; 5];
        assert!(is_chance(&aside(2.8), 44, 20, 100));
        // Too few of them, a majority, and what is no displacement.
        assert!(!is_chance(&aside(2.8), 44, 19, 100));
        assert!(!is_chance(&aside(2.8), 50, 30, 100));
        assert!(!is_chance(&aside(0.9), 44, 56, 100));
        assert!(!is_chance(&aside(20.0), 75, 25, 100));
    }

    #[test]
    fn a_point_within_a_pixel_is_where_it_was() {
        let points = |places: [f32; 3]| places.map(|x| Point2f::new(x, 5.0));
        let from: Vector<Point2f> = points([10.0, 20.0, 30.0]).into_iter().collect();
        let to: Vector<Point2f> = points([10.9, 18.9, 30.0]).into_iter().collect();
        assert_eq!(count_unmoved(&from, &to), 2);
    }
}
