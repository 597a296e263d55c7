//! The table in real time: arm, hand and cameras as devices that any wrapper serves.

use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use yarp_devices::camera::LatestValue;
use yarp_devices::clock;
use yarp_devices::hand::simulated::{Load, SimulatedHand, SimulatedHandOptions};
use yarp_devices::hand::{BarrettHand, HandBoard, HandOptions};
use yarp_devices::image::{Frame, Image, PixelFormat};
use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::SimulatorOptions;
use yarp_devices::wam::can::CanOptions;
use yarp_devices::wam::{DynamicArm, DynamicWam, SimulatedCanWam};
use yarp_devices::{
    CameraConfiguration, Device, DeviceError, FrameGrabberImage, FrameGrabberImageRaw, Hand,
    Intrinsics, RgbVisualParams, offers,
};

use crate::physics::{Contact, Other, Physics, RobotState, STEP};
use crate::simulated_robot::{HandPosture, PALM, RobotPosture};
use crate::simulation::arm_model;
use crate::{Camera, DepthNoise, Effects, Lens, Pose, Random, Renderer, Scene};

/// Time after a request for an image for which a camera renders. A stream asks at least every 33 ms; a program that asks less often than this
/// gets the image that followed its last request.
const UNWATCHED: Duration = Duration::from_millis(300);
/// Depth that value 0 of a depth image stands for, and the step from value to value, m.
pub const DEPTH_FROM: f32 = 0.25;
/// See [`DEPTH_FROM`].
pub const DEPTH_STEP: f32 = 0.003;

/// Kinds of arm of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum TableArm {
    /// Masses, friction, encoders and control.
    #[default]
    Dynamic,
    /// The same behind the driver of its CAN bus, at home and activated. Only at the speed of a real robot.
    OnBus {
        /// True if it has the effects of a real arm.
        effects: bool,
        /// Share of the frames on the bus that are lost.
        lost_frames: f64,
    },
}

/// Options of a table that runs in real time.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LiveOptions {
    /// Speed relative to a real robot, 0.1 to 20; images keep their rate.
    pub speed: f64,
    /// Images per second of each camera while somebody watches, 0.1 to 30.
    pub rate: f64,
    /// Effects of lens and sensor.
    pub effects: Effects,
    /// Seed of friction and noise.
    pub seed: u64,
    /// The camera; `None` for [`Scene::camera`].
    pub camera: Option<Camera>,
    /// The arm.
    pub arm: TableArm,
}

impl Default for LiveOptions {
    fn default() -> Self {
        Self {
            speed: 1.0,
            rate: 5.0,
            effects: Effects::default(),
            seed: 0,
            camera: None,
            arm: TableArm::default(),
        }
    }
}

/// Niceness of the threads that render, above that of control, physics and network.
#[cfg(target_os = "linux")]
const RENDERING_NICENESS: i32 = 10;
/// Images after a rest that follow each other as fast as they are rendered: who looks now and then waits for them.
const QUICK_IMAGES: u32 = 3;
/// Maximum rate of a camera, images a second.
const MAX_RATE: f64 = 30.0;
/// Images of the small sensors above the baskets for each one of the camera: an arm waits for them before each release.
const BASKET_RATE: f64 = 4.0;

/// Events on a table since it started: the truth, for judging a client.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TableStatistics {
    /// Time that passed on the table.
    pub simulated: Duration,
    /// Times that the robot touched table or baskets, or arm or palm touched an object; each counts until it is over.
    pub collisions: u64,
    /// Frames that the bus of the arm lost.
    pub lost_frames: u64,
}

/// The arm of a table.
enum Arm {
    Dynamic(Arc<DynamicWam>),
    OnBus(Arc<SimulatedCanWam>),
}

/// A table whose arm, hand and cameras are devices; dropping it ends their threads.
pub struct LiveTable {
    arm: Arm,
    hand: Arc<HandBoard>,
    camera: Arc<TableCamera>,
    depth: Arc<TableCamera>,
    baskets: [Arc<TableCamera>; 2],
    scene: Arc<Mutex<Scene>>,
    statistics: Arc<Mutex<TableStatistics>>,
    // Last, so that the hand at this end of the line is gone before.
    line: Arc<SimulatedHand>,
}

impl fmt::Debug for LiveTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LiveTable")
            .field("statistics", &self.statistics())
            .finish_non_exhaustive()
    }
}

impl LiveTable {
    /// Starts the devices and initialises the hand, which takes some seconds.
    ///
    /// Errors: [`DeviceError::Unsuitable`] for options out of range, [`DeviceError::Start`] without threads or a
    /// pseudo-terminal, and those of the hand.
    pub fn start(mut scene: Scene, options: LiveOptions) -> Result<Self, DeviceError> {
        check("the speed of a table,", options.speed, [0.1, 20.0])?;
        check("the rate of a camera,", options.rate, [0.1, MAX_RATE])?;
        if let TableArm::OnBus { lost_frames, .. } = options.arm {
            check("the speed of an arm on its bus,", options.speed, [1.0, 1.0])?;
            check(
                "the share of frames that are lost,",
                lost_frames,
                [0.0, 1.0],
            )?;
        }
        let simulator = SimulatorOptions {
            period: STEP,
            seed: options.seed,
            ..SimulatorOptions::default()
        };
        scene.robot = Some(RobotPosture {
            joints: DynamicArm::new(arm_model(), simulator).simulator().angles(),
            hand: Some(HandPosture::default()),
        });
        let line = SimulatedHand::start(SimulatedHandOptions::new().speed(options.speed))?;
        let line = Arc::new(line);
        let path = line.path();
        let hand = BarrettHand::open(HandOptions::new(&path)).map_err(|error| error.at(&path))?;
        let hand = Arc::new(HandBoard::start(hand)?);
        hand.initialise()?;
        let physics = Physics::new(&scene);
        let scene = Arc::new(Mutex::new(scene));
        let statistics = Arc::new(Mutex::new(TableStatistics::default()));
        let world = World {
            statistics: Arc::clone(&statistics),
            touching: false,
            physics,
            scene: Arc::clone(&scene),
            hand: Arc::clone(&line),
            loads: [Load::default(); 3],
        };
        let arm = start_arm(world, simulator, &options)?;
        let overhead = options.camera.unwrap_or_else(|| lock(&scene).camera());
        let beside = lock(&scene).depth_camera();
        let kind = Kind::Colour(options.effects);
        let camera = TableCamera::start(&scene, overhead, kind, options.rate)?;
        let noise = DepthNoise {
            seed: options.seed,
            ..DepthNoise::default()
        };
        let depth = TableCamera::start(&scene, beside, Kind::Depth(noise), options.rate)?;
        let [right, left] = lock(&scene).basket_cameras();
        let above = |camera| {
            let rate = (options.rate * BASKET_RATE).min(MAX_RATE);
            TableCamera::start(&scene, camera, Kind::Depth(noise), rate).map(Arc::new)
        };
        let baskets = [above(right)?, above(left)?];
        Ok(Self {
            arm,
            hand,
            camera: Arc::new(camera),
            depth: Arc::new(depth),
            baskets,
            scene,
            statistics,
            line,
        })
    }

    /// Returns the arm.
    pub fn arm(&self) -> Arc<dyn Device> {
        match &self.arm {
            Arm::Dynamic(arm) => arm.clone(),
            Arm::OnBus(arm) => arm.clone(),
        }
    }

    /// Returns the hand.
    pub fn hand(&self) -> Arc<HandBoard> {
        Arc::clone(&self.hand)
    }

    /// Returns the camera.
    pub fn camera(&self) -> Arc<TableCamera> {
        Arc::clone(&self.camera)
    }

    /// Returns the depth sensor: grey images, whose value 1 to 255 stands for [`DEPTH_FROM`] + value [`DEPTH_STEP`] m and 0
    /// for no measurement.
    pub fn depth(&self) -> Arc<TableCamera> {
        Arc::clone(&self.depth)
    }

    /// Returns the depth sensors above the baskets, see [`Scene::basket_cameras`].
    pub fn basket_cameras(&self) -> [Arc<TableCamera>; 2] {
        self.baskets.clone()
    }

    /// Lets the motors of the hand stand still while its processor goes on, or ends that.
    pub fn stall_hand(&self, stalled: bool) {
        self.line.freeze(stalled);
    }

    /// Returns what happened so far.
    pub fn statistics(&self) -> TableStatistics {
        let lost_frames = match &self.arm {
            Arm::Dynamic(_) => 0,
            Arm::OnBus(arm) => arm.lost_frames(),
        };
        TableStatistics {
            lost_frames,
            ..*lock(&self.statistics)
        }
    }

    /// Returns the scene, shared, for code that outlives the borrow of the table.
    pub fn shared_scene(&self) -> Arc<Mutex<Scene>> {
        Arc::clone(&self.scene)
    }

    /// Returns the scene as it is now: the truth, for judging what a client did.
    pub fn scene(&self) -> Scene {
        lock(&self.scene).clone()
    }
}

fn check(what: &'static str, value: f64, [min, max]: [f64; 2]) -> Result<(), DeviceError> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(DeviceError::Unsuitable {
        what,
        asked: value.to_string(),
        expected: format!("{min} to {max}"),
    })
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What is locked is whole between any two calls.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// State that is stepped with the control periods of the arm.
struct World {
    physics: Physics,
    scene: Arc<Mutex<Scene>>,
    hand: Arc<SimulatedHand>,
    loads: [Load; 3],
    statistics: Arc<Mutex<TableStatistics>>,
    /// True if the robot touched something in the last step.
    touching: bool,
}

impl World {
    fn count(&mut self) {
        let touches = |contact: &Contact| match contact.other {
            Other::Table | Other::Basket => true,
            Other::Object(_) => contact.part <= PALM,
        };
        let touching = self.physics.contacts().iter().any(touches);
        let mut statistics = lock(&self.statistics);
        statistics.simulated += STEP;
        statistics.collisions += u64::from(touching && !self.touching);
        self.touching = touching;
    }
}

fn start_arm(
    mut world: World,
    simulator: SimulatorOptions,
    options: &LiveOptions,
) -> Result<Arm, DeviceError> {
    let surroundings = move |joints: &Joints<7>| {
        let state = RobotState {
            joints: *joints,
            hand: Some(world.hand.exchange(&world.loads)),
        };
        let reaction = world.physics.step(&mut lock(&world.scene), &state);
        world.loads = reaction.loads;
        world.count();
        Some(reaction.torques)
    };
    let TableArm::OnBus {
        effects,
        lost_frames,
    } = options.arm
    else {
        let period = STEP.div_f64(options.speed);
        let arm = DynamicWam::start_among(arm_model(), simulator, period, surroundings)?;
        return Ok(Arm::Dynamic(Arc::new(arm)));
    };
    let driver = CanOptions {
        home_confirmed: true,
        ..CanOptions::default()
    };
    let real = SimulatorOptions {
        period: STEP,
        seed: options.seed,
        ..SimulatorOptions::real_arm()
    };
    let simulator = if effects { real } else { simulator };
    let arm = SimulatedCanWam::start_among(arm_model(), driver, simulator, surroundings)?;
    arm.activate()?;
    arm.lose_frames(lost_frames);
    Ok(Arm::OnBus(Arc::new(arm)))
}

/// Output of a camera.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Colour(Effects),
    Depth(DepthNoise),
}

/// A camera above the table as a device.
///
/// It renders only while somebody asks for images: the first one asked for comes a moment later.
#[derive(Debug)]
pub struct TableCamera {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    lens: Lens,
    rate: f64,
}

#[derive(Debug)]
struct Shared {
    frames: LatestValue<Frame>,
    ending: AtomicBool,
    /// When it was asked last, ms since it started; 0 is never.
    asked: AtomicU64,
    started: Instant,
    pose: Mutex<Pose>,
    covered: AtomicBool,
    frozen: AtomicBool,
}

impl Shared {
    fn is_watched(&self) -> bool {
        let asked = self.asked.load(Ordering::Acquire);
        let now = self.started.elapsed().as_millis() as u64;
        asked > 0 && now < asked + UNWATCHED.as_millis() as u64
    }
}

impl TableCamera {
    fn start(
        scene: &Arc<Mutex<Scene>>,
        camera: Camera,
        kind: Kind,
        rate: f64,
    ) -> Result<Self, DeviceError> {
        let shared = Arc::new(Shared {
            frames: LatestValue::new(),
            ending: AtomicBool::new(false),
            asked: AtomicU64::new(0),
            started: Instant::now(),
            pose: Mutex::new(camera.pose),
            covered: AtomicBool::new(false),
            frozen: AtomicBool::new(false),
        });
        let (theirs, scene) = (Arc::clone(&shared), Arc::clone(scene));
        let thread = thread::Builder::new()
            .name("table-camera".into())
            .spawn(move || {
                run(
                    &theirs,
                    &scene,
                    camera.lens,
                    kind,
                    Duration::from_secs_f64(1.0 / rate),
                )
            })
            .map_err(|source| DeviceError::Start {
                what: "the thread of the table's camera",
                source,
            })?;
        Ok(Self {
            shared,
            thread: Some(thread),
            lens: camera.lens,
            rate,
        })
    }

    /// Moves the camera, as somebody who bumps into its stand does; the next image shows it.
    pub fn set_pose(&self, pose: Pose) {
        *lock(&self.shared.pose) = pose;
    }

    /// Puts a cover onto the lens, or takes it off; a depth sensor is not covered.
    pub fn set_covered(&self, covered: bool) {
        self.shared.covered.store(covered, Ordering::Release);
    }

    /// Lets the camera take no new image, or ends that.
    pub fn set_frozen(&self, frozen: bool) {
        self.shared.frozen.store(frozen, Ordering::Release);
    }

    fn newest(&self) -> Result<Frame, DeviceError> {
        let now = self.shared.started.elapsed().as_millis() as u64;
        self.shared.asked.store(now.max(1), Ordering::Release);
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
        let what = "image";
        self.shared
            .frames
            .get()
            .ok_or(DeviceError::NoDataYet { what })
    }
}

impl Drop for TableCamera {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            if thread.join().is_err() {
                tracing::error!("the thread of the table's camera had panicked");
            }
        }
    }
}

/// Schedule of the images of a camera.
struct ImageSchedule {
    period: Duration,
    /// Time of the next image.
    due: Instant,
    /// Number of images that may still follow each other at once.
    quick: u32,
}

impl ImageSchedule {
    fn new(period: Duration, now: Instant) -> Self {
        Self {
            period,
            due: now,
            quick: QUICK_IMAGES,
        }
    }

    /// Notes that nobody watches.
    fn rest(&mut self) {
        self.quick = QUICK_IMAGES;
    }

    /// Notes that an image is taken now.
    fn take(&mut self, now: Instant) {
        self.quick = self.quick.saturating_sub(1);
        self.due = match self.quick {
            0 => (self.due + self.period).max(now),
            _ => now,
        };
    }
}

fn run(shared: &Shared, scene: &Mutex<Scene>, lens: Lens, kind: Kind, period: Duration) {
    // A late image does no harm, a late set point does. Raising the niceness needs no permission.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::setpriority_process(None, RENDERING_NICENESS);
    let renderer = Renderer::new();
    let mut taken = 0;
    let mut schedule = ImageSchedule::new(period, Instant::now());
    while !shared.ending.load(Ordering::Acquire) {
        let now = Instant::now();
        if !shared.is_watched() || shared.frozen.load(Ordering::Acquire) {
            schedule.rest();
            // Woken by whoever asks first.
            thread::park_timeout(UNWATCHED);
            continue;
        }
        if now < schedule.due {
            thread::park_timeout(schedule.due - now);
            continue;
        }
        schedule.take(now);
        let time = clock::now();
        let scene = lock(scene).clone();
        let pose = *lock(&shared.pose);
        let camera = &Camera { lens, pose };
        let image = match kind {
            Kind::Colour(_) if shared.covered.load(Ordering::Acquire) => dark(&lens, taken),
            Kind::Colour(effects) => {
                let seed = effects.seed.wrapping_add(taken);
                renderer
                    .render(&scene, camera, &Effects { seed, ..effects })
                    .image
            }
            Kind::Depth(noise) => {
                let seed = noise.seed.wrapping_add(taken);
                grey(&renderer.depth(&scene, camera, &DepthNoise { seed, ..noise }))
            }
        };
        let frame = Frame {
            image,
            number: taken,
            time,
        };
        if shared.frames.put(frame) {
            taken += 1;
        }
    }
}

/// Returns what a sensor behind a cover delivers.
fn dark(lens: &Lens, seed: u64) -> Image {
    // A little noise, like any sensor.
    let mut random = Random::new(seed);
    let values = (0..lens.width * lens.height * 3).map(|_| (random.unit() * 3.0) as u8);
    Image::new(
        PixelFormat::Rgb,
        lens.width,
        lens.height,
        values.collect::<Vec<u8>>(),
    )
    .expect("an image has three values per pixel")
}

/// Depth as grey values.
fn grey(depth: &crate::Depth) -> Image {
    let value = |metres: &f32| {
        let steps = ((metres - DEPTH_FROM) / DEPTH_STEP).round();
        if (1.0..=255.0).contains(&steps) {
            steps as u8
        } else {
            0
        }
    };
    let values: Vec<u8> = depth.metres.iter().map(value).collect();
    Image::new(PixelFormat::Mono, depth.width, depth.height, values)
        .expect("a depth image has as many values as pixels")
}

impl Device for TableCamera {
    offers! {
        frame_grabber_image: FrameGrabberImage,
        frame_grabber_image_raw: FrameGrabberImageRaw,
        rgb_visual_params: RgbVisualParams,
    }
}

fn fixed<T>(what: &str) -> Result<T, DeviceError> {
    Err(DeviceError::NotSupported {
        what: format!("{what} of the table's camera than its own"),
    })
}

impl RgbVisualParams for TableCamera {
    fn supported_configurations(&self) -> Result<Vec<CameraConfiguration>, DeviceError> {
        Ok(vec![CameraConfiguration {
            width: self.lens.width,
            height: self.lens.height,
            rate: self.rate,
            format: PixelFormat::Rgb,
        }])
    }

    fn resolution(&self) -> Result<(usize, usize), DeviceError> {
        Ok((self.lens.width, self.lens.height))
    }

    fn set_resolution(&self, width: usize, height: usize) -> Result<(), DeviceError> {
        if (width, height) == (self.lens.width, self.lens.height) {
            return Ok(());
        }
        fixed("another resolution")
    }

    fn field_of_view(&self) -> Result<(f64, f64), DeviceError> {
        let angle =
            |pixels: usize, focal: f64| 2.0 * (pixels as f64 / (2.0 * focal)).atan().to_degrees();
        let [across, down] = self.lens.focal;
        Ok((
            angle(self.lens.width, across),
            angle(self.lens.height, down),
        ))
    }

    fn set_field_of_view(&self, _: f64, _: f64) -> Result<(), DeviceError> {
        fixed("another field of view")
    }

    fn intrinsics(&self) -> Result<Intrinsics, DeviceError> {
        let [k1, k2, t1, t2, k3] = self.lens.distortion;
        Ok(Intrinsics {
            focal_length: (self.lens.focal[0], self.lens.focal[1]),
            principal_point: (self.lens.centre[0], self.lens.centre[1]),
            distortion_model: "plumb_bob".to_owned(),
            radial: [k1, k2, k3],
            tangential: [t1, t2],
            ..Intrinsics::default()
        })
    }

    fn mirroring(&self) -> Result<bool, DeviceError> {
        Ok(false)
    }

    fn set_mirroring(&self, mirrored: bool) -> Result<(), DeviceError> {
        if mirrored {
            fixed("another orientation")
        } else {
            Ok(())
        }
    }
}

impl FrameGrabberImage for TableCamera {
    fn image_size(&self) -> Result<(usize, usize), DeviceError> {
        Ok((self.lens.width, self.lens.height))
    }

    fn image(&self) -> Result<Frame, DeviceError> {
        let frame = self.newest()?;
        Ok(Frame {
            image: frame.image.to_rgb()?,
            ..frame
        })
    }
}

impl FrameGrabberImageRaw for TableCamera {
    fn raw_image_size(&self) -> Result<(usize, usize), DeviceError> {
        Ok((self.lens.width, self.lens.height))
    }

    fn raw_image(&self) -> Result<Frame, DeviceError> {
        self.newest()?.to_mono()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_after_a_rest_come_at_once_and_later_ones_in_their_turn() {
        let period = Duration::from_millis(200);
        let start = Instant::now();
        let mut schedule = ImageSchedule::new(period, start);
        let mut taken = Vec::new();
        let mut now = start;
        for step in 0..1000 {
            now = start + Duration::from_millis(10) * step;
            if now >= schedule.due {
                taken.push((now - start).as_millis());
                schedule.take(now);
            }
            if taken.len() == 6 {
                break;
            }
        }
        assert_eq!(taken, [0, 10, 20, 210, 410, 610]);
        schedule.rest();
        now += period;
        schedule.take(now);
        assert_eq!(schedule.due, now);
    }
}
