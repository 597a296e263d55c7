//! Mass, centre of mass and inertia of a rigid body.

use nalgebra::{Matrix3, Vector3};

use crate::kinematics::Pose;

/// The mass properties of a link or a load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Body {
    /// kg.
    pub mass: f64,
    /// The centre of mass from the origin of the body's frame, in that frame, m.
    pub centre: Vector3<f64>,
    /// About the centre of mass, along the axes of the body's frame, kg m².
    pub inertia: Matrix3<f64>,
}

impl Body {
    /// A mass in one point.
    pub fn point(mass: f64, centre: Vector3<f64>) -> Self {
        Self {
            mass,
            centre,
            inertia: Matrix3::zeros(),
        }
    }

    /// The same body described in another frame; `pose` is its own frame in that one.
    pub fn seen_from(&self, pose: &Pose) -> Self {
        let turn = pose.rotation.matrix();
        Self {
            mass: self.mass,
            centre: pose.rotation * self.centre + pose.translation.vector,
            inertia: turn * self.inertia * turn.transpose(),
        }
    }

    /// Two bodies of one frame bolted together.
    pub fn joined_with(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        if mass == 0.0 {
            return *self;
        }
        let centre = (self.centre * self.mass + other.centre * other.mass) / mass;
        Self {
            mass,
            centre,
            inertia: self.inertia_about(&centre) + other.inertia_about(&centre),
        }
    }

    /// The theorem of Steiner.
    fn inertia_about(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let arm = self.centre - point;
        self.inertia
            + (Matrix3::from_diagonal_element(arm.norm_squared()) - arm * arm.transpose())
                * self.mass
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Translation3};

    use super::*;

    #[test]
    fn two_points_make_a_dumbbell() {
        let one = Body::point(2.0, Vector3::new(0.3, 0.0, 0.0));
        let other = Body::point(1.0, Vector3::new(-0.6, 0.0, 0.0));
        let both = one.joined_with(&other);
        assert_eq!((both.mass, both.centre.norm()), (3.0, 0.0));
        let expected = 2.0 * 0.09 + 0.36;
        assert!(
            (both.inertia - Matrix3::from_diagonal(&Vector3::new(0.0, expected, expected))).norm()
                < 1e-15
        );
    }

    #[test]
    fn turning_a_frame_turns_the_inertia() {
        let body = Body {
            mass: 1.0,
            centre: Vector3::x(),
            inertia: Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.0)),
        };
        let pose = Pose::from_parts(
            Translation3::new(0.0, 0.0, 5.0),
            Rotation3::new(Vector3::z() * std::f64::consts::FRAC_PI_2),
        );
        let seen = body.seen_from(&pose);
        assert!((seen.centre - Vector3::new(0.0, 1.0, 5.0)).norm() < 1e-15);
        let expected = Matrix3::from_diagonal(&Vector3::new(2.0, 1.0, 3.0));
        assert!((seen.inertia - expected).norm() < 1e-15);
    }
}
