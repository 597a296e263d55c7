//! The place where a ray meets a solid.

use nalgebra::Vector3;

/// A vector of single precision.
pub(super) type Vector = Vector3<f32>;

/// Intersection of a ray with a solid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// In lengths of the ray's direction.
    pub(super) distance: f32,
    /// Outward, in the frame of the solid.
    pub(super) normal: Vector,
    /// In the frame of the solid.
    pub(super) place: Vector,
    /// Index of the face.
    pub(super) face: u8,
}
