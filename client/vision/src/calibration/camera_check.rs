//! Detection of a camera that has moved since its calibration.

use opencv::calib3d::{RANSAC, estimate_affine_partial_2d};
use opencv::core::{Mat, MatTraitConst, Point, Point2f, Rect, Size, Vector, min_max_loc, no_array};
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
const BLUR: f64 = 1.5;
/// Minimum number of points that must agree on one displacement.
const MIN_MATCHES: usize = 12;
/// Largest distance of a point from the common displacement, in pixels.
const AGREEMENT: f64 = 1.5;

/// An image of the static scene, taken when the camera was calibrated.
///
/// Objects on the table may come and go, and the arm may hide a part: only what agrees on one displacement counts.
#[derive(Debug)]
pub struct CameraReference {
    points: Vec<[i32; 2]>,
    grey: Mat,
    size: [usize; 2],
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
        let grey = blurred(image, "the reference image")?;
        let points = distinct_points(&grey)?;
        if points.len() < MIN_MATCHES {
            return Err(unrecognised(points.len(), &grey, "the reference image"));
        }
        Ok(Self {
            points,
            grey,
            size: [image.width(), image.height()],
        })
    }

    /// Returns how far the static scene has moved in another image.
    ///
    /// Errors: [`CalibrationError::Covered`], [`CalibrationError::SceneNotRecognised`], [`CalibrationError::Size`].
    pub fn displacement(&self, image: &Image) -> Result<Displacement> {
        let [expected_width, expected_height] = self.size;
        let (width, height) = (image.width(), image.height());
        if [width, height] != self.size {
            return Err(CalibrationError::Size {
                image: "the image".to_owned(),
                width,
                height,
                expected_width,
                expected_height,
            });
        }
        let grey = blurred(image, "the image")?;
        let (mut from, mut to) = (Vector::<Point2f>::new(), Vector::<Point2f>::new());
        for point in &self.points {
            if let Some(found) = self.find_again(&grey, *point)? {
                from.push(Point2f::new(point[0] as f32, point[1] as f32));
                to.push(found);
            }
        }
        let unrecognised = |matches| unrecognised(matches, &grey, "the image");
        if from.len() < MIN_MATCHES {
            return Err(unrecognised(from.len()));
        }
        let mut mask = Vector::<u8>::new();
        let motion =
            estimate_affine_partial_2d(&from, &to, &mut mask, RANSAC, AGREEMENT, 2000, 0.999, 10);
        let motion = motion.map_err(at("comparing with the reference image"))?;
        let matches = mask.iter().filter(|agrees| *agrees != 0).count();
        if matches < MIN_MATCHES || motion.empty() {
            return Err(unrecognised(matches));
        }
        let shifts = shifts(&motion, self.size)?;
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
    fn find_again(&self, grey: &Mat, [x, y]: [i32; 2]) -> Result<Option<Point2f>> {
        let step = "comparing with the reference image";
        let around = |reach: i32| Rect::new(x - reach, y - reach, 2 * reach + 1, 2 * reach + 1);
        let patch = self.grey.roi(around(PATCH)).map_err(at(step))?;
        let window = grey
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

/// Returns an image in grey, without the finest noise.
fn blurred(image: &Image, name: &str) -> Result<Mat> {
    let grey = mat::grey_of_image(image).map_err(|error| CalibrationError::Image {
        image: name.to_owned(),
        source: Box::new(error),
    })?;
    let mut smooth = Mat::default();
    gaussian_blur_def(&grey, &mut smooth, Size::new(0, 0), BLUR)
        .map_err(at("blurring an image"))?;
    Ok(smooth)
}

/// Returns the reason why too few points were found: a cover on the lens, if the image is uniform. An empty table may be so, too, and
/// be recognised all the same.
fn unrecognised(matches: usize, grey: &Mat, name: &str) -> CalibrationError {
    let expected = MIN_MATCHES;
    let otherwise = CalibrationError::SceneNotRecognised { matches, expected };
    check_light(grey, name).err().unwrap_or(otherwise)
}

/// Returns points whose surroundings are distinct in both directions, away from the border: the strongest ones of each tile.
///
/// The strongest ones of the whole image would be those of objects, which leave, and none of the table below them.
fn distinct_points(grey: &Mat) -> Result<Vec<[i32; 2]>> {
    let step = "finding points of the scene";
    let reach = PATCH + MAX_DISPLACEMENT;
    let spacing = SPACING * f64::from(grey.cols());
    let [columns, rows] = TILES;
    let (width, height) = (grey.cols() - 2 * reach, grey.rows() - 2 * reach);
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
        let part = grey.roi(Rect::new(left, top, right - left, bottom - top));
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
