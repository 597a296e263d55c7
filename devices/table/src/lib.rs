//! A simulated kitchen table: objects, arm, hand, cameras, and the truth about them.
//!
//! It is the far end of the network: programs that see and grasp use the devices it serves, never its inside.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `table_scene`, `object`, `bricks`, `simulated_robot` | [`Scene`]: table, baskets, objects, posture of arm and hand |
//! | `placement` | random tables |
//! | `table_camera`, `lighting` | [`Camera`]: projection; [`Lighting`], [`Effects`] |
//! | `texture/` | wood and print |
//! | `render/` | [`Renderer`]: images, masks and depth |
//! | `physics/`, `simulation` | [`TableSimulation`]: bodies, arm and hand, stepped by their owner |
//! | `live` | [`LiveTable`]: the same in real time, as devices |
//! | `dataset` | [`Dataset`]: images with truth |
//! | `truth` | [`GroundTruth`]: what is where, as XML |
//!
//! Units are m, kg, s, N and **radians**; poses are in the arm's base frame, z up, unless said otherwise.
//!
//! ```
//! use yarp_table::{Effects, Placement, Renderer, Scene};
//!
//! let scene = Scene::random(7, &Placement::default()).unwrap();
//! let mut camera = scene.camera();
//! // A quarter of the size, so that the example is quick.
//! camera.lens = camera.lens.scaled(0.25);
//! let shot = Renderer::new().render(&scene, &camera, &Effects::default());
//! assert_eq!(shot.image.width(), 322);
//! assert_eq!(shot.truth.objects.len(), 8);
//! ```

mod bricks;
mod dataset;
mod lighting;
#[cfg(unix)]
mod live;
mod object;
mod physics;
mod placement;
mod png_files;
mod random;
mod render;
pub mod simulated_robot;
mod simulation;
mod table_camera;
mod table_scene;
mod texture;
mod truth;

/// A place and an orientation, as a transform into the arm's base frame.
pub use yarp_devices::kinematics::Pose;

pub use bricks::{BrickKind, Face};
pub use dataset::{Dataset, DatasetOptions, objects_xml, write_models, write_shot};
pub use lighting::{Effects, Lamp, Lighting};
#[cfg(unix)]
pub use live::{
    DEPTH_FROM, DEPTH_STEP, LiveOptions, LiveTable, TableArm, TableCamera, TableStatistics,
};
pub use object::{BOARD_THICKNESS, Class, Finish, Object, Shape};
pub use physics::{Contact, Other, PathCheck, Physics, Reaction, RobotState, STEP, Solid};
pub use placement::{NoRoom, Placement};
pub use png_files::{OutputError, write_gray, write_image};
pub use random::Random;
pub use render::{Depth, DepthNoise, Renderer, Shot};
pub use simulated_robot::{HandPosture, RobotPosture};
pub use simulation::{SimulationOptions, TableSimulation, arm_model};
pub use table_camera::{Camera, Lens};
pub use table_scene::{
    BASKET_WALL, Basket, CAMERA_HEIGHT, MIDDLE, MountedBoard, SURFACE, Scene, Table,
};
pub use texture::brick_face;
pub use truth::{CameraTruth, GroundTruth, Mask, ObjectTruth, TruthError};
