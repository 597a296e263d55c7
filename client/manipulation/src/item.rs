//! Objects to grasp.

use nalgebra::{Translation3, Vector3};
use yarp_devices::kinematics::Pose;
use yarp_planning::{Obstacle, Shape};

/// Number of cuboids that stand for a prism.
const PRISM_SLICES: usize = 5;

/// The class of an object, which decides its container.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum Class {
    /// Boxes, prisms and cartons.
    Polygon,
    /// Small cylinders.
    Glass,
    /// Large flat cylinders.
    Plate,
}

/// The shape of an object in its own frame: origin at half its height, z up, y along its longest horizontal side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ItemShape {
    /// A cuboid with edges along x, y and z, m.
    Cuboid {
        /// Edges; y is at least x.
        size: [f64; 3],
    },
    /// A prism over an equilateral triangle with one side along y, at negative x.
    Prism {
        /// Side of the triangle, m.
        side: f64,
        /// Along z, m.
        height: f64,
    },
    /// An upright cylinder.
    Cylinder {
        /// Outer radius, m.
        radius: f64,
        /// Along z, m.
        height: f64,
    },
}

impl ItemShape {
    /// Returns the height, m.
    pub fn height(&self) -> f64 {
        match *self {
            Self::Cuboid { size } => size[2],
            Self::Prism { height, .. } | Self::Cylinder { height, .. } => height,
        }
    }

    /// Returns the radius of an upright cylinder about the z axis that contains the shape, m.
    pub fn radius(&self) -> f64 {
        match *self {
            Self::Cuboid { size } => size[0].hypot(size[1]) / 2.0,
            Self::Prism { side, .. } => side / 3.0_f64.sqrt(),
            Self::Cylinder { radius, .. } => radius,
        }
    }

    /// Returns an obstacle shape that contains it.
    pub fn obstacle(&self) -> Shape {
        match *self {
            Self::Cuboid { size } => Shape::cuboid(size),
            Self::Prism { .. } | Self::Cylinder { .. } => {
                Shape::cylinder(self.radius(), self.height())
            }
        }
    }
}

/// An object that a detector found.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Number that the detector gives it; the same object may have another one in the next detection.
    pub id: u32,
    /// Label, such as `tea box`.
    pub label: String,
    /// Class.
    pub class: Class,
    /// Shape and size.
    pub shape: ItemShape,
    /// Pose of the object's frame.
    pub pose: Pose,
}

impl Item {
    /// Returns the rotation about the vertical, rad.
    pub fn yaw(&self) -> f64 {
        let along = self.pose.rotation * Vector3::x();
        along.y.atan2(along.x)
    }

    /// Returns the height of its top, m.
    pub fn top(&self) -> f64 {
        self.pose.translation.z + self.shape.height() / 2.0
    }

    /// Returns obstacles that contain the object: several for a triangle, which a cylinder is much wider than.
    pub fn obstacles(&self) -> Vec<Obstacle> {
        let name = format!("{} {}", self.label, self.id);
        let ItemShape::Prism { side, height } = self.shape else {
            return vec![Obstacle::new(name, self.shape.obstacle(), self.pose)];
        };
        let long = side * 3.0_f64.sqrt() / 2.0;
        let slice = long / PRISM_SLICES as f64;
        (0..PRISM_SLICES)
            .map(|index| {
                let from = index as f64 * slice;
                let width = side * (1.0 - from / long);
                let middle = Translation3::new(from + slice / 2.0 - long / 3.0, 0.0, 0.0);
                let shape = Shape::cuboid([slice, width, height]);
                Obstacle::new(name.clone(), shape, self.pose * middle)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn the_obstacles_of_a_prism_contain_it_and_are_narrower_than_its_cylinder() {
        let (side, height) = (0.1, 0.06);
        let item = Item {
            id: 1,
            label: "prism".into(),
            class: Class::Polygon,
            shape: ItemShape::Prism { side, height },
            pose: Pose::translation(0.5, 0.1, 0.0),
        };
        let obstacles = item.obstacles();
        let distance = |x: f64, y: f64| {
            let point = Point3::new(0.5 + x, 0.1 + y, 0.0);
            let all = obstacles.iter().map(|obstacle| obstacle.distance(&point));
            all.fold(f64::INFINITY, f64::min)
        };
        let long = side * 3.0_f64.sqrt() / 2.0;
        for step in 0..=20 {
            let part = f64::from(step) / 20.0;
            // A side from a corner at negative x to the one opposite.
            let (x, y) = (-long / 3.0 + part * long, side / 2.0 * (1.0 - part));
            assert!(distance(x, y) < 1e-9 && distance(x, -y) < 1e-9, "{part}");
        }
        // On the cylinder about it, far from each corner.
        assert!(distance(-item.shape.radius(), 0.0) > 0.02);
        assert!(distance(item.shape.radius() / 2.0, 0.045) > 0.01);
    }
}
