//! The error reports of a calibration: Tables 7 and 8 of the thesis.

use nalgebra::{Point3, Vector2};

use super::transforms::{back_project, rotation_vector};
use super::{HandEye, Pattern, View};
use crate::Pose;

/// Errors of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewErrors {
    /// Name of the image.
    pub name: String,
    /// Back-projection error: root mean square over the corners, in mm.
    pub back_projection: f64,
    /// The same in the image, in pixels, with the measured pose of the hand.
    pub pixels: f64,
    /// Root mean square in pixels if the pose of the pattern is fitted to the image: the error of the image alone.
    pub image_pixels: f64,
}

/// Mean square of a kind of error, and its largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Root mean square.
    pub rms: f64,
    /// Largest value.
    pub max: f64,
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let (mut sum, mut count, mut max) = (0.0, 0_u32, 0.0_f64);
        for value in values {
            sum += value * value;
            count += 1;
            max = max.max(value);
        }
        Self {
            rms: (sum / f64::from(count.max(1))).sqrt(),
            max,
        }
    }
}

/// Error of a pose under one assumption about its cause (Table 8b).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseErrors {
    /// Position, in mm.
    pub position: Spread,
    /// Orientation, in degrees.
    pub angle: Spread,
}

/// Errors of a hand-eye calibration over a set of views.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorReport {
    /// Root mean square of the back-projection error, in mm (Table 7).
    ///
    /// Each pixel of a corner is back-projected to the depth of the corner (equations 8 and 9); its error is the distance to
    /// where the measured pose of the hand has the corner.
    pub back_projection: f64,
    /// Root mean square of the same in the image, in pixels.
    pub pixels: f64,
    /// Error of each corner of each image in pixels, right and down, with the pattern's pose fitted to the image: Figure 33.
    pub image_errors: Vec<[f64; 2]>,
    /// Root mean square of the length of those, in pixels (Table 8a).
    pub image_pixels: f64,
    /// Errors if the base of the arm is exact and the tool's pose is wrong (Table 8b).
    pub in_tool: PoseErrors,
    /// Errors if the tool is exact and the base of the arm is wrong (Table 8b).
    pub in_base: PoseErrors,
    /// Each view.
    pub views: Vec<ViewErrors>,
}

/// Measures a calibration with a set of views.
///
/// `grids`: pose of the pattern in the camera's frame of each view, fitted to its image.
pub fn measure(
    hand_eye: &HandEye,
    pattern: &Pattern,
    views: &[View],
    grids: &[Pose],
) -> ErrorReport {
    let corners = pattern.corners();
    let mut all = Vec::with_capacity(views.len());
    let mut image_errors = Vec::new();
    for (view, grid) in views.iter().zip(grids) {
        let fitted = pixel_errors(hand_eye, &corners, view, grid);
        let predicted = hand_eye.grid_to_camera(&view.hand_to_world);
        all.push(ViewErrors {
            name: view.name.clone(),
            back_projection: rms(&lateral_errors(hand_eye, &corners, view, &predicted)) * 1e3,
            pixels: rms(&pixel_errors(hand_eye, &corners, view, &predicted)),
            image_pixels: rms(&fitted),
        });
        image_errors.extend(fitted.iter().map(|error| [error.x, error.y]));
    }
    let pairs = || {
        let poses = views.iter().zip(grids);
        poses.map(|(view, grid)| (view.hand_to_world, hand_eye.hand_to_world(grid)))
    };
    let in_tool = pairs().map(|(measured, seen)| measured.inverse() * seen);
    let in_base = pairs().map(|(measured, seen)| seen * measured.inverse());
    ErrorReport {
        back_projection: root_mean(all.iter().map(|view| view.back_projection)),
        pixels: root_mean(all.iter().map(|view| view.pixels)),
        image_pixels: root_mean(all.iter().map(|view| view.image_pixels)),
        image_errors,
        in_tool: pose_errors(in_tool),
        in_base: pose_errors(in_base),
        views: all,
    }
}

/// Returns the root mean square of the distances, in mm, between points of the world and where the camera locates their pixels
/// at their depth.
pub fn location_error(hand_eye: &HandEye, points: &[(Point3<f64>, [f64; 2])]) -> f64 {
    let distance = |(point, pixel): &(Point3<f64>, [f64; 2])| {
        let depth = hand_eye.camera.pose.inverse_transform_point(point).z;
        (hand_eye.camera.at_depth(*pixel, depth) - point).norm()
    };
    root_mean(points.iter().map(distance)) * 1e3
}

/// Returns the error of each corner at its depth, right and down, in m.
fn lateral_errors(
    hand_eye: &HandEye,
    corners: &[Point3<f64>],
    view: &View,
    pose: &Pose,
) -> Vec<Vector2<f64>> {
    let error = |(corner, pixel): (&Point3<f64>, &[f64; 2])| {
        let expected = pose * corner;
        (back_project(&hand_eye.camera.intrinsics, *pixel, expected.z) - expected).xy()
    };
    corners.iter().zip(&view.corners).map(error).collect()
}

/// Returns the error of each corner in the image, right and down, in pixels; infinite behind the camera.
fn pixel_errors(
    hand_eye: &HandEye,
    corners: &[Point3<f64>],
    view: &View,
    pose: &Pose,
) -> Vec<Vector2<f64>> {
    let error = |(corner, pixel): (&Point3<f64>, &[f64; 2])| {
        let expected = hand_eye.camera.intrinsics.project(&(pose * corner));
        expected.map_or(Vector2::repeat(f64::INFINITY), |[u, v]| {
            Vector2::new(pixel[0] - u, pixel[1] - v)
        })
    };
    corners.iter().zip(&view.corners).map(error).collect()
}

fn pose_errors(errors: impl Iterator<Item = Pose> + Clone) -> PoseErrors {
    let lengths = errors
        .clone()
        .map(|error| error.translation.vector.norm() * 1e3);
    PoseErrors {
        position: Spread::of(lengths),
        angle: Spread::of(errors.map(|error| rotation_vector(&error.rotation).norm().to_degrees())),
    }
}

fn rms(errors: &[Vector2<f64>]) -> f64 {
    root_mean(errors.iter().map(|error| error.norm()))
}

fn root_mean(values: impl Iterator<Item = f64>) -> f64 {
    Spread::of(values).rms
}
