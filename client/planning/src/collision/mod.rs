//! Collisions of an arm with obstacles and with itself.
//!
//! The arm is a set of spheres, each fixed to a link. The clearance of a posture is the smallest distance of a sphere from an
//! obstacle, or of two spheres of links that could meet. A motion is checked without gaps: no sphere can move farther than
//! the sum of the joint motions, each times the largest distance of the sphere from the axis of the joint, so a clearance
//! proves a whole interval of the motion free.

mod arm_geometry;
mod collision_model;
mod continuous;

pub use arm_geometry::{ArmGeometry, LinkSphere};
pub use collision_model::{CollisionModel, Contact, MARGIN};
