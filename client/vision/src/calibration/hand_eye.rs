//! First solutions of the hand-eye calibration: five closed forms of OpenCV.
//!
//! The camera stands still and the hand carries the pattern, so OpenCV is given the inverse of the hand's poses and returns
//! the camera's pose in the world.

use nalgebra::{Matrix3, Rotation3, Vector3};
use opencv::calib3d::{HandEyeCalibrationMethod, calibrate_hand_eye};
use opencv::core::{Mat, MatTraitConst, Vector};

use super::calibration_error::at;
use super::transforms::{nearest_rotation, rotation_vector};
use super::{CalibrationError, HandEye, Result, View};
use crate::{CameraModel, Intrinsics, Pose};

/// Minimum number of views.
pub const MIN_VIEWS: usize = 4;
/// Minimum root mean square of the turns about a second axis, in rad.
const MIN_SECOND_TURN: f64 = 0.05;

/// A closed form of the hand-eye problem.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Method {
    /// Tsai and Lenz 1989.
    Tsai,
    /// Park and Martin 1994.
    Park,
    /// Horaud and Dornaika 1995.
    Horaud,
    /// Andreff, Horaud and Espiau 1999.
    Andreff,
    /// Daniilidis 1998: dual quaternions.
    Daniilidis,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 5] = [
        Self::Tsai,
        Self::Park,
        Self::Horaud,
        Self::Andreff,
        Self::Daniilidis,
    ];

    /// Returns the name for reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tsai => "tsai",
            Self::Park => "park",
            Self::Horaud => "horaud",
            Self::Andreff => "andreff",
            Self::Daniilidis => "daniilidis",
        }
    }

    fn code(self) -> HandEyeCalibrationMethod {
        match self {
            Self::Tsai => HandEyeCalibrationMethod::CALIB_HAND_EYE_TSAI,
            Self::Park => HandEyeCalibrationMethod::CALIB_HAND_EYE_PARK,
            Self::Horaud => HandEyeCalibrationMethod::CALIB_HAND_EYE_HORAUD,
            Self::Andreff => HandEyeCalibrationMethod::CALIB_HAND_EYE_ANDREFF,
            Self::Daniilidis => HandEyeCalibrationMethod::CALIB_HAND_EYE_DANIILIDIS,
        }
    }
}

/// Solves for the poses of the camera and of the pattern in the hand.
///
/// `grids`: pose of the pattern in the camera's frame of each view.
///
/// Errors: [`CalibrationError::TooFewImages`], [`CalibrationError::Degenerate`], [`CalibrationError::OpenCv`].
pub fn solve(
    method: Method,
    intrinsics: &Intrinsics,
    views: &[View],
    grids: &[Pose],
) -> Result<HandEye> {
    check_motions(views)?;
    let step = "solving the hand-eye problem";
    let parts = |poses: &mut dyn Iterator<Item = Pose>| -> Result<(Vector<Mat>, Vector<Mat>)> {
        let (mut turns, mut shifts) = (Vector::new(), Vector::new());
        for pose in poses {
            let r = pose.rotation;
            let row = |row: usize| [r[(row, 0)], r[(row, 1)], r[(row, 2)]];
            let shift = pose.translation.vector;
            turns.push(Mat::from_slice_2d(&[row(0), row(1), row(2)]).map_err(at(step))?);
            let column = [[shift.x], [shift.y], [shift.z]];
            shifts.push(Mat::from_slice_2d(&column).map_err(at(step))?);
        }
        Ok((turns, shifts))
    };
    let mut hands = views.iter().map(|view| view.hand_to_world.inverse());
    let (hand_turns, hand_shifts) = parts(&mut hands)?;
    let (grid_turns, grid_shifts) = parts(&mut grids.iter().copied())?;
    let (mut turn, mut shift) = (Mat::default(), Mat::default());
    calibrate_hand_eye(
        &hand_turns,
        &hand_shifts,
        &grid_turns,
        &grid_shifts,
        &mut turn,
        &mut shift,
        method.code(),
    )
    .map_err(at(step))?;
    let camera = pose_of(&turn, &shift)?.ok_or(CalibrationError::NotConverged { iterations: 0 })?;
    Ok(HandEye {
        camera: CameraModel {
            intrinsics: *intrinsics,
            pose: camera,
        },
        grid_to_hand: mean_grid(&camera, views, grids),
    })
}

/// Returns the pose of a rotation and a translation of OpenCV; `None` unless they are finite.
fn pose_of(turn: &Mat, shift: &Mat) -> Result<Option<Pose>> {
    let value = |mat: &Mat, row: usize, column: usize| {
        let found = mat.at_2d::<f64>(row as i32, column as i32);
        found.copied().map_err(at("reading a transform"))
    };
    let (mut matrix, mut vector) = (Matrix3::zeros(), Vector3::zeros());
    for row in 0..3 {
        for column in 0..3 {
            matrix[(row, column)] = value(turn, row, column)?;
        }
        vector[row] = value(shift, row, 0)?;
    }
    if !matrix
        .iter()
        .chain(vector.iter())
        .all(|value| value.is_finite())
    {
        return Ok(None);
    }
    let rotation = nearest_rotation(&matrix);
    Ok(rotation.map(|rotation| Pose::from_parts(vector.into(), rotation)))
}

/// Returns the mean of the pattern's poses in the hand that the views show.
fn mean_grid(camera: &Pose, views: &[View], grids: &[Pose]) -> Pose {
    let (mut turns, mut shifts) = (Matrix3::zeros(), Vector3::zeros());
    for (view, grid) in views.iter().zip(grids) {
        let pose = view.hand_to_world.inverse() * camera * grid;
        turns += pose.rotation.matrix();
        shifts += pose.translation.vector;
    }
    let rotation = nearest_rotation(&turns).unwrap_or_else(Rotation3::identity);
    Pose::from_parts((shifts / views.len() as f64).into(), rotation)
}

/// Checks that the hand turned about two axes: otherwise the transforms are not determined.
fn check_motions(views: &[View]) -> Result<()> {
    if views.len() < MIN_VIEWS {
        return Err(CalibrationError::TooFewImages {
            usable: views.len(),
            given: views.len(),
            expected: MIN_VIEWS,
        });
    }
    let (mut spread, mut count) = (Matrix3::zeros(), 0.0);
    for (index, view) in views.iter().enumerate() {
        for other in &views[..index] {
            let turn = other.hand_to_world.rotation.inverse() * view.hand_to_world.rotation;
            let turn = rotation_vector(&turn);
            spread += turn * turn.transpose();
            count += 1.0;
        }
    }
    let mut turns: Vec<f64> = spread.symmetric_eigenvalues().iter().copied().collect();
    turns.sort_by(f64::total_cmp);
    let root = |square: f64| (square.max(0.0) / count).sqrt();
    if root(turns[1]) >= MIN_SECOND_TURN {
        return Ok(());
    }
    let axes = if root(turns[2]) < MIN_SECOND_TURN {
        "any axis"
    } else {
        "a second axis"
    };
    Err(CalibrationError::Degenerate {
        axes,
        degrees: root(turns[1]).to_degrees(),
        expected: MIN_SECOND_TURN.to_degrees(),
    })
}
