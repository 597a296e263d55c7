//! Objects to grasp.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Rotation3, Translation3, Vector3};
use yarp_devices::kinematics::Pose;
use yarp_planning::{Obstacle, Shape};

/// Number of cuboids that stand for a prism.
const PRISM_SLICES: usize = 5;

/// Vertical part of the direction of a cylinder's axis below which it lies.
const LIES_BELOW: f64 = 0.7;

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
    /// Returns the same object, described as grasps need it: with its z axis up, whichever side it lies on.
    ///
    /// A cuboid gets its edges in another order; a cylinder that lies is a cuboid around it. A prism on one of its rectangular
    /// sides stays as it is.
    pub fn at_rest(&self) -> Self {
        let turn = self.pose.rotation;
        let axis = |index: usize| turn * Vector3::ith(index, 1.0);
        let size = match self.shape {
            ItemShape::Cuboid { size } => size,
            ItemShape::Cylinder { radius, height } if axis(2).z.abs() < LIES_BELOW => {
                [2.0 * radius, 2.0 * radius, height]
            }
            _ => return self.clone(),
        };
        let mut order = [0, 1, 2];
        order.sort_by(|one, other| axis(*one).z.abs().total_cmp(&axis(*other).z.abs()));
        let up = order[2];
        let [short, long] = match size[order[0]] <= size[order[1]] {
            true => [order[0], order[1]],
            false => [order[1], order[0]],
        };
        if [short, long, up] == [0, 1, 2] && axis(2).z > 0.0 {
            return self.clone();
        }
        // Upright: what it is tilted by is noise, or it leans on something.
        let along = axis(long);
        let yaw = along.y.atan2(along.x) - FRAC_PI_2;
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        Self {
            shape: ItemShape::Cuboid {
                size: [size[short], size[long], size[up]],
            },
            pose: Pose::from_parts(self.pose.translation, rotation),
            ..self.clone()
        }
    }

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

    fn item(shape: ItemShape, rotation: Rotation3<f64>) -> Item {
        let middle = Translation3::new(0.5, 0.1, 0.0);
        Item {
            id: 1,
            label: "carton".into(),
            class: Class::Polygon,
            shape,
            pose: Pose::from_parts(middle, rotation),
        }
    }

    #[test]
    fn what_lies_on_another_side_is_described_as_it_lies() {
        let carton = ItemShape::Cuboid {
            size: [0.095, 0.165, 0.063],
        };
        // As usual, and upside down.
        let usual = item(carton, Rotation3::from_euler_angles(0.0, 0.0, 0.3));
        assert_eq!(usual.at_rest(), usual);
        let turned = item(
            carton,
            Rotation3::from_euler_angles(std::f64::consts::PI, 0.0, 0.3),
        );
        assert_eq!(turned.at_rest().shape, carton);
        assert!((turned.at_rest().pose.rotation * Vector3::z()).z > 0.999);
        // On its end: the longest edge is up; the longer of the others is along y.
        let yaw = 0.3;
        let standing = item(
            carton,
            Rotation3::from_euler_angles(0.0, 0.0, yaw)
                * Rotation3::from_euler_angles(FRAC_PI_2, 0.0, 0.0),
        );
        let rest = standing.at_rest();
        let size = [0.063, 0.095, 0.165];
        assert_eq!(rest.shape, ItemShape::Cuboid { size });
        // The edge of 95 mm was along x, which is turned by yaw.
        let along = rest.pose.rotation * Vector3::y();
        let expected = Vector3::new(yaw.cos(), yaw.sin(), 0.0);
        assert!(along.cross(&expected).norm() < 1e-9, "{along}");
        assert!((rest.top() - 0.0825).abs() < 1e-9);
        // On its long side.
        let side = item(carton, Rotation3::from_euler_angles(0.0, FRAC_PI_2, 0.0)).at_rest();
        let size = [0.063, 0.165, 0.095];
        assert_eq!(side.shape, ItemShape::Cuboid { size });
    }

    #[test]
    fn a_lying_glass_is_a_cuboid_and_a_leaning_one_is_none() {
        let glass = ItemShape::Cylinder {
            radius: 0.035,
            height: 0.12,
        };
        let leaning = item(glass, Rotation3::from_euler_angles(0.3, 0.0, 0.0));
        assert_eq!(leaning.at_rest(), leaning);
        let lying = item(glass, Rotation3::from_euler_angles(0.0, FRAC_PI_2, 0.0)).at_rest();
        let size = [0.07, 0.12, 0.07];
        assert_eq!(lying.shape, ItemShape::Cuboid { size });
        // Its axis was along x.
        let along = lying.pose.rotation * Vector3::y();
        assert!(along.cross(&Vector3::x()).norm() < 1e-9, "{along}");
    }

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
