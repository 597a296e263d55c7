//! Visual servoing on the simulated table against open loop, with an error of the hand-eye calibration.
//!
//! The tool is a pattern that the hand holds; it belongs beside a box, 14 cm before it and 8 cm above its upper face. Arm,
//! physics and camera pass the time in lockstep, the image one interval late. Client code gets joint positions and images.

use std::f64::consts::{FRAC_PI_2, PI};
use std::time::Duration;

use nalgebra::{Matrix3, Rotation3, Vector3};
use yarp_devices::kinematics::{Chain, Joints, Solver, rotation_vector};
use yarp_devices::wam::WamModel;
use yarp_devices::{Axes, Mode};
use yarp_table::{
    DepthNoise, Effects, Finish, MountedBoard, Random, Renderer, Scene, Shape, SimulationOptions,
    TableSimulation,
};

use super::table_setup;
use crate::calibration::{CalibrationError, Pattern, detect, pattern_pose};
use crate::servoing::{
    Correction, Observation, ServoError, ServoOptions, Servoed, ServoedTool, follow_goal,
    joint_step,
};
use crate::{
    CameraModel, DepthImage, Detector, DetectorParameters, Image, ObjectDatabase, Pose, Result,
    VisionError,
};

type Source = Box<dyn std::error::Error + Send + Sync>;

/// Place of the tool's board relative to the middle of the object's upper face, m.
const OFFSET: [f64; 3] = [-0.14, 0.0, 0.08];
/// Displacement from which the last centimetres of the approach begin, m.
const STANDOFF: [f64; 3] = [-0.02, 0.01, 0.03];
/// Side of the pattern's squares, m.
const SQUARE: f64 = 0.015;
/// Pieces of a motion of the arm during one image.
const PIECES: u32 = 10;
/// Time of the open-loop motion, and until the arm is at rest, s.
const APPROACH: f64 = 1.5;
const REST: f64 = 1.0;
/// Posture near which postures are looked for, rad: elbow up, hand down.
const POSTURE: [f64; 7] = [0.0, 0.2, 0.0, 2.0, 0.0, 0.94, 0.0];

/// Error of the calibration and conditions of a trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoTrialOptions {
    /// Length of the error of the camera's position, m.
    pub position_error: f64,
    /// Angle of the error of its direction, rad.
    pub angle_error: f64,
    /// Images per second.
    pub rate: f64,
    /// Options of the control law.
    pub servo: ServoOptions,
}

impl Default for ServoTrialOptions {
    /// 5 mm, 0.5 degrees, 10 images a second.
    fn default() -> Self {
        Self {
            position_error: 0.005,
            angle_error: 0.5_f64.to_radians(),
            rate: 10.0,
            servo: ServoOptions::default(),
        }
    }
}

/// Result of a trial: true distance (m) and angle (rad) of the tool from its goal.
#[derive(Debug)]
pub struct ServoTrial {
    /// After the motion by the calibration alone.
    pub open_loop: [f64; 2],
    /// After visual servoing.
    pub closed_loop: [f64; 2],
    /// Result of visual servoing.
    pub servoed: Result<Servoed, ServoError>,
    /// Simulated duration of the servoing, s.
    pub seconds: f64,
}

/// Runs trial number `index` of a seed: the same approach without and with visual servoing.
///
/// Errors: [`VisionError`] if the object is not found or out of reach before anything moves.
pub fn servo_trial(seed: u64, index: u64, options: &ServoTrialOptions) -> Result<ServoTrial> {
    let mut random = Random::for_purpose(seed.wrapping_add(index), 0x5e40);
    let setup = Setup::random(&mut random, options)?;
    let goal = setup.first_goal(seed)?;
    let start = moved(&goal, STANDOFF);
    let start = setup.joints(&start)?;
    let there = setup.joints(&goal)?;

    let mut tool = TrialTool::new(&setup, start, options, seed)?;
    tool.go(&there, APPROACH).map_err(unsuitable)?;
    tool.run(REST);
    let open_loop = setup.error(&tool.simulation);

    let mut tool = TrialTool::new(&setup, start, options, seed)?;
    tool.run(REST);
    let begin = tool.simulation.time();
    let servoed = follow_goal(&mut tool, &options.servo);
    let seconds = (tool.simulation.time() - begin).as_secs_f64();
    tool.run(REST);
    Ok(ServoTrial {
        open_loop,
        closed_loop: setup.error(&tool.simulation),
        servoed,
        seconds,
    })
}

fn unsuitable(error: impl std::fmt::Display) -> VisionError {
    VisionError::Unsuitable {
        what: "trial of visual servoing".to_owned(),
        expected: "an object that is found and within reach".to_owned(),
        actual: error.to_string(),
    }
}

fn moved(pose: &Pose, by: [f64; 3]) -> Pose {
    let place = pose.translation.vector + Vector3::from(by);
    Pose::from_parts(place.into(), pose.rotation)
}

/// Scene, cameras as the client believes them to be, and the tool.
struct Setup {
    scene: Scene,
    camera: CameraModel,
    depth: CameraModel,
    pattern: Pattern,
    grid_to_board: Pose,
    /// The arm with the pattern as its tool.
    chain: Chain<7>,
}

impl Setup {
    fn random(random: &mut Random, options: &ServoTrialOptions) -> Result<Self> {
        let pattern = Pattern::new(9, 6, SQUARE).map_err(unsuitable)?;
        let shape = Shape::Board {
            columns: pattern.columns(),
            rows: pattern.rows(),
            square: SQUARE,
        };
        // The pattern's x, y and z are the board's y, x and -z.
        let turn = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        let first = shape.board_corners()[0].coords;
        let grid_to_board = Pose::from_parts(first.into(), Rotation3::from_matrix_unchecked(turn));
        // Beside the hand, its face to the camera when the hand points down.
        let over = Rotation3::from_axis_angle(&Vector3::x_axis(), PI);
        let board = MountedBoard {
            shape,
            pose: Pose::from_parts(Vector3::new(0.14, 0.0, 0.10).into(), over),
        };
        let mut scene = Scene::empty();
        let finish = Finish {
            colour: [0.75, 0.15, 0.1],
            ..Finish::default()
        };
        let size = [0.06, 0.09, 0.06];
        let (x, y) = (random.between(0.62, 0.66), random.between(-0.06, 0.06));
        scene.put(Shape::Box { size }, x, y, random.between(-0.3, 0.3), finish);
        scene.board = Some(board);
        let truth = table_setup();
        let mut direction = |length: f64| {
            let free = Vector3::from_fn(|_, _| random.gaussian());
            free * (length / free.norm().max(1e-9))
        };
        let shift = direction(options.position_error);
        let bump = Pose::from_parts(shift.into(), Rotation3::new(direction(options.angle_error)));
        let mut camera = truth.camera;
        let mut depth = truth.depth.unwrap_or(camera);
        let wrong = camera.pose * bump * camera.pose.inverse();
        (camera.pose, depth.pose) = (wrong * camera.pose, wrong * depth.pose);
        let chain = WamModel::<7>::new().chain;
        Ok(Self {
            scene,
            camera,
            depth,
            pattern,
            grid_to_board,
            chain: chain.with_tool(board.pose * grid_to_board),
        })
    }

    fn detector(&self) -> Result<Detector> {
        let text = "<objects><object name='box' shape='rectangle' sides='0.05 0.10' height='0.05 0.07'/></objects>";
        let none = |name: &str| Err(unsuitable(name));
        let database = ObjectDatabase::parse(text, "of the trial", none)?;
        let setup = crate::DetectorSetup {
            camera: self.camera,
            depth: Some(self.depth),
            surface: self.scene.table.surface,
        };
        Detector::new(database, setup, DetectorParameters::default())
    }

    /// Returns the goal of the tool beside an object whose upper face is here, turned by this angle.
    fn goal(&self, face: Vector3<f64>, yaw: f64) -> Pose {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        let place = face + turn * Vector3::from(OFFSET);
        Pose::from_parts(place.into(), turn) * self.grid_to_board
    }

    /// Returns the goal that the images show.
    fn seen_goal(
        &self,
        detector: &mut Detector,
        shot: &(Image, DepthImage),
    ) -> Result<Option<Pose>> {
        let found = detector.detect(&shot.0, Some(&shot.1))?;
        let [object] = found.as_slice() else {
            return Ok(None);
        };
        let pose = object.pose;
        Ok(pose.and_then(|pose| {
            // The longer side runs along y, in one of its two directions.
            let yaw = pose.yaw? - FRAC_PI_2;
            let yaw = if yaw < -FRAC_PI_2 { yaw + PI } else { yaw };
            Some(self.goal(pose.position.coords, yaw))
        }))
    }

    /// Returns the goal before the arm comes into view.
    fn first_goal(&self, seed: u64) -> Result<Pose> {
        let mut scene = self.scene.clone();
        scene.board = None;
        let shot = shot(&Renderer::new(), &scene, seed);
        let goal = self.seen_goal(&mut self.detector()?, &shot)?;
        goal.ok_or_else(|| unsuitable("no object"))
    }

    fn joints(&self, tool: &Pose) -> Result<Joints<7>> {
        let solver = Solver::new(self.chain.clone());
        let solution = solver.solve_nearest(tool, &Joints::from(POSTURE));
        Ok(solution.map_err(unsuitable)?.joints)
    }

    /// Returns the true distance and angle between tool and goal.
    fn error(&self, simulation: &TableSimulation) -> [f64; 2] {
        let tool = self.chain.forward(&simulation.arm().simulator().angles());
        let object = &simulation.scene().objects[0];
        let face = object.pose.translation.vector + Vector3::z() * object.shape.half_height();
        let goal = self.goal(face, object.pose.rotation.euler_angles().2);
        let turn = rotation_vector(&(goal.rotation * tool.rotation.inverse()));
        let way = goal.translation.vector - tool.translation.vector;
        [way.norm(), turn.norm()]
    }
}

/// Returns what both sensors see.
fn shot(renderer: &Renderer, scene: &Scene, seed: u64) -> (Image, DepthImage) {
    let effects = Effects {
        seed,
        ..Effects::default()
    };
    let noise = DepthNoise {
        seed,
        ..DepthNoise::default()
    };
    let image = renderer.render(scene, &scene.camera(), &effects).image;
    let depth = renderer.depth(scene, &scene.depth_camera(), &noise);
    let depth = DepthImage::new(depth.width, depth.height, depth.metres)
        .expect("the renderer makes a value per pixel");
    (image, depth)
}

/// The arm with the pattern, in lockstep with the camera.
struct TrialTool<'a> {
    setup: &'a Setup,
    simulation: TableSimulation,
    renderer: Renderer,
    detector: Detector,
    joints: Joints<7>,
    target: Joints<7>,
    interval: f64,
    seed: u64,
    number: u64,
}

impl<'a> TrialTool<'a> {
    fn new(
        setup: &'a Setup,
        start: Joints<7>,
        options: &ServoTrialOptions,
        seed: u64,
    ) -> Result<Self> {
        let mut how = SimulationOptions::default();
        (how.joints, how.seed) = (Some(start.into()), seed);
        let mut simulation = TableSimulation::new(setup.scene.clone(), how);
        let direct = [Mode::PositionDirect; 7];
        let set = simulation.arm_mut().set_control_modes(Axes::All, &direct);
        set.map_err(unsuitable)?;
        Ok(Self {
            setup,
            simulation,
            renderer: Renderer::new(),
            detector: setup.detector()?,
            joints: start,
            target: start,
            interval: 1.0 / options.rate,
            seed,
            number: 0,
        })
    }

    fn run(&mut self, seconds: f64) {
        self.simulation.run(Duration::from_secs_f64(seconds));
    }

    /// Moves to joint angles within a time.
    fn go(&mut self, target: &Joints<7>, seconds: f64) -> Result<(), Source> {
        let pieces = PIECES * (seconds / self.interval).ceil().max(1.0) as u32;
        let from = self.joints;
        for piece in 1..=pieces {
            let part = f64::from(piece) / f64::from(pieces);
            self.joints = from + (target - from) * part;
            let degrees = self.joints.map(f64::to_degrees);
            let arm = self.simulation.arm_mut();
            arm.set_direct_positions(Axes::All, degrees.as_slice())?;
            self.run(seconds / f64::from(pieces));
        }
        self.target = *target;
        Ok(())
    }
}

impl ServoedTool for TrialTool<'_> {
    fn observe(&mut self) -> Result<(Duration, Option<Observation>), Source> {
        self.number += 1;
        let seed = self.seed.wrapping_add(self.number);
        let shot = shot(&self.renderer, self.simulation.scene(), seed);
        // The image is evaluated while the arm follows the correction before.
        let target = self.target;
        self.go(&target, self.interval)?;
        let setup = self.setup;
        let camera = &setup.camera;
        let tool = match detect(&shot.0, &setup.pattern, "image") {
            Ok(found) => {
                let grid = pattern_pose(&setup.pattern, &camera.intrinsics, &found.corners)?;
                Some(camera.pose * grid)
            }
            Err(CalibrationError::NoPattern { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        let goal = setup.seen_goal(&mut self.detector, &shot)?;
        let observation = Observation {
            number: self.number,
            tool,
            goal,
        };
        Ok((self.simulation.time(), Some(observation)))
    }

    fn correct(&mut self, correction: &Correction) -> Result<(), Source> {
        self.target = joint_step(&self.setup.chain, &self.joints, correction)?;
        Ok(())
    }

    fn hold(&mut self) -> Result<(), Source> {
        self.target = self.joints;
        let degrees = self.joints.map(f64::to_degrees);
        let arm = self.simulation.arm_mut();
        Ok(arm.set_direct_positions(Axes::All, degrees.as_slice())?)
    }
}
