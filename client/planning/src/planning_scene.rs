//! The obstacles around an arm.

use nalgebra::Point3;
use yarp_devices::kinematics::Pose;

use crate::obstacle_shape::Shape;

/// Something that the arm must not touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Name, for errors.
    pub name: String,
    /// Shape.
    pub shape: Shape,
    /// Frame of the shape in the base frame of the arm.
    pub pose: Pose,
}

impl Obstacle {
    /// Returns an obstacle.
    pub fn new(name: impl Into<String>, shape: Shape, pose: Pose) -> Self {
        Self {
            name: name.into(),
            shape,
            pose,
        }
    }

    /// Returns the signed distance of a point in the base frame from the surface.
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        let local = self.pose.inverse_transform_point(point);
        self.shape.distance(&local.coords)
    }
}

/// The obstacles around an arm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    obstacles: Vec<Obstacle>,
}

impl Scene {
    /// Adds an obstacle.
    pub fn add(&mut self, obstacle: Obstacle) {
        self.obstacles.push(obstacle);
    }

    /// Removes the obstacles of this name; returns whether there was one.
    pub fn remove(&mut self, name: &str) -> bool {
        let before = self.obstacles.len();
        self.obstacles.retain(|obstacle| obstacle.name != name);
        self.obstacles.len() < before
    }

    /// Returns all obstacles.
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }
}
