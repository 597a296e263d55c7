//! Planning problems: a scene with a start and goals, random or from a JSON file.

use nalgebra::{Rotation3, Translation3, Vector3};
use serde::{Deserialize, Serialize};
use yarp_devices::hand::FingerJoints;
use yarp_devices::kinematics::{EulerXyz, Joints, Pose, Solver};
use yarp_devices::wam::WamModel;

use crate::collision::{ArmGeometry, CollisionModel};
use crate::obstacle_shape::Shape;
use crate::planner::Planner;
use crate::planning_scene::{Obstacle, Scene};
use yarp_devices::pseudo_random::Random;

/// Maximum number of obstacles and of goals of a file.
const MAX_ENTRIES: usize = 10_000;

/// An error of a problem's file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// The text is no JSON of this form.
    #[error(
        "the scene is not valid: {0}; expected {{\"start\": [7 angles in rad], \"goals\": [[7 angles in rad]], \"obstacles\": [...]}}"
    )]
    Json(#[from] serde_json::Error),
    /// A number is not finite, or a size is not positive.
    #[error("the {what} of {name} is {value}; expected {expected}")]
    Value {
        /// The quantity.
        what: &'static str,
        /// Name of the obstacle, or `start`, `goal`.
        name: String,
        /// Its value.
        value: f64,
        /// The valid range.
        expected: &'static str,
    },
    /// There are too many obstacles or goals, or no goal.
    #[error("the scene has {count} {what}; expected {expected}")]
    Count {
        /// `obstacles` or `goals`.
        what: &'static str,
        /// Number of them.
        count: usize,
        /// The valid range.
        expected: &'static str,
    },
}

/// A planning problem: obstacles around a WAM with an open hand, a start and goals, in m and rad.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Obstacles in the base frame of the arm.
    pub scene: Scene,
    /// Joint angles at the start, rad.
    pub start: Joints<7>,
    /// Joint angles of which one is to be reached, rad.
    pub goals: Vec<Joints<7>>,
}

/// The form of a problem in a file.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct ProblemFile {
    start: [f64; 7],
    goals: Vec<[f64; 7]>,
    #[serde(default)]
    obstacles: Vec<ObstacleFile>,
}

/// The form of an obstacle in a file.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct ObstacleFile {
    name: String,
    shape: ShapeFile,
    /// x, y, z in m.
    position: [f64; 3],
    /// Roll, pitch and yaw in rad: fixed axes x, y, z in this order.
    #[serde(default)]
    rotation: [f64; 3],
}

/// The form of a shape in a file; lengths in m.
#[derive(Debug, Deserialize, Serialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum ShapeFile {
    Cuboid([f64; 3]),
    Cylinder { radius: f64, height: f64 },
    Sphere { radius: f64 },
    HalfSpace,
}

fn finite(what: &'static str, name: &str, values: &[f64]) -> Result<(), ProblemError> {
    let wrong = values
        .iter()
        .find(|value| value.is_nan() || value.abs() > 1e3);
    wrong.map_or(Ok(()), |&value| {
        Err(ProblemError::Value {
            what,
            name: name.to_owned(),
            value,
            expected: "a number between -1000 and 1000",
        })
    })
}

fn positive(what: &'static str, name: &str, values: &[f64]) -> Result<(), ProblemError> {
    finite(what, name, values)?;
    let wrong = values.iter().find(|value| **value <= 0.0);
    wrong.map_or(Ok(()), |&value| {
        Err(ProblemError::Value {
            what,
            name: name.to_owned(),
            value,
            expected: "a positive number of metres",
        })
    })
}

impl ObstacleFile {
    fn obstacle(&self) -> Result<Obstacle, ProblemError> {
        let name = &self.name;
        finite("position", name, &self.position)?;
        finite("rotation", name, &self.rotation)?;
        let shape = match self.shape {
            ShapeFile::Cuboid(edges) => {
                positive("edge", name, &edges)?;
                Shape::cuboid(edges)
            }
            ShapeFile::Cylinder { radius, height } => {
                positive("size", name, &[radius, height])?;
                Shape::cylinder(radius, height)
            }
            ShapeFile::Sphere { radius } => {
                positive("radius", name, &[radius])?;
                Shape::Sphere { radius }
            }
            ShapeFile::HalfSpace => Shape::HalfSpace,
        };
        let [roll, pitch, yaw] = self.rotation;
        let turn = Rotation3::from_euler_angles(roll, pitch, yaw);
        let pose = Pose::from_parts(self.position.into(), turn);
        Ok(Obstacle::new(name, shape, pose))
    }

    fn of(obstacle: &Obstacle) -> Self {
        let (roll, pitch, yaw) = obstacle.pose.rotation.euler_angles();
        let shape = match obstacle.shape {
            Shape::Cuboid { half } => ShapeFile::Cuboid((half * 2.0).into()),
            Shape::Cylinder {
                radius,
                half_height,
            } => ShapeFile::Cylinder {
                radius,
                height: 2.0 * half_height,
            },
            Shape::Sphere { radius } => ShapeFile::Sphere { radius },
            Shape::HalfSpace => ShapeFile::HalfSpace,
        };
        Self {
            name: obstacle.name.clone(),
            shape,
            position: obstacle.pose.translation.vector.into(),
            rotation: [roll, pitch, yaw],
        }
    }
}

impl Problem {
    /// Returns the problem that a JSON text describes.
    ///
    /// ```
    /// use yarp_planning::Problem;
    ///
    /// let problem = Problem::from_json(
    ///     r#"{
    ///         "start": [-0.6, 0.8, 0.0, 1.4, 0.0, 0.0, 0.0],
    ///         "goals": [[0.6, 0.8, 0.0, 1.4, 0.0, 0.0, 0.0]],
    ///         "obstacles": [
    ///             {"name": "pillar", "shape": {"cuboid": [0.1, 0.1, 1.0]}, "position": [0.6, 0.0, 0.2]},
    ///             {"name": "pole", "shape": {"cylinder": {"radius": 0.02, "height": 1.0}}, "position": [0.6, 0.5, 0.2]},
    ///             {"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "position": [0, 0.8, 0.2]},
    ///             {"name": "floor", "shape": "half_space", "position": [0, 0, -0.4], "rotation": [0, 0, 0]}
    ///         ]
    ///     }"#,
    /// )?;
    /// assert_eq!(problem.scene.obstacles().len(), 4);
    /// # Ok::<(), yarp_planning::ProblemError>(())
    /// ```
    ///
    /// Errors: [`ProblemError`].
    pub fn from_json(text: &str) -> Result<Self, ProblemError> {
        let file: ProblemFile = serde_json::from_str(text)?;
        let count = |what, count, expected, ok: bool| match ok {
            true => Ok(()),
            false => Err(ProblemError::Count {
                what,
                count,
                expected,
            }),
        };
        let (goals, obstacles) = (file.goals.len(), file.obstacles.len());
        count(
            "goals",
            goals,
            "1 to 10000",
            (1..=MAX_ENTRIES).contains(&goals),
        )?;
        count(
            "obstacles",
            obstacles,
            "at most 10000",
            obstacles <= MAX_ENTRIES,
        )?;
        finite("joint angle", "the start", &file.start)?;
        let mut scene = Scene::default();
        for obstacle in &file.obstacles {
            scene.add(obstacle.obstacle()?);
        }
        for goal in &file.goals {
            finite("joint angle", "a goal", goal)?;
        }
        Ok(Self {
            scene,
            start: file.start.into(),
            goals: file.goals.into_iter().map(Joints::from).collect(),
        })
    }

    /// Returns the problem as JSON, in the form that [`from_json`](Self::from_json) reads.
    pub fn to_json(&self) -> String {
        let file = ProblemFile {
            start: self.start.into(),
            goals: self.goals.iter().map(|goal| (*goal).into()).collect(),
            obstacles: self
                .scene
                .obstacles()
                .iter()
                .map(ObstacleFile::of)
                .collect(),
        };
        serde_json::to_string(&file).expect("numbers and names have a JSON form")
    }

    /// Returns the shape of the arm of problems: a WAM with an open hand.
    pub fn geometry() -> ArmGeometry {
        ArmGeometry::wam_with_hand(&[FingerJoints::default(); 3])
    }

    /// Returns a planner for the problem.
    pub fn planner(&self) -> Planner {
        Planner::with_geometry(&WamModel::<7>::new(), Self::geometry(), self.scene.clone())
    }

    /// Returns the random problem number `index` of the set `seed`.
    ///
    /// A table with 8 to 16 boxes and cylinders up to 0.35 m high, a wall, a post, and up to three boxes above the table.
    /// Start and goal are free postures: the hand points down at the height of a grasp or above, or the arm is anywhere.
    /// Nothing ensures that a path exists.
    pub fn random(seed: u64, index: u64) -> Self {
        let mut random = Random::new(seed.wrapping_mul(0x9E37_79B9).wrapping_add(index) ^ 0x5EED);
        loop {
            let scene = cluttered_table(&mut random);
            let chain = WamModel::<7>::new().chain;
            let model = CollisionModel::new(&chain, Self::geometry(), scene.clone());
            let start = free_posture(&model, &mut random);
            let goal = free_posture(&model, &mut random);
            if let (Some(start), Some(goal)) = (start, goal) {
                return Self {
                    scene,
                    start,
                    goals: vec![goal],
                };
            }
        }
    }
}

/// Height of the table's surface, m.
const SURFACE: f64 = -0.05;

fn cluttered_table(random: &mut Random) -> Scene {
    let mut scene = Scene::default();
    let slab = Shape::cuboid([0.70, 1.0, 0.05]);
    scene.add(Obstacle::new(
        "table",
        slab,
        Pose::translation(0.60, 0.0, SURFACE - 0.025),
    ));
    let floor = Pose::translation(0.0, 0.0, -0.90);
    scene.add(Obstacle::new("floor", Shape::HalfSpace, floor));
    let count = 8 + (random.unit() * 9.0) as usize;
    for number in 0..count {
        let size = [
            random.between(0.04, 0.15),
            random.between(0.04, 0.15),
            random.between(0.05, 0.35),
        ];
        let place = Translation3::new(
            random.between(0.30, 0.90),
            random.between(-0.45, 0.45),
            SURFACE + size[2] / 2.0,
        );
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), random.between(-1.6, 1.6));
        let shape = match number % 2 {
            0 => Shape::cuboid(size),
            _ => Shape::cylinder(size[0] / 2.0, size[2]),
        };
        let name = format!("object {number}");
        scene.add(Obstacle::new(name, shape, Pose::from_parts(place, turn)));
    }
    let side = if random.unit() < 0.5 { -1.0 } else { 1.0 };
    let wall = Pose::translation(
        random.between(0.1, 0.6),
        side * random.between(0.65, 0.9),
        0.4,
    );
    scene.add(Obstacle::new("wall", Shape::cuboid([0.6, 0.05, 1.2]), wall));
    let post = Pose::translation(random.between(0.35, 0.8), random.between(-0.4, 0.4), 0.4);
    scene.add(Obstacle::new(
        "post",
        Shape::cylinder(random.between(0.02, 0.05), 0.9),
        post,
    ));
    for number in 0..(random.unit() * 4.0) as usize {
        let size = std::array::from_fn(|_| random.between(0.05, 0.25));
        let angle = random.between(-1.8, 1.8);
        let radius = random.between(0.35, 0.8);
        let height = random.between(0.3, 0.9);
        let place = Pose::translation(radius * angle.cos(), radius * angle.sin(), height);
        scene.add(Obstacle::new(
            format!("shelf {number}"),
            Shape::cuboid(size),
            place,
        ));
    }
    scene
}

/// Draws a free posture: two of three with the hand above the table, pointing down.
fn free_posture(model: &CollisionModel, random: &mut Random) -> Option<Joints<7>> {
    let limits = *model.chain().limits();
    let solver = Solver::new(model.chain().clone());
    for _ in 0..200 {
        let drawn =
            Joints::<7>::from_fn(|joint, _| random.between(limits[joint].min, limits[joint].max));
        let posture = match random.unit() < 0.67 {
            false => drawn,
            true => {
                let place = Translation3::new(
                    random.between(0.35, 0.75),
                    random.between(-0.35, 0.35),
                    random.between(0.12, 0.40),
                );
                let down = EulerXyz::new(std::f64::consts::PI, 0.0, 0.0).rotation();
                let yaw = Rotation3::from_axis_angle(&Vector3::z_axis(), random.between(-3.1, 3.1));
                let target = Pose::from_parts(place, yaw * down);
                let near =
                    Joints::<7>::from([place.y.atan2(place.x), 0.6, 0.0, 2.0, 0.0, 0.5, 0.0]);
                match solver.solve(&target, &near) {
                    Ok(solution) => solution.joints,
                    Err(_) => continue,
                }
            }
        };
        if model.is_free(&posture) {
            return Some(posture);
        }
    }
    None
}
