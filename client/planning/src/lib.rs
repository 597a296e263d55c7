//! Collision-free motions and grasps for an arm.
//!
//! ```
//! use nalgebra::Vector3;
//! use yarp_devices::kinematics::Pose;
//! use yarp_devices::wam::WamModel;
//! use yarp_planning::{Obstacle, Planner, Scene, Shape};
//!
//! let model = WamModel::<7>::new();
//! let mut scene = Scene::default();
//! scene.add(Obstacle::new("pillar", Shape::cuboid([0.1, 0.1, 1.0]), Pose::translation(0.5, 0.0, 0.2)));
//! let mut planner = Planner::new(&model, scene);
//! let start = [-0.6, 0.8, 0.0, 1.4, 0.0, 0.0, 0.0].into();
//! let goal = [0.6, 0.8, 0.0, 1.4, 0.0, 0.0, 0.0].into();
//! let path = planner.plan(&start, &[goal])?;
//! let trajectory = planner.trajectory(&path)?;
//! assert!(trajectory.duration() > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | `planning_scene`, `obstacle_shape` | obstacles in the base frame of the arm |
//! | `collision/` | the arm as spheres, clearance of a posture, continuous checks of a motion |
//! | `rrt_connect` | bidirectional random trees (Kuffner and LaValle 2000) |
//! | `path/` | shortcuts, time parameterisation within velocity and acceleration limits |
//! | `planner` | all of it behind one type |
//! | `problem` | scenes with start and goals, random or from JSON |
//!
//! Units are metres, **radians**, seconds; poses are in the base frame of the arm.

mod collision;
mod obstacle_shape;
mod path;
mod planner;
mod planning_scene;
mod problem;
mod rrt_connect;

pub use collision::{ArmGeometry, CollisionModel, Contact, LinkSphere, MARGIN};
pub use obstacle_shape::Shape;
pub use path::{Path, Trajectory, TrajectoryError};
pub use planner::{PlanError, Planner, PlannerOptions};
pub use planning_scene::{Obstacle, Scene};
pub use problem::{Problem, ProblemError};
