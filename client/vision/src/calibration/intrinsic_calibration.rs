//! Intrinsic parameters and distortion from images of a pattern (Zhang's method, OpenCV's `calibrateCamera`).

use nalgebra::{Rotation3, Vector3};
use opencv::calib3d::{
    SOLVEPNP_ITERATIVE, calibrate_camera_extended_def, solve_pnp, solve_pnp_refine_lm_def,
};
use opencv::core::{
    Mat, MatTraitConst, MatTraitConstManual, Point2d, Point2f, Point3d, Point3f, Size, Vector,
};

use super::calibration_error::at;
use super::{CalibrationError, Pattern, Result};
use crate::{Intrinsics, Pose};

/// Minimum number of images: each gives two equations for five unknowns.
pub const MIN_IMAGES: usize = 3;
/// Multiple of the median error of all images above which an image is rejected.
const REJECTION_FACTOR: f64 = 2.5;

/// Intrinsic parameters, and how well they explain the images.
#[derive(Clone, Debug, PartialEq)]
pub struct IntrinsicsEstimate {
    /// The parameters.
    pub intrinsics: Intrinsics,
    /// Root mean square of the distance between a corner and its projection, over all images used, in pixels.
    pub rms: f64,
    /// Indices of the images used, and their RMS in pixels.
    pub used: Vec<(usize, f64)>,
    /// Indices of the rejected images, and their RMS in pixels when they were rejected.
    pub rejected: Vec<(usize, f64)>,
    /// Standard deviations of fx, fy, cx, cy, in pixels, as OpenCV estimates them.
    pub deviations: [f64; 4],
}

/// Estimates the intrinsic parameters from the corners of at least [`MIN_IMAGES`] images.
///
/// * `size`: columns and rows of the images.
/// * An image whose RMS is more than 2.5 times the median of all is rejected, worst first, and the rest estimated again.
///
/// Errors: [`CalibrationError::TooFewImages`], [`CalibrationError::OpenCv`].
pub fn calibrate_intrinsics(
    pattern: &Pattern,
    size: [usize; 2],
    images: &[&[[f64; 2]]],
) -> Result<IntrinsicsEstimate> {
    let mut used: Vec<usize> = (0..images.len()).collect();
    let mut rejected = Vec::new();
    loop {
        if used.len() < MIN_IMAGES {
            return Err(CalibrationError::TooFewImages {
                usable: used.len(),
                given: images.len(),
                expected: MIN_IMAGES,
            });
        }
        let chosen: Vec<_> = used.iter().map(|index| images[*index]).collect();
        let (mut estimate, errors) = estimate(pattern, size, &chosen)?;
        match worst(&errors).filter(|_| used.len() > MIN_IMAGES) {
            Some(place) => rejected.push((used.remove(place), errors[place])),
            None => {
                estimate.used = used.into_iter().zip(errors).collect();
                estimate.rejected = rejected;
                return Ok(estimate);
            }
        }
    }
}

/// Returns the place of the largest error, if it is out of proportion.
pub(super) fn worst(errors: &[f64]) -> Option<usize> {
    let mut ordered = errors.to_vec();
    ordered.sort_by(f64::total_cmp);
    let median = ordered.get(ordered.len() / 2)?;
    let place = (0..errors.len()).max_by(|one, other| errors[*one].total_cmp(&errors[*other]))?;
    (errors[place] > REJECTION_FACTOR * median).then_some(place)
}

fn estimate(
    pattern: &Pattern,
    size: [usize; 2],
    images: &[&[[f64; 2]]],
) -> Result<(IntrinsicsEstimate, Vec<f64>)> {
    let step = "estimating the intrinsic parameters";
    let corner =
        |point: nalgebra::Point3<f64>| Point3f::new(point.x as f32, point.y as f32, point.z as f32);
    let points: Vector<Point3f> = pattern.corners().into_iter().map(corner).collect();
    let pixels = |corners: &&[[f64; 2]]| -> Vector<Point2f> {
        let pixel = |[u, v]: &[f64; 2]| Point2f::new(*u as f32, *v as f32);
        corners.iter().map(pixel).collect()
    };
    let seen: Vector<Vector<Point2f>> = images.iter().map(pixels).collect();
    let points: Vector<Vector<Point3f>> = images.iter().map(|_| points.clone()).collect();
    let (mut matrix, mut distortion) = (Mat::default(), Mat::default());
    let (mut turns, mut moves) = (Mat::default(), Mat::default());
    let (mut inner, mut outer, mut errors) = (Mat::default(), Mat::default(), Mat::default());
    let rms = calibrate_camera_extended_def(
        &points,
        &seen,
        Size::new(size[0] as i32, size[1] as i32),
        &mut matrix,
        &mut distortion,
        &mut turns,
        &mut moves,
        &mut inner,
        &mut outer,
        &mut errors,
    )
    .map_err(at(step))?;
    let value = |mat: &Mat, row: i32, column: i32| -> Result<f64> {
        mat.at_2d::<f64>(row, column).copied().map_err(at(step))
    };
    let mut terms = [0.0; 5];
    let found = distortion.data_typed::<f64>().map_err(at(step))?;
    for (term, found) in terms.iter_mut().zip(found) {
        *term = *found;
    }
    let mut deviations = [0.0; 4];
    let found = inner.data_typed::<f64>().map_err(at(step))?;
    for (deviation, found) in deviations.iter_mut().zip(found) {
        *deviation = *found;
    }
    let errors = errors.data_typed::<f64>().map_err(at(step))?.to_vec();
    let intrinsics = Intrinsics {
        size,
        focal: [value(&matrix, 0, 0)?, value(&matrix, 1, 1)?],
        centre: [value(&matrix, 0, 2)?, value(&matrix, 1, 2)?],
        distortion: terms,
    };
    let estimate = IntrinsicsEstimate {
        intrinsics,
        rms,
        used: Vec::new(),
        rejected: Vec::new(),
        deviations,
    };
    Ok((estimate, errors))
}

/// Returns the pose of the pattern in the camera's frame that explains its corners best.
///
/// Errors: [`CalibrationError::OpenCv`] if the corners are those of no plane in front of the camera.
pub fn pattern_pose(
    pattern: &Pattern,
    intrinsics: &Intrinsics,
    corners: &[[f64; 2]],
) -> Result<Pose> {
    let step = "estimating the pose of the pattern";
    let corner = |point: nalgebra::Point3<f64>| Point3d::new(point.x, point.y, point.z);
    let points: Vector<Point3d> = pattern.corners().into_iter().map(corner).collect();
    let pixel = |[u, v]: &[f64; 2]| Point2d::new(*u, *v);
    let seen: Vector<Point2d> = corners.iter().map(pixel).collect();
    let ([fx, fy], [cx, cy]) = (intrinsics.focal, intrinsics.centre);
    let matrix = Mat::from_slice_2d(&[[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]);
    let matrix = matrix.map_err(at(step))?;
    let distortion: Vector<f64> = intrinsics.distortion.into_iter().collect();
    let (mut turn, mut shift) = (Vector::<f64>::new(), Vector::<f64>::new());
    let method = SOLVEPNP_ITERATIVE;
    solve_pnp(
        &points,
        &seen,
        &matrix,
        &distortion,
        &mut turn,
        &mut shift,
        false,
        method,
    )
    .map_err(at(step))?;
    solve_pnp_refine_lm_def(&points, &seen, &matrix, &distortion, &mut turn, &mut shift)
        .map_err(at(step))?;
    let vector =
        |values: Vector<f64>| Vector3::from_iterator(values.iter().chain([0.0; 3]).take(3));
    let (turn, shift) = (vector(turn), vector(shift));
    Ok(Pose::from_parts(shift.into(), Rotation3::new(turn)))
}
