//! Fixed obstacles around the arm.

use yarp_devices::kinematics::Pose;
use yarp_planning::{Obstacle, Scene, Shape};

use crate::item::Item;

/// Thickness of walls and of the table, m.
const WALL: f64 = 0.01;
const TABLE_THICKNESS: f64 = 0.05;

/// A container for objects, open at the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Container {
    /// Middle of its bottom, m.
    pub bottom: [f64; 3],
    /// Inner length along x and y, and depth, m.
    pub size: [f64; 3],
}

impl Container {
    /// Returns the height of its rim, m.
    pub fn rim(&self) -> f64 {
        self.bottom[2] + self.size[2]
    }
}

/// Table and containers, which do not move.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// Height of the table's surface, m.
    pub surface: f64,
    /// From and to along x, m.
    pub table_x: [f64; 2],
    /// From and to along y, m.
    pub table_y: [f64; 2],
    /// Containers for polygons, glasses and plates, in this order.
    pub containers: [Container; 3],
}

impl Default for Surroundings {
    /// The table of `docs/table-simulation.md`.
    fn default() -> Self {
        let container = |x, y| Container {
            bottom: [x, y, -0.29],
            size: [0.30, 0.25, 0.24],
        };
        Self {
            surface: -0.05,
            table_x: [0.20, 0.90],
            table_y: [-0.40, 0.40],
            containers: [
                container(0.45, -0.56),
                container(0.45, 0.56),
                container(0.10, -0.60),
            ],
        }
    }
}

impl Surroundings {
    /// Returns table, containers and these objects as obstacles.
    pub fn scene<'a>(&self, items: impl IntoIterator<Item = &'a Item>) -> Scene {
        let mut scene = Scene::default();
        let span = |[from, to]: [f64; 2]| ((from + to) / 2.0, to - from);
        let ((x, length), (y, width)) = (span(self.table_x), span(self.table_y));
        let slab = Shape::cuboid([length, width, TABLE_THICKNESS]);
        let middle = Pose::translation(x, y, self.surface - TABLE_THICKNESS / 2.0);
        scene.add(Obstacle::new("table", slab, middle));
        for (index, container) in self.containers.iter().enumerate() {
            // Whole, also what is in it: the arm never reaches below the rim.
            let [length, width, depth] = container.size;
            let [x, y, z] = container.bottom;
            let shape = Shape::cuboid([length + 2.0 * WALL, width + 2.0 * WALL, depth]);
            let pose = Pose::translation(x, y, z + depth / 2.0);
            scene.add(Obstacle::new(
                format!("container {}", index + 1),
                shape,
                pose,
            ));
        }
        for item in items {
            for obstacle in item.obstacles() {
                scene.add(obstacle);
            }
        }
        scene
    }
}
