//! Steps of the tool of 5 cm are straight, and turn no joint far.
//!
//! From random joint angles, in random directions, with the orientation kept. A step is followed or refused; both are
//! counted. `YARP_CARTESIAN_STEPS=10000` makes as many steps of each kind; continuous integration makes fewer.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::kinematics::{Chain, Joints, Pose, Solver, SolverOptions, rotation_vector};
use yarp_devices::pseudo_random::Random;
use yarp_devices::trajectory::{StraightLine, StraightLineError, StraightLineOptions};
use yarp_devices::wam::{SimulatedWam, WamModel};
use yarp_devices::{
    Axes, AxisIndex, AxisInfo, CartesianControl, ControlLimits, ControlMode, Device, DeviceError,
    EncoderReading, Encoders, Mode, PositionDirect, Target, TaskPose,
};

/// Steps of lines, and of the controller, unless the environment says otherwise.
const SAMPLE: usize = 400;
const CONTROLLER_SAMPLE: usize = 80;
/// Controllers that make steps at the same time.
const CONTROLLERS: usize = 20;
const STEP: f64 = 0.05;
/// The largest change of a joint, rad, and the largest distance of the tool from the line, m.
const LARGEST_CHANGE: f64 = 0.5;
const STRAIGHTNESS: f64 = 1e-3;

fn steps(sample: usize) -> usize {
    match std::env::var("YARP_CARTESIAN_STEPS") {
        Ok(number) => number.parse().expect("a number of steps"),
        Err(_) => sample,
    }
}

/// Random draws.
struct Draw(Random);

impl Draw {
    fn between(&mut self, min: f64, max: f64) -> f64 {
        self.0.between(min, max)
    }

    fn joints<const N: usize>(&mut self, chain: &Chain<N>) -> Joints<N> {
        Joints::from_fn(|joint, _| {
            let limits = chain.limits()[joint];
            self.between(limits.min, limits.max)
        })
    }

    fn direction(&mut self) -> Vector3<f64> {
        loop {
            let drawn = Vector3::from_fn(|_, _| self.between(-1.0, 1.0));
            if (0.1..1.0).contains(&drawn.norm()) {
                return drawn.normalize();
            }
        }
    }
}

/// Checks of one step, at as many places as are passed.
struct Step<'a, const N: usize> {
    chain: &'a Chain<N>,
    start: Joints<N>,
    from: Pose,
    way: Vector3<f64>,
    /// The orientation is kept too.
    turns: bool,
}

impl<const N: usize> Step<'_, N> {
    fn check(&self, joints: &Joints<N>) -> f64 {
        let change = (joints - self.start).abs().max();
        assert!(change <= LARGEST_CHANGE, "{self:?}: {change} rad");
        assert!(self.chain.contains(joints), "{joints}");
        let pose = self.chain.forward(joints);
        let gone = pose.translation.vector - self.from.translation.vector;
        let along = gone.dot(&self.way) / self.way.norm_squared();
        let off = (gone - self.way * along.clamp(0.0, 1.0)).norm();
        assert!(off <= STRAIGHTNESS, "{self:?}: {off} m beside the line");
        let turned = rotation_vector(&(pose.rotation * self.from.rotation.inverse())).norm();
        assert!(!self.turns || turned < 1e-2, "{self:?}: {turned} rad");
        off
    }
}

impl<const N: usize> std::fmt::Debug for Step<'_, N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "from {:?} by {:?}", self.start, self.way)
    }
}

#[test]
fn lines_of_the_tool_are_straight_and_keep_the_posture() {
    let total = steps(SAMPLE);
    let options = SolverOptions {
        attempts: 1,
        ..SolverOptions::default()
    };
    let chain = WamModel::<7>::new().chain;
    let solver = Solver::with_options(chain.clone(), options);
    let mut draw = Draw(Random::new(20_261_123));
    let (mut followed, mut postures, mut worst, mut largest) = (0, 0, 0.0_f64, 0.0_f64);
    for _ in 0..total {
        let start = draw.joints(&chain);
        let from = chain.forward(&start);
        let way = draw.direction() * STEP;
        let step = Step {
            chain: &chain,
            start,
            from,
            way,
            turns: true,
        };
        let mut target = from;
        target.translation.vector += way;
        let options = StraightLineOptions::default();
        let period = Duration::from_millis(10);
        match StraightLine::plan(&solver, &start, &target, &options, period) {
            Ok(mut line) => {
                followed += 1;
                let mut before = start;
                while let Some(joints) = line.next_joints() {
                    // Between two positions the joints go straight in joint space.
                    worst = worst.max(step.check(&before.lerp(&joints, 0.5)));
                    worst = worst.max(step.check(&joints));
                    largest = largest.max((joints - start).abs().max());
                    before = joints;
                }
                let missed = chain.forward(&before).translation.vector - target.translation.vector;
                assert!(missed.norm() < 1e-5, "{step:?}");
            }
            Err(StraightLineError::PostureChange { .. }) => postures += 1,
            Err(_) => {}
        }
    }
    println!(
        "{followed} of {total} steps followed, {postures} refused for their posture, others out of reach; largest change {largest:.3} rad, at most {:.4} mm beside the line",
        worst * 1e3
    );
    // Random angles are often beside a limit of a joint: a step cannot always be made.
    assert!(followed * 10 > total * 7, "{followed} of {total}");
    assert!(
        postures > 0,
        "the sample has steps that need another posture"
    );
}

#[test]
fn with_permission_a_line_may_change_the_posture() {
    let options = SolverOptions {
        attempts: 1,
        ..SolverOptions::default()
    };
    let chain = WamModel::<7>::new().chain;
    let solver = Solver::with_options(chain.clone(), options);
    let allowed = StraightLineOptions {
        joint_change_per_step: f64::INFINITY,
        joint_speed: f64::INFINITY,
        ..StraightLineOptions::default()
    };
    let mut draw = Draw(Random::new(20_261_123));
    let period = Duration::from_millis(10);
    let changes = (0..SAMPLE).any(|_| {
        let start = draw.joints(&chain);
        let mut target = chain.forward(&start);
        target.translation.vector += draw.direction() * STEP;
        let usual = StraightLineOptions::default();
        let refused = StraightLine::plan(&solver, &start, &target, &usual, period);
        let line = StraightLine::plan(&solver, &start, &target, &allowed, period);
        matches!(refused, Err(StraightLineError::PostureChange { .. })) && line.is_ok()
    });
    assert!(changes);
}

/// An arm that is where it was sent last, and records where that was.
struct Recorder {
    arm: SimulatedWam,
    joints: Mutex<(Vec<f64>, Vec<Vec<f64>>)>,
    begun: Instant,
}

impl Recorder {
    fn at(joints: &Joints<7>) -> Self {
        let degrees = joints.iter().map(|angle| angle.to_degrees()).collect();
        let arm = SimulatedWam::new();
        let direct = [Mode::PositionDirect; 7];
        arm.set_control_modes(Axes::All, &direct).unwrap();
        Self {
            arm,
            joints: Mutex::new((degrees, Vec::new())),
            begun: Instant::now(),
        }
    }
}

impl AxisInfo for Recorder {
    fn axes(&self) -> usize {
        7
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        self.arm.axis_name(axis)
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<yarp_devices::JointType, DeviceError> {
        self.arm.joint_type(axis)
    }
}

impl Encoders for Recorder {
    fn read_encoders(&self, _: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        let joints = self.joints.lock().unwrap();
        for (slot, position) in out.iter_mut().zip(&joints.0) {
            *slot = EncoderReading {
                position: *position,
                time: self.begun.elapsed().as_secs_f64(),
                ..EncoderReading::default()
            };
        }
        Ok(())
    }

    fn set_encoders(&self, axes: Axes<'_>, values: &[f64]) -> Result<(), DeviceError> {
        Encoders::set_encoders(&self.arm, axes, values)
    }
}

impl PositionDirect for Recorder {
    fn set_direct_positions(&self, _: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        let mut joints = self.joints.lock().unwrap();
        joints.0 = positions.to_vec();
        joints.1.push(positions.to_vec());
        Ok(())
    }

    fn direct_positions(&self, _: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(self.joints.lock().unwrap().0.clone())
    }
}

impl Device for Recorder {
    fn encoders(&self) -> Option<&dyn Encoders> {
        Some(self)
    }

    fn position_direct(&self) -> Option<&dyn PositionDirect> {
        Some(self)
    }

    fn control_mode(&self) -> Option<&dyn ControlMode> {
        self.arm.control_mode()
    }

    fn control_limits(&self) -> Option<&dyn ControlLimits> {
        self.arm.control_limits()
    }
}

/// Makes `total` steps with a controller; returns how many were followed, and the largest distance from the line.
fn controller_steps(seed: u64, total: usize) -> (usize, f64) {
    let chain = WamModel::<7>::new().chain;
    let mut draw = Draw(Random::new(seed));
    let (mut followed, mut worst) = (0, 0.0_f64);
    for _ in 0..total {
        let start = draw.joints(&chain);
        let from = chain.forward(&start);
        let way = draw.direction() * STEP;
        let arm = Arc::new(Recorder::at(&start));
        let options = CartesianOptions::new();
        let tool = CartesianController::start(arm.clone(), chain.clone(), options).unwrap();
        let mut pose = tool.pose().unwrap().pose;
        for (place, by) in pose.position.iter_mut().zip(way.iter()) {
            *place += by;
        }
        // A pose out of reach keeps its place only.
        let found = tool.ask(Target::Pose(pose), None).unwrap().pose;
        let turned =
            Vector3::from(found.axis) * found.angle - Vector3::from(pose.axis) * pose.angle;
        match tool.go_to(Target::Pose(pose), Some(0.1)) {
            Ok(()) => followed += 1,
            Err(DeviceError::Unsuitable { .. }) => continue,
            Err(error) => panic!("{error}"),
        }
        let (poll, timeout) = (Duration::from_millis(5), Duration::from_secs(60));
        assert!(tool.wait_motion_done(poll, timeout).unwrap());
        let step = Step {
            chain: &chain,
            start,
            from,
            way,
            turns: turned.norm() < 1e-4,
        };
        let joints = arm.joints.lock().unwrap();
        assert!(!joints.1.is_empty());
        for positions in &joints.1 {
            let radians = positions.iter().map(|position| position.to_radians());
            let joints = Joints::<7>::from_iterator(radians);
            worst = worst.max(step.check(&chain.clamp(&joints)));
        }
    }
    (followed, worst)
}

#[test]
fn steps_of_the_controller_are_straight_and_keep_the_posture() {
    let total = steps(CONTROLLER_SAMPLE);
    let each = total.div_ceil(CONTROLLERS);
    let made = std::thread::scope(|scope| {
        let controllers: Vec<_> = (1..=CONTROLLERS)
            .map(|seed| scope.spawn(move || controller_steps(seed as u64, each)))
            .collect();
        let made = controllers.into_iter().map(|made| made.join().unwrap());
        made.fold((0, 0.0_f64), |all, one| (all.0 + one.0, all.1.max(one.1)))
    });
    let (followed, worst) = made;
    let total = each * CONTROLLERS;
    println!(
        "{followed} of {total} steps followed, at most {:.4} mm beside the line",
        worst * 1e3
    );
    assert!(followed * 2 > total, "{followed} of {total}");
}

/// A step of a random sample that the arm could make in another posture only.
fn step_to_another_posture() -> (Joints<7>, TaskPose) {
    let model = WamModel::<7>::new();
    let mut draw = Draw(Random::new(20_261_123));
    (0..SAMPLE)
        .find_map(|_| {
            let start = draw.joints(&model.chain);
            let way = draw.direction() * STEP;
            let tool = controller(&start, false);
            let mut pose = tool.pose().unwrap().pose;
            for (place, by) in pose.position.iter_mut().zip(way.iter()) {
                *place += by;
            }
            let found = tool.ask(Target::Pose(pose), None).unwrap();
            let target = Vector3::from(pose.position);
            let is_there = (Vector3::from(found.pose.position) - target).norm() < 1e-4;
            let turned = (0..7).map(|joint| found.joints[joint].to_radians() - start[joint]);
            let largest = turned.fold(0.0, |largest: f64, turned| largest.max(turned.abs()));
            (is_there && largest > 1.0).then_some((start, pose))
        })
        .expect("random postures are often beside a limit")
}

fn controller(start: &Joints<7>, allow: bool) -> CartesianController<7> {
    let options = CartesianOptions::new().allow_posture_changes(allow);
    let arm = Arc::new(Recorder::at(start));
    CartesianController::start(arm, WamModel::<7>::new().chain, options).unwrap()
}

#[test]
fn a_target_in_another_posture_is_refused_unless_it_is_allowed() {
    let (start, pose) = step_to_another_posture();
    let refused = controller(&start, false).go_to(Target::Pose(pose), None);
    let message = refused.unwrap_err().to_string();
    assert!(
        message.contains("move the joints to another posture"),
        "{message}"
    );
    controller(&start, true)
        .go_to(Target::Pose(pose), None)
        .unwrap();
}
