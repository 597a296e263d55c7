//! Meshes of the robot's links, generated from profiles.

use std::f64::consts::TAU;
use std::fmt::Write;

/// Corners of a cross-section.
const SIDES: usize = 40;
/// Cosine of the largest angle between two faces that are shaded as one.
const CREASE: f64 = 0.75;

/// A body of stacked cross-sections along z, all similar to one superellipse.
#[derive(Clone, Debug)]
pub(crate) struct Loft {
    /// Half axes along x and y at scale 1, m.
    pub(crate) half: [f64; 2],
    /// Exponent of the superellipse: 2 is an ellipse, more is closer to a rectangle.
    pub(crate) exponent: f64,
    /// Scale and height (m) of each cross-section, from below; the ends are closed.
    pub(crate) profile: Vec<(f64, f64)>,
}

impl Loft {
    /// Returns a body of revolution: radius and height of each circle, m.
    pub(crate) fn revolved(profile: &[(f64, f64)]) -> Self {
        Self {
            half: [1.0, 1.0],
            exponent: 2.0,
            profile: profile.to_vec(),
        }
    }

    /// Returns a cylinder with rounded edges between two heights, m.
    pub(crate) fn drum(radius: f64, from: f64, to: f64, edge: f64) -> Self {
        let mut profile = vec![(0.0, from)];
        profile.extend(arc(radius - edge, from + edge, edge, -0.25, 0.0));
        profile.extend(arc(radius - edge, to - edge, edge, 0.0, 0.25));
        profile.push((0.0, to));
        Self::revolved(&profile)
    }

    /// Returns a cylinder with round ends, whose middles are at two heights, m.
    pub(crate) fn capsule(radius: f64, from: f64, to: f64) -> Self {
        let mut profile = arc(0.0, from, radius, -0.25, 0.0);
        profile.extend(arc(0.0, to, radius, 0.0, 0.25));
        Self::revolved(&profile)
    }

    /// Returns the mesh in Wavefront's OBJ format.
    pub(crate) fn to_obj(&self) -> String {
        let rings = self.shaded_rings();
        let mut text = String::from("# generated from the kinematic model\n");
        for (scale, z, (across, up)) in &rings {
            for side in 0..SIDES {
                let ([x, y], [nx, ny]) = self.corner(side);
                let (x, y) = (x * scale, y * scale);
                let _ = writeln!(text, "v {x:.5} {y:.5} {z:.5}");
                let _ = writeln!(text, "vn {:.3} {:.3} {up:.3}", nx * across, ny * across);
            }
        }
        // Rings come in pairs, one pair per band.
        for pair in 0..rings.len() / 2 {
            let (low, high) = (2 * pair * SIDES, (2 * pair + 1) * SIDES);
            for side in 0..SIDES {
                let next = (side + 1) % SIDES;
                let [a, b, c, d] =
                    [low + side, low + next, high + next, high + side].map(|i| i + 1);
                let _ = writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}");
                let _ = writeln!(text, "f {a}//{a} {c}//{c} {d}//{d}");
            }
        }
        text
    }

    /// Returns a corner of the cross-section of scale 1, and its normal in the plane.
    fn corner(&self, side: usize) -> ([f64; 2], [f64; 2]) {
        let angle = TAU * side as f64 / SIDES as f64;
        let power = |value: f64, by: f64| value.signum() * value.abs().powf(by);
        let (sine, cosine) = angle.sin_cos();
        let [a, b] = self.half;
        let place = [
            a * power(cosine, 2.0 / self.exponent),
            b * power(sine, 2.0 / self.exponent),
        ];
        let normal = [
            power(cosine, 2.0 - 2.0 / self.exponent) / a,
            power(sine, 2.0 - 2.0 / self.exponent) / b,
        ];
        let length = normal[0].hypot(normal[1]).max(1e-9);
        (place, normal.map(|value| value / length))
    }

    /// Returns two rings per band: scale, height, and the normal's part in the plane and along z.
    fn shaded_rings(&self) -> Vec<(f64, f64, (f64, f64))> {
        let size = self.half[0].min(self.half[1]);
        let bands: Vec<_> = self
            .profile
            .windows(2)
            .map(|ends| {
                let (across, up) = ((ends[1].0 - ends[0].0) * size, ends[1].1 - ends[0].1);
                let length = across.hypot(up).max(1e-9);
                (up / length, -across / length)
            })
            .collect();
        let blend = |one: (f64, f64), other: Option<&(f64, f64)>| match other {
            Some(other) if one.0 * other.0 + one.1 * other.1 > CREASE => {
                let sum = (one.0 + other.0, one.1 + other.1);
                let length = sum.0.hypot(sum.1);
                (sum.0 / length, sum.1 / length)
            }
            _ => one,
        };
        let mut rings = Vec::with_capacity(2 * bands.len());
        for (index, band) in bands.iter().enumerate() {
            let below = index.checked_sub(1).and_then(|index| bands.get(index));
            let (low, high) = (self.profile[index], self.profile[index + 1]);
            rings.push((low.0, low.1, blend(*band, below)));
            rings.push((high.0, high.1, blend(*band, bands.get(index + 1))));
        }
        rings
    }
}

/// Returns points of an arc around (`radius`, `z`), from and to parts of a turn, as radius and height.
fn arc(radius: f64, z: f64, size: f64, from: f64, to: f64) -> Vec<(f64, f64)> {
    const STEPS: usize = 5;
    (0..=STEPS)
        .map(|step| {
            let angle = TAU * (from + (to - from) * step as f64 / STEPS as f64);
            (radius + size * angle.cos(), z + size * angle.sin())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(line: &str) -> Vec<f64> {
        line.split(' ')
            .skip(1)
            .map(|word| word.parse().unwrap())
            .collect()
    }

    /// A drum fills its cylinder, its faces refer to existing corners, and its normals point outwards.
    #[test]
    fn a_drum_is_a_closed_body() {
        let text = Loft::drum(0.05, -0.02, 0.04, 0.005).to_obj();
        let of = |kind: &str| {
            text.lines()
                .filter(|line| line.starts_with(kind))
                .map(numbers)
                .collect::<Vec<_>>()
        };
        let (corners, normals) = (of("v "), of("vn "));
        assert_eq!(corners.len(), normals.len());
        let reach = corners.iter().map(|c| c[0].hypot(c[1])).fold(0.0, f64::max);
        assert!((reach - 0.05).abs() < 1e-4, "{reach}");
        let top = corners.iter().map(|c| c[2]).fold(f64::MIN, f64::max);
        assert!((top - 0.04).abs() < 1e-9, "{top}");
        for (corner, normal) in corners.iter().zip(&normals) {
            let outwards =
                corner[0] * normal[0] + corner[1] * normal[1] + (corner[2] - 0.01) * normal[2];
            assert!(outwards > 0.0, "{corner:?} {normal:?}");
        }
        for line in text.lines().filter(|line| line.starts_with("f ")) {
            for word in line.split(' ').skip(1) {
                let index: usize = word.split('/').next().unwrap().parse().unwrap();
                assert!((1..=corners.len()).contains(&index));
            }
        }
    }
}
