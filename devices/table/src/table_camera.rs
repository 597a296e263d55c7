//! Projection of a point of the scene into the image: pinhole, lens distortion, and the inverse.
//!
//! `yarp-vision` (`intrinsics.rs`) has a projection of its own on purpose: client and simulator share no code, so that an error in
//! one of them shows as a wrong position instead of cancelling out.

use nalgebra::{Matrix3, Point3, Rotation3, Translation3, Vector3};

use crate::Pose;

/// A pinhole camera with OpenCV's distortion model; pixel centres have whole coordinates.
///
/// With `x = X / Z`, `y = Y / Z` in the camera's frame (x right, y down, z forward) and `r² = x² + y²`:
/// `x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)`,
/// `y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y`, `u = fx x' + cx`, `v = fy y' + cy`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal lengths in pixels.
    pub focal: [f64; 2],
    /// Principal point in pixels.
    pub centre: [f64; 2],
    /// k1, k2, p1, p2, k3, the order of OpenCV.
    pub distortion: [f64; 5],
}

/// Pixels of the Flea2's sensor (Sony ICX445), and their size, m (section 3.3 of the thesis).
const FLEA_SIZE: [usize; 2] = [1288, 964];
const FLEA_PIXEL: f64 = 3.75e-6;
/// Focal length found by calibration, m (section 6.4.2).
const FLEA_FOCAL: f64 = 6.11e-3;
/// Distortion as usual for a lens of 6 mm; the thesis prints none.
const FLEA_DISTORTION: [f64; 5] = [-0.10, 0.08, 0.0006, -0.0004, 0.0];

impl Lens {
    /// Returns the thesis's Flea2 with its 6.11 mm lens: 1288 x 964 pixels of 3.75 um.
    pub fn flea2() -> Self {
        let focal = FLEA_FOCAL / FLEA_PIXEL;
        let [width, height] = FLEA_SIZE;
        Self {
            width,
            height,
            focal: [focal, focal],
            centre: [(width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0],
            distortion: FLEA_DISTORTION,
        }
    }

    /// Returns a depth sensor of structured light: 640 x 480, 525 pixels (values usual for such sensors).
    pub fn depth_sensor() -> Self {
        Self {
            width: 640,
            height: 480,
            focal: [525.0, 525.0],
            centre: [319.5, 239.5],
            distortion: [0.0; 5],
        }
    }

    /// Returns the same lens without distortion.
    pub fn without_distortion(self) -> Self {
        Self {
            distortion: [0.0; 5],
            ..self
        }
    }

    /// Returns the same camera with an image of another size that shows the same.
    pub fn scaled(self, factor: f64) -> Self {
        let length = |pixels: usize| ((pixels as f64 * factor).round() as usize).max(1);
        Self {
            width: length(self.width),
            height: length(self.height),
            focal: self.focal.map(|value| value * factor),
            centre: self.centre.map(|value| (value + 0.5) * factor - 0.5),
            ..self
        }
    }

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

    /// Returns the ideal place of a distorted one: fixed-point iteration.
    pub fn undistort(&self, distorted: [f64; 2]) -> [f64; 2] {
        let mut ideal = distorted;
        for _ in 0..30 {
            let there = self.distort(ideal);
            let error = [distorted[0] - there[0], distorted[1] - there[1]];
            ideal = [ideal[0] + error[0], ideal[1] + error[1]];
            if error[0].abs() + error[1].abs() < 1e-12 {
                break;
            }
        }
        ideal
    }

    /// Returns the pixel of a point in the camera's frame; `None` if it is not in front of the camera.
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

    /// Returns the direction of a pixel in the camera's frame, with z = 1.
    pub fn direction(&self, [u, v]: [f64; 2]) -> Vector3<f64> {
        let [x, y] = self.undistort([
            (u - self.centre[0]) / self.focal[0],
            (v - self.centre[1]) / self.focal[1],
        ]);
        Vector3::new(x, y, 1.0)
    }
}

/// A camera at its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Size of the image, focal length, distortion.
    pub lens: Lens,
    /// Pose of the camera's frame (x right, y down, z forward) in the arm's base frame.
    pub pose: Pose,
}

impl Camera {
    /// Returns the thesis's camera: `height` m above a table whose surface is at `surface` m, above (x, y), looking
    /// straight down. The top of the image is away from the arm's base.
    pub fn overhead(lens: Lens, [x, y]: [f64; 2], surface: f64, height: f64) -> Self {
        // Columns: right is -y, down is -x, forward is -z.
        let rotation = Matrix3::new(0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        Self {
            lens,
            pose: Pose::from_parts(
                Translation3::new(x, y, surface + height),
                Rotation3::from_matrix_unchecked(rotation),
            ),
        }
    }

    /// Returns the pixel of a point of the arm's base frame; `None` if it is not in front of the camera.
    pub fn project(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        self.lens.project(&self.pose.inverse_transform_point(point))
    }

    /// Returns where the ray through a pixel meets the plane at this height of the arm's base frame.
    pub fn on_plane(&self, pixel: [f64; 2], height: f64) -> Option<Point3<f64>> {
        let direction = self.pose.rotation * self.lens.direction(pixel);
        let origin = Point3::from(self.pose.translation.vector);
        let distance = (height - origin.z) / direction.z;
        (distance > 0.0).then(|| origin + direction * distance)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_camera_sees_what_the_thesis_says() {
        let lens = Lens::flea2();
        assert!((lens.focal[0] - 1629.3).abs() < 0.1);
        // 0.559 mm per pixel at 911 mm.
        assert!((0.911 / lens.focal[0] - 0.000_559).abs() < 1e-6);
        let camera = Camera::overhead(lens.without_distortion(), [0.55, 0.0], -0.05, 0.911);
        let middle = camera.project(&Point3::new(0.55, 0.0, -0.05)).unwrap();
        assert!((middle[0] - 643.5).abs() < 1e-9 && (middle[1] - 481.5).abs() < 1e-9);
        // Left in the image is +y, up is +x.
        let left = camera.project(&Point3::new(0.55, 0.1, -0.05)).unwrap();
        let up = camera.project(&Point3::new(0.65, 0.0, -0.05)).unwrap();
        assert!(left[0] < 600.0 && up[1] < 440.0);
        assert_eq!(camera.project(&Point3::new(0.55, 0.0, 2.0)), None);
    }

    proptest! {
        #[test]
        fn a_pixel_leads_back_to_its_point(u in 0.0..1287.0f64, v in 0.0..963.0f64) {
            let camera = Camera::overhead(Lens::flea2(), [0.55, 0.0], -0.05, 0.911);
            let point = camera.on_plane([u, v], 0.02).unwrap();
            let back = camera.project(&point).unwrap();
            prop_assert!((back[0] - u).abs() < 1e-6 && (back[1] - v).abs() < 1e-6);
        }
    }
}
