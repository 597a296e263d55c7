//! The unattended calibration: moves the arm from posture to posture and takes an image at each.

use std::thread;
use std::time::{Duration, Instant};

use nalgebra::Point3;
use yarp_client::{Camera, Robot};
use yarp_devices::kinematics::Joints;
use yarp_devices::wam::WamModel;
use yarp_devices::{Axes, FrameGrabberImage, MotionControl, PositionControl};
use yarp_planning::{ArmGeometry, CollisionModel, Obstacle, PlanError, Planner, Scene, Shape};

use super::postures::PostureChoice;
use super::{CalibrationError, HandEye, Pattern, Result, StaticScene, View, detect};
use crate::{Frame, Pose};

/// Minimum time that a motion may take, in s, whatever its length.
const MIN_MOVE_TIMEOUT: f64 = 20.0;
/// Time that the camera may take for an image.
const IMAGE_TIMEOUT: Duration = Duration::from_secs(5);
/// Time that the arm may take to come to rest after a motion.
const REST_TIMEOUT: Duration = Duration::from_secs(5);
/// Interval between two reads of positions or images.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Number of consecutive reads without motion that are rest.
const REST_READS: u32 = 5;
/// Motion between two reads below which a joint is at rest, in degrees.
const REST_MOTION: f64 = 0.01;
/// Distance from the target at which a joint has arrived, in degrees.
const ARRIVED: f64 = 1.0;
/// Images that may show the time before the arm came to rest.
const OLD_IMAGES: u64 = 2;
/// Distance that motions keep from every obstacle, in m.
const MARGIN: f64 = 0.02;
/// Longest straight motion out of a folded posture between two collision checks, in rad.
const UNFOLD_STEP: f64 = 0.02;
/// Edges of the table with the space below, where no arm belongs, in m.
const TABLE_EDGES: [f64; 3] = [0.70, 0.80, 0.40];
/// Posture that a folded arm goes to first, in rad: elbow up, hand above the front edge of the table.
const UNFOLDED: [f64; 7] = [0.0, -0.6, 0.0, 2.2, 0.0, 0.0, 0.0];

/// Options of a [`Session`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SessionOptions {
    /// The pattern.
    pub pattern: Pattern,
    /// Guess of camera, camera pose and pattern in the hand: a few cm and degrees wrong at most.
    pub guess: HandEye,
    /// Number of images to take.
    pub count: usize,
    /// Speed of the joints, in deg/s.
    pub speed: f64,
    /// Smallest and largest distance of the pattern from the camera, in m.
    pub distances: [f64; 2],
    /// Obstacles in the world.
    pub scene: Scene,
    /// Shape of arm and hand without the pattern.
    pub geometry: ArmGeometry,
    /// Seed of the choice of postures.
    pub seed: u64,
}

impl SessionOptions {
    /// Returns 25 images, 40 deg/s, a distance of 0.5 to 0.8 m, no obstacles and a WAM with an open BarrettHand.
    pub fn new(pattern: Pattern, guess: HandEye) -> Self {
        let mut geometry = ArmGeometry::wam_with_palm();
        // Open fingers: F1 and F2 side by side, F3 opposite (tips from the hand's Denavit-Hartenberg table).
        for (x, y) in [(-0.025, -1.0), (0.025, -1.0), (0.0, 1.0)] {
            let from = Point3::new(x, y * 0.05, 0.076);
            let to = Point3::new(x, y * 0.149, 0.121);
            geometry = geometry.with_capsule(7, from, to, 0.012);
        }
        Self {
            pattern,
            guess,
            count: 25,
            speed: 40.0,
            distances: [0.5, 0.8],
            scene: Scene::default(),
            geometry,
            seed: 0,
        }
    }
}

/// Views taken by a session.
#[derive(Clone, Debug, Default)]
pub struct Taken {
    /// Views with a pattern, and the joint angles read with each, in rad.
    pub views: Vec<(View, Joints<7>)>,
    /// Names of the images in which the pattern was not found.
    pub without_pattern: Vec<String>,
    /// Scene behind arm and pattern, from all images.
    pub scene: StaticScene,
}

/// Moves an arm that holds a pattern and takes images of it, over the network.
///
/// After any error the arm is told to stop and holds its position.
#[derive(Debug)]
pub struct Session<'a> {
    arm: &'a Robot,
    camera: &'a Camera,
    options: SessionOptions,
    chain: yarp_devices::kinematics::Chain<7>,
    planner: Planner,
}

impl<'a> Session<'a> {
    /// Prepares a session; nothing moves.
    pub fn new(arm: &'a Robot, camera: &'a Camera, options: SessionOptions) -> Self {
        let model = WamModel::<7>::new();
        let geometry = with_pattern(options.geometry.clone(), &options);
        let checks = CollisionModel::new(&model.chain, geometry, options.scene.clone());
        Self {
            arm,
            camera,
            planner: Planner::with_model(checks.with_margin(MARGIN)),
            chain: model.chain,
            options,
        }
    }

    /// Chooses postures, visits them, and returns what the camera saw.
    ///
    /// `taken` is called after each image with its number and the number of all; it returns false to end early.
    ///
    /// Errors: [`CalibrationError::NoPostures`], [`CalibrationError::Unreachable`], [`CalibrationError::NotArrived`],
    /// [`CalibrationError::CameraStopped`], [`CalibrationError::Covered`], [`CalibrationError::Device`].
    pub fn run(&mut self, progress: impl FnMut(usize, usize) -> bool) -> Result<Taken> {
        let choice = PostureChoice {
            guess: &self.options.guess,
            pattern: &self.options.pattern,
            model: self.planner.model(),
            distances: self.options.distances,
            seed: self.options.seed,
        };
        let postures = choice.choose(self.options.count)?;
        self.visit(&postures, progress)
    }

    /// Visits given postures, in rad, and returns what the camera saw; see [`run`](Self::run).
    ///
    /// Errors: also [`CalibrationError::Singular`], before anything moves.
    pub fn visit(
        &mut self,
        postures: &[Joints<7>],
        progress: impl FnMut(usize, usize) -> bool,
    ) -> Result<Taken> {
        for (index, joints) in postures.iter().enumerate() {
            PostureChoice::check_singularity(&self.chain, index, joints)?;
        }
        let outcome = self.visit_all(postures, progress);
        if outcome.is_err() {
            // The error is the caller's; an arm that does not hear this holds by itself when its client is gone.
            let _ = self.arm.stop(Axes::All);
        }
        outcome
    }

    fn visit_all(
        &mut self,
        postures: &[Joints<7>],
        mut progress: impl FnMut(usize, usize) -> bool,
    ) -> Result<Taken> {
        let speeds = [self.options.speed; 7];
        self.arm
            .set_reference_speeds(Axes::All, &speeds)
            .map_err(device("setting the speed"))?;
        let mut taken = Taken::default();
        for (index, goal) in postures.iter().enumerate() {
            self.approach(index, goal)?;
            self.take(index, &mut taken)?;
            if !progress(index + 1, postures.len()) {
                break;
            }
        }
        Ok(taken)
    }

    fn take(&self, index: usize, taken: &mut Taken) -> Result<()> {
        let name = format!("image {index}");
        self.wait_rest()?;
        let frame = self.new_image()?;
        let joints = self.joints()?;
        let kept = taken.scene.add(&frame.image);
        kept.map_err(|error| CalibrationError::Image {
            image: name.clone(),
            source: Box::new(error),
        })?;
        match detect(&frame.image, &self.options.pattern, &name) {
            Ok(found) => {
                let view = View {
                    name,
                    corners: found.corners,
                    hand_to_world: self.chain.forward(&joints),
                };
                taken.views.push((view, joints));
                Ok(())
            }
            Err(CalibrationError::NoPattern { image, .. }) => {
                taken.without_pattern.push(image);
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    /// Returns the joint angles, in rad.
    fn joints(&self) -> Result<Joints<7>> {
        let degrees = self
            .arm
            .positions()
            .map_err(device("reading the arm's positions"))?;
        if degrees.len() != 7 {
            return Err(CalibrationError::Device {
                step: "reading the arm's positions",
                source: Box::new(yarp_devices::DeviceError::Unsuitable {
                    what: "the number of axes of the arm",
                    asked: degrees.len().to_string(),
                    expected: "7".to_owned(),
                }),
            });
        }
        Ok(Joints::from_fn(|joint, _| degrees[joint].to_radians()))
    }

    /// Moves along a path without collisions.
    fn approach(&mut self, index: usize, goal: &Joints<7>) -> Result<()> {
        let here = self.chain.clamp(&self.joints()?);
        let unreachable = |source| CalibrationError::Unreachable {
            posture: index,
            source: Box::new(source),
        };
        let path = match self.planner.plan(&here, &[*goal]) {
            Ok(path) => path,
            Err(error @ PlanError::StartInCollision { .. }) => {
                // A folded arm lies on itself: it unfolds straight, if that meets no obstacle.
                let unfolded = Joints::from(UNFOLDED);
                if !self.may_unfold(&here, &unfolded) {
                    return Err(unreachable(error));
                }
                self.go(index, &unfolded)?;
                self.planner
                    .plan(&unfolded, &[*goal])
                    .map_err(unreachable)?
            }
            Err(error) => return Err(unreachable(error)),
        };
        path.postures()[1..]
            .iter()
            .try_for_each(|posture| self.go(index, posture))
    }

    /// Returns true if a straight motion meets no obstacle, and the arm does not come nearer to itself on it.
    fn may_unfold(&self, from: &Joints<7>, to: &Joints<7>) -> bool {
        let steps = ((to - from).amax() / UNFOLD_STEP).ceil().max(1.0);
        let mut clearance = f64::NEG_INFINITY;
        (0..=steps as usize).all(|step| {
            let posture = from + (to - from) * (step as f64 / steps);
            match self.planner.model().contact(&posture) {
                Some((distance, yarp_planning::Contact::Arm { .. })) if distance < 0.0 => {
                    let farther = distance >= clearance - 1e-3;
                    clearance = distance;
                    farther
                }
                Some((distance, _)) => distance >= 0.0,
                None => true,
            }
        })
    }

    /// Moves straight to a posture, in rad, and waits until the arm is there.
    fn go(&self, index: usize, posture: &Joints<7>) -> Result<()> {
        let target: Vec<f64> = posture.iter().map(|angle| angle.to_degrees()).collect();
        let away = |positions: &[f64]| {
            let distances = positions
                .iter()
                .zip(&target)
                .map(|(one, other)| (one - other).abs());
            let farthest = distances
                .enumerate()
                .max_by(|one, other| one.1.total_cmp(&other.1));
            farthest.unwrap_or((0, f64::INFINITY))
        };
        let read = || {
            self.arm
                .positions()
                .map_err(device("reading the arm's positions"))
        };
        let longest = away(&read()?).1 / self.options.speed;
        let seconds = MIN_MOVE_TIMEOUT.max(4.0 * longest);
        self.arm
            .position_move(Axes::All, &target)
            .map_err(device("moving the arm"))?;
        let done = self
            .arm
            .wait_motion_done(Axes::All, Duration::from_secs_f64(seconds))
            .map_err(device("waiting for the arm"))?;
        let (joint, degrees) = away(&read()?);
        if done && degrees <= ARRIVED {
            return Ok(());
        }
        let rest = Instant::now() + REST_TIMEOUT;
        while done && Instant::now() < rest {
            thread::sleep(POLL_INTERVAL);
            if away(&read()?).1 <= ARRIVED {
                return Ok(());
            }
        }
        Err(CalibrationError::NotArrived {
            posture: index,
            seconds,
            joint,
            degrees,
        })
    }

    /// Waits until the arm has come to rest; an arm that trembles is taken as it is after a while.
    fn wait_rest(&self) -> Result<()> {
        let deadline = Instant::now() + REST_TIMEOUT;
        let read = || {
            self.arm
                .positions()
                .map_err(device("reading the arm's positions"))
        };
        let (mut before, mut still) = (read()?, 0);
        while still < REST_READS && Instant::now() < deadline {
            thread::sleep(POLL_INTERVAL);
            let now = read()?;
            let moved = before
                .iter()
                .zip(&now)
                .any(|(a, b)| (a - b).abs() > REST_MOTION);
            still = if moved { 0 } else { still + 1 };
            before = now;
        }
        Ok(())
    }

    /// Returns an image that was taken after this call.
    fn new_image(&self) -> Result<Frame> {
        let deadline = Instant::now() + IMAGE_TIMEOUT;
        let mut first = None;
        loop {
            match self.camera.image() {
                Ok(frame) => {
                    let first = *first.get_or_insert(frame.number);
                    if frame.number.wrapping_sub(first) >= OLD_IMAGES {
                        return Ok(frame);
                    }
                }
                Err(
                    yarp_devices::DeviceError::Stale { .. }
                    | yarp_devices::DeviceError::NoDataYet { .. },
                ) => {}
                Err(source) => {
                    return Err(CalibrationError::Device {
                        step: "taking an image",
                        source: Box::new(source),
                    });
                }
            }
            if Instant::now() >= deadline {
                return Err(CalibrationError::CameraStopped {
                    camera: self.camera.remote().to_owned(),
                    seconds: IMAGE_TIMEOUT.as_secs_f64(),
                });
            }
            thread::sleep(POLL_INTERVAL);
        }
    }
}

fn device(step: &'static str) -> impl FnOnce(yarp_devices::DeviceError) -> CalibrationError {
    move |source| CalibrationError::Device {
        step,
        source: Box::new(source),
    }
}

/// Returns the table of the thesis as an obstacle, with its surface at this height of the world, in m.
///
/// It begins in front of the arm's base, which stands lower.
pub fn table_obstacle(surface: f64) -> Scene {
    let mut scene = Scene::default();
    let middle = Pose::translation(0.55, 0.0, surface - TABLE_EDGES[2] / 2.0);
    scene.add(Obstacle::new("table", Shape::cuboid(TABLE_EDGES), middle));
    scene
}

/// Adds the pattern with its border to the hand, as rods along its rows.
fn with_pattern(mut geometry: ArmGeometry, options: &SessionOptions) -> ArmGeometry {
    let square = options.pattern.square();
    let to_hand = options.guess.grid_to_hand;
    let far = f64::from(options.pattern.columns()) * square;
    let mut row = -1.0;
    while row <= f64::from(options.pattern.rows()) {
        let end = |x: f64| to_hand * Point3::new(x, row * square, 0.0);
        geometry = geometry.with_capsule(7, end(-square), end(far), square);
        row += 1.5;
    }
    geometry
}
