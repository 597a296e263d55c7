//! Detection of a camera that has moved since its calibration.

use opencv::calib3d::{RANSAC, find_homography};
use opencv::core::{
    DMatch, KeyPoint, KeyPointTraitConst, Mat, MatTraitConst, NORM_HAMMING, Point2f, Vector,
    no_array,
};
use opencv::features2d::{
    BFMatcher, DescriptorMatcherTraitConst, Feature2DTrait, ORB, ORB_ScoreType,
};

use super::chessboard::check_light;
use super::error::at;
use super::{CalibrationError, Result};
use crate::{Image, Intrinsics, mat};

/// Number of points of the reference image that are looked for.
const POINTS: i32 = 3000;
/// Minimum number of points that must agree on one displacement.
const MIN_MATCHES: usize = 25;
/// Largest distance of a point from the common displacement, in pixels.
const AGREEMENT: f64 = 2.0;

/// An image of the static scene, taken when the camera was calibrated.
///
/// Objects on the table may come and go, and the arm may hide a part: only what agrees on one displacement counts.
#[derive(Debug)]
pub struct CameraReference {
    points: Vector<KeyPoint>,
    descriptors: Mat,
    size: [usize; 2],
}

/// Displacement of the static scene in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// Largest displacement of the middle and of the four points halfway to the corners, in pixels.
    pub pixels: f64,
    /// Number of points that agree on it.
    pub matches: usize,
}

impl CameraReference {
    /// Remembers the static scene of an image.
    ///
    /// Errors: [`CalibrationError::Covered`], [`CalibrationError::SceneNotRecognised`] if the scene has too few distinct
    /// points.
    pub fn new(image: &Image) -> Result<Self> {
        let (points, descriptors) = features(image, "the reference image")?;
        let size = [image.width(), image.height()];
        if points.len() < MIN_MATCHES {
            return Err(CalibrationError::SceneNotRecognised {
                matches: points.len(),
                expected: MIN_MATCHES,
            });
        }
        Ok(Self {
            points,
            descriptors,
            size,
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
        let (points, descriptors) = features(image, "the image")?;
        let (from, to) = self.matches(&points, &descriptors)?;
        let unrecognised = |matches| CalibrationError::SceneNotRecognised {
            matches,
            expected: MIN_MATCHES,
        };
        if from.len() < MIN_MATCHES {
            return Err(unrecognised(from.len()));
        }
        let mut mask = Vector::<u8>::new();
        let homography = find_homography(&from, &to, &mut mask, RANSAC, AGREEMENT)
            .map_err(at("comparing with the reference image"))?;
        let matches = mask.iter().filter(|agrees| *agrees != 0).count();
        if matches < MIN_MATCHES || homography.empty() {
            return Err(unrecognised(matches));
        }
        let pixels = largest_displacement(&homography, self.size)?;
        Ok(Displacement { pixels, matches })
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
        if found.pixels <= tolerance {
            return Ok(found);
        }
        Err(CalibrationError::CameraMoved {
            pixels: found.pixels,
            millimetres: found.pixels / intrinsics.focal[0] * distance * 1e3,
            tolerance,
        })
    }

    fn matches(
        &self,
        points: &Vector<KeyPoint>,
        descriptors: &Mat,
    ) -> Result<(Vector<Point2f>, Vector<Point2f>)> {
        let step = "comparing with the reference image";
        let (mut from, mut to) = (Vector::new(), Vector::new());
        if points.is_empty() {
            return Ok((from, to));
        }
        let matcher = BFMatcher::new(NORM_HAMMING, true).map_err(at(step))?;
        let mut pairs = Vector::<DMatch>::new();
        matcher
            .train_match(&self.descriptors, descriptors, &mut pairs, &no_array())
            .map_err(at(step))?;
        for pair in pairs {
            from.push(
                self.points
                    .get(pair.query_idx as usize)
                    .map_err(at(step))?
                    .pt(),
            );
            to.push(points.get(pair.train_idx as usize).map_err(at(step))?.pt());
        }
        Ok((from, to))
    }
}

fn features(image: &Image, name: &str) -> Result<(Vector<KeyPoint>, Mat)> {
    let step = "finding points of the scene";
    let grey = mat::grey_of_image(image).map_err(|error| CalibrationError::Image {
        image: name.to_owned(),
        source: Box::new(error),
    })?;
    check_light(&grey, name)?;
    let score = ORB_ScoreType::HARRIS_SCORE;
    let mut detector = ORB::create(POINTS, 1.2, 4, 31, 0, 2, score, 31, 8).map_err(at(step))?;
    let (mut points, mut descriptors) = (Vector::new(), Mat::default());
    detector
        .detect_and_compute(&grey, &no_array(), &mut points, &mut descriptors, false)
        .map_err(at(step))?;
    Ok((points, descriptors))
}

fn largest_displacement(homography: &Mat, [width, height]: [usize; 2]) -> Result<f64> {
    let value = |row: i32, column: i32| -> Result<f64> {
        let found = homography.at_2d::<f64>(row, column);
        found.copied().map_err(at("reading a displacement"))
    };
    let mut largest = 0.0_f64;
    for (x, y) in [
        (0.5, 0.5),
        (0.25, 0.25),
        (0.75, 0.25),
        (0.25, 0.75),
        (0.75, 0.75),
    ] {
        let (x, y) = (x * width as f64, y * height as f64);
        let row = |row: i32| -> Result<f64> {
            Ok(value(row, 0)? * x + value(row, 1)? * y + value(row, 2)?)
        };
        let scale = row(2)?;
        largest = largest.max((row(0)? / scale - x).hypot(row(1)? / scale - y));
    }
    Ok(largest)
}
