//! Shapes of obstacles.

use nalgebra::Vector3;

/// The shape of an obstacle, in metres, around its own origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A cuboid with the given half edges.
    Cuboid {
        /// Half edges along x, y and z.
        half: Vector3<f64>,
    },
    /// An upright cylinder.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Half of the height, along z.
        half_height: f64,
    },
    /// A sphere.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// Everything below the plane z = 0, such as the table or the floor.
    HalfSpace,
}

impl Shape {
    /// Returns a cuboid with the given edges.
    pub fn cuboid(edges: [f64; 3]) -> Self {
        Self::Cuboid {
            half: Vector3::from(edges) / 2.0,
        }
    }

    /// Returns an upright cylinder.
    pub fn cylinder(radius: f64, height: f64) -> Self {
        Self::Cylinder {
            radius,
            half_height: height / 2.0,
        }
    }

    /// Returns the signed distance of a point from the surface: negative inside.
    ///
    /// `point` is in the frame of the shape. The distance is exact outside; inside it is that to the nearest face.
    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Cuboid { half } => box_distance(point.abs() - half),
            Self::Cylinder {
                radius,
                half_height,
            } => {
                let beyond = point.xy().norm() - radius;
                let above = point.z.abs() - half_height;
                let outside = beyond.max(0.0).hypot(above.max(0.0));
                outside + beyond.max(above).min(0.0)
            }
            Self::Sphere { radius } => point.norm() - radius,
            Self::HalfSpace => point.z,
        }
    }

    /// Returns the radius of a sphere around the origin that holds the shape; infinite for a half-space.
    pub fn bounding_radius(&self) -> f64 {
        match self {
            Self::Cuboid { half } => half.norm(),
            Self::Cylinder {
                radius,
                half_height,
            } => radius.hypot(*half_height),
            Self::Sphere { radius } => *radius,
            Self::HalfSpace => f64::INFINITY,
        }
    }
}

/// Distance from a box, given how far the point is beyond each pair of faces.
fn box_distance(beyond: Vector3<f64>) -> f64 {
    let outside = beyond.map(|value| value.max(0.0)).norm();
    outside + beyond.max().min(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(shape: Shape, point: [f64; 3], expected: f64) {
        let distance = shape.distance(&point.into());
        assert!((distance - expected).abs() < 1e-12, "{distance}");
    }

    #[test]
    fn distances_are_signed_and_exact_outside() {
        let cuboid = Shape::cuboid([2.0, 4.0, 6.0]);
        check(cuboid, [2.0, 0.0, 0.0], 1.0);
        check(cuboid, [4.0, 6.0, 3.0], 5.0);
        check(cuboid, [0.5, 0.0, 0.0], -0.5);
        let cylinder = Shape::cylinder(1.0, 2.0);
        check(cylinder, [0.0, 3.0, 0.0], 2.0);
        check(cylinder, [0.0, 4.0, 5.0], 5.0);
        check(cylinder, [0.0, 0.0, 0.75], -0.25);
        check(Shape::Sphere { radius: 1.0 }, [0.0, 0.0, 3.0], 2.0);
        check(Shape::HalfSpace, [7.0, 7.0, -0.5], -0.5);
    }
}
