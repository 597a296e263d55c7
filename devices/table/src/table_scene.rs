//! All there is to see and to touch.

use nalgebra::{Rotation3, Translation3, Vector3};

use crate::lighting::Lighting;
use crate::object::{Finish, Object, Shape};
use crate::simulated_robot::RobotPosture;
use crate::{Camera, Lens, Pose};

/// Height of the table's surface in the arm's base frame, m.
pub const SURFACE: f64 = -0.05;
/// Middle of what the camera sees of the table, m.
pub const MIDDLE: [f64; 2] = [0.55, 0.0];
/// Height of the camera above the table, m (section 6.4.2 of the thesis).
pub const CAMERA_HEIGHT: f64 = 0.911;

/// Places of the depth sensors above the baskets, m, and their height above the table: the bottoms are within their range.
const BASKET_CAMERAS: [[f64; 2]; 2] = [[0.27, -0.58], [0.45, 0.56]];
const BASKET_CAMERA_HEIGHT: f64 = 0.72;

/// Inner length along x and y, and depth of a basket, m. `docs/table-simulation.md` says why they are so deep.
const BASKET_SIZE: [f64; 3] = [0.30, 0.25, 0.24];

/// A table: a plate of wood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Table {
    /// Height of the surface, m.
    pub surface: f64,
    /// From and to along x, m.
    pub x: [f64; 2],
    /// From and to along y, m.
    pub y: [f64; 2],
    /// Its wood: tone, grain and boards follow from it.
    pub seed: u64,
    /// Friction coefficient against rubber.
    pub friction: f64,
}

impl Default for Table {
    fn default() -> Self {
        Self {
            surface: SURFACE,
            x: [0.20, 0.90],
            y: [-0.40, 0.40],
            seed: 0,
            friction: 0.5,
        }
    }
}

/// A basket, open at the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basket {
    /// Middle of its bottom, m.
    pub bottom: [f64; 3],
    /// Inner length along x and y, and depth, m.
    pub size: [f64; 3],
}

/// Thickness of the walls of a basket, m.
pub const BASKET_WALL: f64 = 0.01;

impl Basket {
    /// Returns whether a point is inside, up to the rim.
    pub fn contains(&self, point: &Vector3<f64>) -> bool {
        let inside = |axis: usize| (point[axis] - self.bottom[axis]).abs() <= self.size[axis] / 2.0;
        let above = point.z - self.bottom[2];
        inside(0) && inside(1) && (-0.01..=self.size[2]).contains(&above)
    }

    /// Returns bottom and walls as cuboids: middle and edges, m.
    pub fn walls(&self) -> [([f64; 3], [f64; 3]); 5] {
        let [x, y, z] = self.bottom;
        let [length, width, depth] = self.size;
        let wall = BASKET_WALL;
        let aside = |by: f64| by / 2.0 + wall / 2.0;
        let up = z + depth / 2.0;
        [
            (
                [x, y, z - wall / 2.0],
                [length + 2.0 * wall, width + 2.0 * wall, wall],
            ),
            ([x + aside(length), y, up], [wall, width, depth]),
            ([x - aside(length), y, up], [wall, width, depth]),
            (
                [x, y + aside(width), up],
                [length + 2.0 * wall, wall, depth],
            ),
            (
                [x, y - aside(width), up],
                [length + 2.0 * wall, wall, depth],
            ),
        ]
    }
}

/// A calibration board that is bolted to the tool plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountedBoard {
    /// A [`Shape::Board`].
    pub shape: Shape,
    /// Pose of the board's frame in the frame of link 7.
    pub pose: Pose,
}

/// The scene: table, baskets, objects, robot and light.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The table.
    pub table: Table,
    /// Polygons, glasses and plates belong into the first, second and third.
    pub baskets: Vec<Basket>,
    /// Objects on the table.
    pub objects: Vec<Object>,
    /// Arm and hand, if they are there.
    pub robot: Option<RobotPosture>,
    /// A board on the tool plate.
    pub board: Option<MountedBoard>,
    /// Lamps.
    pub lighting: Lighting,
}

impl Default for Scene {
    fn default() -> Self {
        Self::empty()
    }
}

impl Scene {
    /// Returns a table with baskets and no objects, without a robot.
    pub fn empty() -> Self {
        // The rims are level with the table's surface.
        let basket = |x, y| Basket {
            bottom: [x, y, SURFACE - BASKET_SIZE[2]],
            size: BASKET_SIZE,
        };
        Self {
            table: Table::default(),
            baskets: vec![basket(0.45, -0.56), basket(0.45, 0.56), basket(0.10, -0.60)],
            objects: Vec::new(),
            robot: None,
            board: None,
            lighting: Lighting::default(),
        }
    }

    /// Returns the thesis's camera above this table.
    pub fn camera(&self) -> Camera {
        Camera::overhead(Lens::flea2(), MIDDLE, self.table.surface, CAMERA_HEIGHT)
    }

    /// Returns the depth sensor, which hangs beside the camera.
    pub fn depth_camera(&self) -> Camera {
        let [x, y] = MIDDLE;
        Camera::overhead(
            Lens::depth_sensor(),
            [x - 0.06, y],
            self.table.surface,
            CAMERA_HEIGHT,
        )
    }

    /// Returns two depth sensors that look into the baskets: one over those at negative y, one over that of the glasses.
    pub fn basket_cameras(&self) -> [Camera; 2] {
        BASKET_CAMERAS.map(|place| {
            let lens = Lens::depth_sensor().scaled(0.5);
            Camera::overhead(lens, place, self.table.surface, BASKET_CAMERA_HEIGHT)
        })
    }

    /// Returns the object with this number.
    pub fn object(&self, id: u32) -> Option<&Object> {
        self.objects.iter().find(|object| object.id == id)
    }

    /// Returns the pose of something of this shape that lies on the table as usual, turned about z by `yaw` rad.
    pub fn lying(&self, shape: &Shape, x: f64, y: f64, yaw: f64) -> Pose {
        Pose::from_parts(
            Translation3::new(x, y, self.table.surface + shape.half_height()),
            Rotation3::from_axis_angle(&Vector3::z_axis(), yaw),
        )
    }

    /// Puts an object on the table, as it usually lies, and returns its number.
    pub fn put(&mut self, shape: Shape, x: f64, y: f64, yaw: f64, finish: Finish) -> u32 {
        let id = self.objects.iter().map(|object| object.id + 1).max();
        let id = id.unwrap_or(0);
        let pose = self.lying(&shape, x, y, yaw);
        self.objects.push(Object {
            finish,
            ..Object::new(id, shape, pose)
        });
        id
    }
}
