//! The transforms of a calibrated robot: equations 5 to 12.

use nalgebra::{Matrix3, Matrix4, Point3, Rotation3, RowVector4, UnitQuaternion, Vector3, Vector6};

use super::Pattern;
use crate::{CameraModel, Intrinsics, Pose};

/// Largest difference of a rotation in a file from an orthonormal matrix.
const ORTHONORMAL_TOLERANCE: f64 = 1e-3;

/// A calibrated camera and the pattern in the hand, both relative to the arm.
///
/// *World* is the base frame of the arm, *hand* the frame of its tool plate (link 7), *grid* the frame of the pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandEye {
    /// Intrinsic parameters (equation 7) and the transform from the camera's frame to the world: Hcam2world.
    pub camera: CameraModel,
    /// Transform from the pattern's frame to the hand: Hgrid2hand.
    pub grid_to_hand: Pose,
}

impl HandEye {
    /// Returns the transform from the hand to the pattern (equation 11).
    pub fn hand_to_grid(&self) -> Pose {
        self.grid_to_hand.inverse()
    }

    /// Returns the pose of the hand in the world, if the pattern is seen at `grid_to_camera` (equation 12).
    pub fn hand_to_world(&self, grid_to_camera: &Pose) -> Pose {
        self.camera.pose * grid_to_camera * self.hand_to_grid()
    }

    /// Returns the pose of the pattern in the camera's frame, if the hand is at `hand_to_world`.
    pub fn grid_to_camera(&self, hand_to_world: &Pose) -> Pose {
        self.camera.pose.inverse() * hand_to_world * self.grid_to_hand
    }

    /// Returns the pixels of the pattern's corners, if the hand is at `hand_to_world`; `None` if one is not in front of the
    /// camera.
    pub fn predict(&self, pattern: &Pattern, hand_to_world: &Pose) -> Option<Vec<[f64; 2]>> {
        let pose = self.grid_to_camera(hand_to_world);
        let project = |corner: &Point3<f64>| self.camera.intrinsics.project(&(pose * corner));
        pattern.corners().iter().map(project).collect()
    }
}

/// Returns the intrinsic matrix of a camera (equation 7).
pub fn intrinsic_matrix(intrinsics: &Intrinsics) -> Matrix3<f64> {
    let ([fx, fy], [cx, cy]) = (intrinsics.focal, intrinsics.centre);
    Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
}

/// Returns the point that is seen at a pixel with a depth (the factor s of equations 8 and 9), in the camera's frame, in m.
pub fn back_project(intrinsics: &Intrinsics, pixel: [f64; 2], depth: f64) -> Point3<f64> {
    Point3::from(intrinsics.direction(pixel) * depth)
}

/// Returns the pose that a small motion (translation in m, rotation vector in rad, in the pose's own frame) leads to.
pub(super) fn moved(pose: &Pose, motion: &Vector6<f64>) -> Pose {
    let turn = Rotation3::new(Vector3::new(motion[3], motion[4], motion[5]));
    pose * Pose::from_parts(Vector3::new(motion[0], motion[1], motion[2]).into(), turn)
}

/// Returns the pose of a homogeneous matrix, its rotation made orthonormal; `None` if it is no rigid transform.
pub(super) fn pose_of(matrix: &Matrix4<f64>) -> Option<Pose> {
    if !matrix.iter().all(|value| value.is_finite()) {
        return None;
    }
    let block = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let square = block * block.transpose() - Matrix3::identity();
    let last = matrix.row(3) - RowVector4::new(0.0, 0.0, 0.0, 1.0);
    let rigid = square.amax() <= ORTHONORMAL_TOLERANCE && last.amax() <= ORTHONORMAL_TOLERANCE;
    if !rigid || block.determinant() < 0.0 {
        return None;
    }
    let translation = Vector3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]);
    Some(Pose::from_parts(
        translation.into(),
        nearest_rotation(&block)?,
    ))
}

/// Returns the rotation vector of a rotation, in rad; also of one that rounding has made less than orthonormal.
pub(super) fn rotation_vector(rotation: &Rotation3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(rotation).scaled_axis()
}

/// Returns the rotation nearest to a matrix.
pub(super) fn nearest_rotation(matrix: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    let svd = matrix.svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?);
    let sign = (u * v).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v;
    Some(Rotation3::from_matrix_unchecked(rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hand_eye() -> HandEye {
        HandEye {
            camera: CameraModel {
                intrinsics: Intrinsics {
                    size: [1288, 964],
                    focal: [1629.0, 1631.0],
                    centre: [640.0, 480.0],
                    distortion: [-0.10, 0.08, 0.0006, -0.0004, 0.01],
                },
                pose: Pose::new(Vector3::new(0.55, 0.0, 0.86), Vector3::new(3.1, 0.1, 0.0)),
            },
            grid_to_hand: Pose::new(Vector3::new(0.0, 0.1, 0.2), Vector3::new(0.3, -0.5, 1.0)),
        }
    }

    fn distance(one: &Pose, other: &Pose) -> f64 {
        (one.to_homogeneous() - other.to_homogeneous()).amax()
    }

    #[test]
    fn equation_12_inverts_the_prediction() {
        let known = hand_eye();
        let hand = Pose::new(Vector3::new(0.4, 0.1, 0.2), Vector3::new(0.2, 1.0, -0.4));
        let back = known.hand_to_world(&known.grid_to_camera(&hand));
        assert!(distance(&back, &hand) < 1e-12);
        let identity = known.hand_to_grid() * known.grid_to_hand;
        assert!(distance(&identity, &Pose::identity()) < 1e-12);
    }

    #[test]
    fn equations_5_to_9_invert_each_other() {
        let mut intrinsics = hand_eye().camera.intrinsics;
        let point = Point3::new(0.1, -0.05, 0.7);
        let pixel = intrinsics.project(&point).unwrap();
        assert!((back_project(&intrinsics, pixel, 0.7) - point).norm() < 1e-9);
        // Without distortion the matrix alone projects.
        intrinsics.distortion = [0.0; 5];
        let scaled = intrinsic_matrix(&intrinsics) * point.coords;
        let pixel = intrinsics.project(&point).unwrap();
        assert!((pixel[0] - scaled.x / scaled.z).abs() < 1e-9);
        assert!((pixel[1] - scaled.y / scaled.z).abs() < 1e-9);
    }

    #[test]
    fn only_rigid_matrices_become_poses() {
        let pose = hand_eye().camera.pose;
        let matrix = pose.to_homogeneous();
        assert!(distance(&pose_of(&matrix).unwrap(), &pose) < 1e-12);
        let mut mirrored = matrix;
        mirrored.column_mut(0).neg_mut();
        assert_eq!(pose_of(&mirrored), None);
        assert_eq!(pose_of(&(matrix * 2.0)), None);
        let mut broken = matrix;
        broken[(0, 3)] = f64::NAN;
        assert_eq!(pose_of(&broken), None);
    }
}
