//! Projection of a point into an image: pinhole, lens distortion, and the inverse.
//!
//! The simulated camera in `yarp-table` (`table_camera.rs`) has a projection of its own on purpose: client and simulator share no
//! code, so that an error in one of them shows as a wrong position instead of cancelling out.

use nalgebra::{Point3, Vector3};

use crate::Pose;

/// Bound on the fixed-point iterations that remove lens distortion.
const MAX_UNDISTORT_ITERATIONS: usize = 30;

/// A pinhole camera with OpenCV's distortion model.
///
/// With `x = X / Z`, `y = Y / Z` in the frame of the camera (x right, y down, z forward) and `r² = x² + y²`:
/// `x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)`,
/// `y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y`, `u = fx x' + cx`, `v = fy y' + cy`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Width and height of the image in pixels.
    pub size: [usize; 2],
    /// Focal lengths fx, fy in pixels.
    pub focal: [f64; 2],
    /// Principal point cx, cy in pixels.
    pub centre: [f64; 2],
    /// k1, k2, p1, p2, k3, in the order of OpenCV.
    pub distortion: [f64; 5],
}

impl Intrinsics {
    /// Returns the distorted place of an ideal one, both as multiples of the focal length.
    pub fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }

    /// Returns the ideal place of a distorted one, both as multiples of the focal length.
    pub fn undistort(&self, distorted: [f64; 2]) -> [f64; 2] {
        let mut ideal = distorted;
        for _ in 0..MAX_UNDISTORT_ITERATIONS {
            let there = self.distort(ideal);
            let error = [distorted[0] - there[0], distorted[1] - there[1]];
            ideal = [ideal[0] + error[0], ideal[1] + error[1]];
            if error[0].abs() + error[1].abs() < 1e-12 {
                break;
            }
        }
        ideal
    }

    /// Returns the pixel of a point in the frame of the camera; `None` if the point is not in front of the camera.
    pub fn project(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        if point.z <= 1e-9 {
            return None;
        }
        let [x, y] = self.distort([point.x / point.z, point.y / point.z]);
        Some([
            self.focal[0] * x + self.centre[0],
            self.focal[1] * y + self.centre[1],
        ])
    }

    /// Returns the direction of a pixel in the frame of the camera, with z = 1.
    pub fn direction(&self, [u, v]: [f64; 2]) -> Vector3<f64> {
        let [x, y] = self.undistort([
            (u - self.centre[0]) / self.focal[0],
            (v - self.centre[1]) / self.focal[1],
        ]);
        Vector3::new(x, y, 1.0)
    }

    /// Returns the pixel that a camera without distortion would show this pixel's content at.
    pub fn undistort_pixel(&self, pixel: [f64; 2]) -> [f64; 2] {
        let direction = self.direction(pixel);
        [
            self.focal[0] * direction.x + self.centre[0],
            self.focal[1] * direction.y + self.centre[1],
        ]
    }
}

/// A calibrated camera at its place: intrinsics and pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraModel {
    /// Focal length, principal point, distortion.
    pub intrinsics: Intrinsics,
    /// Pose of the camera's frame (x right, y down, z forward) in the base frame of the arm.
    pub pose: Pose,
}

impl CameraModel {
    /// Returns the pixel of a point of the arm's base frame; `None` if the point is not in front of the camera.
    pub fn project(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        self.intrinsics
            .project(&self.pose.inverse_transform_point(point))
    }

    /// Returns the point of the ray through a pixel at this depth along the optical axis, m, in the arm's base frame.
    pub fn at_depth(&self, pixel: [f64; 2], depth: f64) -> Point3<f64> {
        self.pose * Point3::from(self.intrinsics.direction(pixel) * depth)
    }

    /// Returns the intersection of the ray through a pixel with the horizontal plane at `height` m of the arm's base
    /// frame; `None` if the ray does not reach the plane.
    pub fn on_plane(&self, pixel: [f64; 2], height: f64) -> Option<Point3<f64>> {
        let direction = self.pose.rotation * self.intrinsics.direction(pixel);
        let origin = Point3::from(self.pose.translation.vector);
        let distance = (height - origin.z) / direction.z;
        (distance.is_finite() && distance > 0.0).then(|| origin + direction * distance)
    }
}
