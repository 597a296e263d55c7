//! Orientations as three angles.

use nalgebra::{Matrix3, Rotation3};

/// Below this cosine of the pitch only the sum or the difference of roll and yaw is determined.
const SINGULARITY_THRESHOLD: f64 = 1e-12;

/// Three angles in rad about **fixed** axes: first x, then y, then z, `R = Rz(yaw) Ry(pitch) Rx(roll)`.
///
/// This is the XYZ convention of the thesis (annex A.1, equations 33 to 37), where roll, pitch and yaw are also
/// called ψ, θ and φ. [`from_rotation`](Self::from_rotation) returns a pitch within ±π/2; where the pitch is ±π/2
/// itself, roll and yaw are not determined separately and the yaw is 0.
///
/// ```
/// use yarp_devices::kinematics::EulerXyz;
///
/// let angles = EulerXyz::new(0.1, 0.2, 0.3);
/// let back = EulerXyz::from_rotation(&angles.rotation());
/// assert!((back.yaw - 0.3).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EulerXyz {
    /// About the x axis, first.
    pub roll: f64,
    /// About the base's y axis, second.
    pub pitch: f64,
    /// About the base's z axis, last.
    pub yaw: f64,
}

impl EulerXyz {
    /// Angles in the order in which they are applied.
    pub const fn new(roll: f64, pitch: f64, yaw: f64) -> Self {
        Self { roll, pitch, yaw }
    }

    /// The rotation, element by element as in equation 37.
    pub fn rotation(&self) -> Rotation3<f64> {
        let (sin_psi, cos_psi) = self.roll.sin_cos();
        let (sin_theta, cos_theta) = self.pitch.sin_cos();
        let (sin_phi, cos_phi) = self.yaw.sin_cos();
        Rotation3::from_matrix_unchecked(Matrix3::new(
            cos_theta * cos_phi,
            cos_phi * sin_psi * sin_theta - cos_psi * sin_phi,
            cos_psi * cos_phi * sin_theta + sin_psi * sin_phi,
            cos_theta * sin_phi,
            cos_psi * cos_phi + sin_psi * sin_theta * sin_phi,
            cos_psi * sin_theta * sin_phi - cos_phi * sin_psi,
            -sin_theta,
            cos_theta * sin_psi,
            cos_psi * cos_theta,
        ))
    }

    /// The angles of a rotation.
    pub fn from_rotation(rotation: &Rotation3<f64>) -> Self {
        let r = rotation.matrix();
        let cosine = r[(0, 0)].hypot(r[(1, 0)]);
        let pitch = (-r[(2, 0)]).atan2(cosine);
        let yaw = if cosine < SINGULARITY_THRESHOLD {
            0.0
        } else {
            r[(1, 0)].atan2(r[(0, 0)])
        };
        // Rz(-yaw) R = Ry Rx, whose middle row is (0, cos, -sin) of the roll: exact for any yaw, so that near the
        // singularity the error of one angle is made good by the other.
        let (s, c) = yaw.sin_cos();
        let sine = s * r[(0, 2)] - c * r[(1, 2)];
        let cosine = c * r[(1, 1)] - s * r[(0, 1)];
        Self {
            roll: sine.atan2(cosine),
            pitch,
            yaw,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    fn rotation(angles: [f64; 3]) -> Rotation3<f64> {
        EulerXyz::new(angles[0], angles[1], angles[2]).rotation()
    }

    fn distance(one: &Rotation3<f64>, other: &Rotation3<f64>) -> f64 {
        (one.matrix() - other.matrix()).abs().max()
    }

    #[test]
    fn equation_37_is_the_product_of_three_rotations() {
        for angles in [[0.1, 0.2, 0.3], [-2.0, 1.1, 3.0], [3.0, -1.5, -0.2]] {
            let about = |axis: Vector3<f64>, angle: f64| Rotation3::new(axis * angle);
            let product = about(Vector3::z(), angles[2])
                * about(Vector3::y(), angles[1])
                * about(Vector3::x(), angles[0]);
            assert!(distance(&rotation(angles), &product) < 1e-14);
        }
    }

    #[test]
    fn at_the_singularity_the_yaw_is_zero_and_the_rotation_the_same() {
        for pitch in [FRAC_PI_2, -FRAC_PI_2] {
            for roll in [-3.0, -1.0, 0.0, 0.5, PI] {
                for yaw in [-2.0, 0.0, 0.7, 3.0] {
                    // The exact matrix: cos(pi/2) in floating point is 6e-17.
                    let mut exact = rotation([roll, pitch, yaw]).into_inner();
                    for (row, column) in [(0, 0), (1, 0), (2, 1), (2, 2)] {
                        exact[(row, column)] = 0.0;
                    }
                    let exact = Rotation3::from_matrix_unchecked(exact);
                    let found = EulerXyz::from_rotation(&exact);
                    assert_eq!((found.pitch, found.yaw), (pitch, 0.0));
                    assert!(distance(&found.rotation(), &exact) < 1e-15);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn angles_come_back(roll in -3.1..3.1, pitch in -1.57..1.57, yaw in -3.1..3.1) {
            let found = EulerXyz::from_rotation(&rotation([roll, pitch, yaw]));
            prop_assert!((found.pitch - pitch).abs() < 1e-12);
            // Roll and yaw are known as well as the cosine of the pitch allows.
            prop_assert!((found.roll - roll).abs() < 1e-11);
            prop_assert!((found.yaw - yaw).abs() < 1e-11);
        }

        #[test]
        fn the_rotation_comes_back_however_near_the_singularity(
            roll in -PI..PI,
            exponent in -18.0..0.0,
            down in any::<bool>(),
            yaw in -PI..PI,
        ) {
            let near = FRAC_PI_2 - 10_f64.powf(exponent);
            let given = rotation([roll, if down { -near } else { near }, yaw]);
            let back = EulerXyz::from_rotation(&given).rotation();
            prop_assert!(distance(&given, &back) < 1e-11);
        }
    }
}
