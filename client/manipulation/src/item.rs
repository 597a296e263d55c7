//! Objects to grasp.

use nalgebra::Vector3;
use yarp_devices::kinematics::Pose;
use yarp_planning::{Obstacle, Shape};

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

    /// Returns the object as an obstacle.
    pub fn obstacle(&self) -> Obstacle {
        Obstacle::new(
            format!("{} {}", self.label, self.id),
            self.shape.obstacle(),
            self.pose,
        )
    }
}
