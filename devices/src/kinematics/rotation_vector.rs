//! Rotations as an axis and an angle in one vector.

use nalgebra::{Rotation3, Vector3};

/// The axis of a rotation times its angle in rad, from 0 to π.
///
/// Precise for every angle, π included, where the axis is one of the two possible ones.
pub fn rotation_vector(rotation: &Rotation3<f64>) -> Vector3<f64> {
    let r = rotation.matrix();
    // The sine and the cosine of the angle, the axis still unknown: 2 sin(a) axis, and trace = 1 + 2 cos(a).
    let turned = Vector3::new(
        r[(2, 1)] - r[(1, 2)],
        r[(0, 2)] - r[(2, 0)],
        r[(1, 0)] - r[(0, 1)],
    );
    let sine = turned.norm() / 2.0;
    let cosine = (r.trace() - 1.0) / 2.0;
    let angle = sine.atan2(cosine);
    if cosine > -0.9 {
        // angle / sin(angle) goes to 1 with the angle.
        let factor = if sine > 1e-8 { angle / sine } else { 1.0 };
        return turned * (factor / 2.0);
    }
    // Near π the sine is a poor measure of the axis: (R + R^T) / 2 = cos + (1 - cos) axis axis^T is a better one.
    let symmetric = (r + r.transpose()) / 2.0;
    let squares = symmetric.map_with_location(|row, column, value| {
        let diagonal = if row == column { cosine } else { 0.0 };
        (value - diagonal) / (1.0 - cosine)
    });
    let largest = (0..3)
        .max_by(|&one, &other| squares[(one, one)].total_cmp(&squares[(other, other)]))
        .unwrap_or(0);
    let axis = squares.column(largest).normalize();
    let sign = if axis.dot(&turned) < 0.0 { -1.0 } else { 1.0 };
    axis * (sign * angle)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_rotation_comes_back(x in -1.0..1.0, y in -1.0..1.0, z in -1.0..1.0, angle in 0.0..PI, exponent in -17.0..0.0) {
            let axis = Vector3::new(x, y, z);
            prop_assume!(axis.norm() > 0.01);
            let axis = axis.normalize();
            for angle in [angle, 10_f64.powf(exponent), PI - 10_f64.powf(exponent), PI] {
                let given = Rotation3::new(axis * angle);
                let found = rotation_vector(&given);
                let back = Rotation3::new(found);
                prop_assert!((given.matrix() - back.matrix()).abs().max() < 1e-12);
                prop_assert!((found.norm() - angle).abs() < 1e-12);
            }
        }
    }
}
