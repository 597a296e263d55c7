//! Back-projection: from an outline in the image to a pose in the base frame of the arm (equations 13 to 25 of the
//! thesis).

use nalgebra::Point3;

use crate::{CameraModel, Detection, Polygon, Shape};

/// The one number that a single image does not contain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Elevation {
    /// Height of the upper face in the arm's base frame, m.
    Height(f64),
    /// Length in m of what is this many pixels long in the image: a diameter, a side.
    Size {
        /// Length in the image.
        pixels: f64,
        /// Length of the object, m.
        metres: f64,
    },
    /// Depth of the upper face along the optical axis, m.
    Depth(f64),
}

/// Place and direction of an object's upper face in the base frame of the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectPose {
    /// Centre of the upper face, m.
    pub position: Point3<f64>,
    /// Direction of the longest side about z, rad, in -π/2..=π/2; `None` for round objects.
    pub yaw: Option<f64>,
}

impl CameraModel {
    /// Returns the point of the ray through a pixel that the elevation determines; `None` if there is no such point in
    /// front of the camera.
    pub fn back_project(&self, pixel: [f64; 2], elevation: Elevation) -> Option<Point3<f64>> {
        let depth = match elevation {
            Elevation::Height(height) => return self.on_plane(pixel, height),
            Elevation::Depth(depth) => depth,
            Elevation::Size { pixels, metres } => {
                // Equation 20: the ratio of length and pixels is that of depth and focal length.
                let focal = (self.intrinsics.focal[0] + self.intrinsics.focal[1]) / 2.0;
                focal * metres / pixels
            }
        };
        (depth.is_finite() && depth > 0.0).then(|| self.at_depth(pixel, depth))
    }

    /// Returns place and direction of a detection; `None` as [`Self::back_project`].
    pub fn pose_of(&self, detection: &Detection, elevation: Elevation) -> Option<ObjectPose> {
        let position = self.back_project(detection.centre, elevation)?;
        let angle = match detection.shape {
            Shape::Cylinder { .. } => None,
            Shape::Polygon(Polygon::Rectangle { angle, .. } | Polygon::Triangle { angle, .. }) => {
                Some(angle)
            }
            Shape::Textured { .. } => longest_side(&detection.contour),
        };
        let yaw = match angle {
            None => None,
            Some(angle) => {
                let [x, y] = detection.centre;
                let ahead = [x + 20.0 * angle.cos(), y + 20.0 * angle.sin()];
                let ahead = self.on_plane(ahead, position.z)?;
                let along = ahead - position;
                Some(half_turn(along.y.atan2(along.x)))
            }
        };
        Some(ObjectPose { position, yaw })
    }
}

/// Returns the direction of the longest side of an outline.
fn longest_side(contour: &[[f64; 2]]) -> Option<f64> {
    (0..contour.len())
        .map(|index| {
            let (a, b) = (contour[index], contour[(index + 1) % contour.len()]);
            [b[0] - a[0], b[1] - a[1]]
        })
        .max_by(|one, other| one[0].hypot(one[1]).total_cmp(&other[0].hypot(other[1])))
        .map(|[dx, dy]| dy.atan2(dx))
}

/// Returns the direction of a line in -π/2..=π/2.
fn half_turn(angle: f64) -> f64 {
    use std::f64::consts::{FRAC_PI_2, PI};
    match angle {
        angle if angle > FRAC_PI_2 => angle - PI,
        angle if angle < -FRAC_PI_2 => angle + PI,
        angle => angle,
    }
}
