//! Torques in, encoder counts out.

use std::time::Duration;

use nalgebra::Vector3;

use super::arm_mechanics::{Load, Plant};
use super::safety_module::SafetyMode;
use super::thermal::ThermalModel;
use super::{SafetyLimits, SafetyModule};
use crate::Limits;
use crate::dynamics::Body;
use crate::kinematics::{Joints, Pose};
use crate::pseudo_random::Random;
use crate::wam::{Friction, UNITS_PER_AMPERE, WamModel};

/// Distance of the stops outside the joint limits, rad. Not published.
const STOP_MARGIN: f64 = 0.03;
/// The joint whose frame is at the elbow, and the length of the forearm beyond it, m: where velocity is measured.
const ELBOW: usize = 3;
const FOREARM: f64 = 0.35;
/// Maximum torque command on the bus: 13 bits and a sign.
const MAX_COMMAND_UNITS: f64 = 8191.0;

/// Maximum external force on an arm, N or Nm: a car, so that numbers stay finite.
const MAX_PUSH: f64 = 1e4;

/// Clips the value to a magnitude; returns 0 for a value that is not a number.
fn within(value: f64, most: f64) -> f64 {
    if value.is_nan() {
        0.0
    } else {
        value.clamp(-most, most)
    }
}

/// Options of a [`Simulator`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatorOptions {
    /// The control period: from one torque to the next.
    pub period: Duration,
    /// Number of steps of the mechanics per period, at least 1.
    pub substeps: u32,
    /// Variation of Coulomb friction from period to period, as a share of itself.
    pub friction_noise: f64,
    /// Seed of the variation: the same seed gives the same motion.
    pub seed: u64,
    /// The limits of the safety module.
    pub safety: SafetyLimits,
}

/// 500 Hz as libbarrett, two steps of 1 ms each, friction that varies by a tenth, Barrett's safety limits.
impl Default for SimulatorOptions {
    fn default() -> Self {
        Self {
            period: Duration::from_millis(2),
            substeps: 2,
            friction_noise: 0.1,
            seed: 0,
            safety: SafetyLimits::default(),
        }
    }
}

/// An arm as its motors and encoders show it.
///
/// * Joint torques become motor torques, which become commands of whole units as on the bus, cut at what a motor
///   follows; what comes back are counts of the motors' encoders.
/// * Without power, and with idle motors, shorted windings brake each joint.
/// * A stop at either end of each joint is a little outside its limits and takes all speed.
/// * A force can push the tool, and torques the joints: the arm gives way.
///
/// Nothing allocates in a step.
///
/// ```
/// use yarp_devices::kinematics::Joints;
/// use yarp_devices::simulation::{Simulator, SimulatorOptions};
/// use yarp_devices::wam::WamModel;
///
/// let mut arm = Simulator::new(WamModel::<7>::new(), SimulatorOptions::default());
/// // Folded at home.
/// assert_eq!(arm.counts(), [0, -36833, 36832, -36728, 0, 0, 0]);
/// arm.safety_mut().press_activate();
/// // Without torques gravity folds the elbow a little more, against its stop; its motor counts downward.
/// let counts = arm.step(Some(&Joints::<7>::zeros()));
/// assert!(counts[3] <= -36728);
/// ```
#[derive(Clone, Debug)]
pub struct Simulator<const N: usize> {
    model: WamModel<N>,
    options: SimulatorOptions,
    plant: Plant<N>,
    safety: SafetyModule,
    braking: Joints<N>,
    idle: [bool; N],
    commands: [f64; N],
    push: Vector3<f64>,
    twist: Joints<N>,
    contact: Joints<N>,
    load: Body,
    random: Random,
    thermal: ThermalModel<N>,
    steps: u64,
}

impl<const N: usize> Simulator<N> {
    /// An arm in its home pose, at rest, just switched on: idle.
    pub fn new(model: WamModel<N>, options: SimulatorOptions) -> Self {
        let stops = model
            .chain
            .limits()
            .map(|limits| Limits::new(limits.min - STOP_MARGIN, limits.max + STOP_MARGIN));
        let plant = Plant::new(model.dynamics(), stops, model.home);
        // A brake on each motor, seen at the joints: J2Mᵀ B J2M. With equal motors at a differential it is diagonal.
        let braking = Joints::from_fn(|joint, _| {
            let mut unit = Joints::<N>::zeros();
            unit[joint] = 1.0;
            let motors = model.transmission.motors_of(&unit);
            (0..N)
                .map(|motor| model.motors[motor].braking * motors[motor] * motors[motor])
                .sum()
        });
        Self {
            plant,
            braking,
            safety: SafetyModule::new(options.safety),
            idle: [false; N],
            commands: [0.0; N],
            push: Vector3::zeros(),
            twist: Joints::zeros(),
            contact: Joints::zeros(),
            load: Body::default(),
            random: Random::new(options.seed),
            thermal: ThermalModel::at_rest(),
            steps: 0,
            model,
            options,
        }
    }

    /// Lets one control period pass and answers the encoder counts at its end.
    ///
    /// `torques`: torques that drive the joints, Nm; `None` if no command arrived, then the motors continue with the
    /// last one, until the safety module misses the heartbeat.
    pub fn step(&mut self, torques: Option<&Joints<N>>) -> [i32; N] {
        if let Some(torques) = torques {
            self.command(torques);
        }
        self.pass(torques.is_some())
    }

    /// Steps like [`step`](Self::step), with the commands of the motors in their own units, as on the bus.
    pub fn step_units(&mut self, units: Option<&[i16; N]>) -> [i32; N] {
        if let Some(units) = units {
            self.commands = units.map(f64::from);
        }
        self.pass(units.is_some())
    }

    fn pass(&mut self, commanded: bool) -> [i32; N] {
        let seconds = self.options.period.as_secs_f64();
        let came = commanded.then_some(self.commands.as_slice());
        self.safety.watch(self.speed(), came, seconds);
        let load = self.acting();
        let substeps = self.options.substeps.max(1);
        for _ in 0..substeps {
            let mut load = load;
            load.torques += self.pushed();
            self.plant.advance(&load, seconds / f64::from(substeps));
        }
        let drawn = self.drawn();
        self.thermal.advance(|motor| drawn[motor], seconds);
        self.steps += 1;
        self.counts()
    }

    /// Returns the encoder counts.
    pub fn counts(&self) -> [i32; N] {
        self.model.transmission.counts(&self.plant.angles)
    }

    /// Returns the simulated time.
    pub fn time(&self) -> Duration {
        Duration::from_secs_f64(self.options.period.as_secs_f64() * self.steps as f64)
    }

    /// Returns the temperatures of the motors' pucks, °C: see `thermal.rs` for the assumptions.
    pub fn temperatures(&self) -> [f64; N] {
        self.thermal.temperatures()
    }

    /// Returns the options.
    pub fn options(&self) -> &SimulatorOptions {
        &self.options
    }

    /// Returns the model.
    pub fn model(&self) -> &WamModel<N> {
        &self.model
    }

    /// Returns the true joint angles, rad: more exact than any encoder.
    pub fn angles(&self) -> Joints<N> {
        self.plant.angles
    }

    /// Returns the true joint velocities, rad/s.
    pub fn velocities(&self) -> Joints<N> {
        self.plant.velocities
    }

    /// Returns the true pose of the tool.
    pub fn tool(&self) -> Pose {
        self.model.chain.forward(&self.plant.angles)
    }

    /// Puts the arm into another pose, at rest, as by hand; a value that is not a number leaves its joint unchanged.
    pub fn place(&mut self, angles: &Joints<N>) {
        let here = self.plant.angles;
        let asked = Joints::from_fn(|joint, _| {
            if angles[joint].is_nan() {
                here[joint]
            } else {
                angles[joint]
            }
        });
        self.plant.angles = self.model.chain.clamp(&asked);
        self.plant.velocities = Joints::zeros();
    }

    /// Returns the load on the last link, beside the arm of the model.
    pub fn load(&self) -> &Body {
        &self.load
    }

    /// Changes the load of the last link, in whose frame it is described; the controller does not know.
    pub fn set_load(&mut self, load: Body) {
        self.load = load;
        self.plant
            .set_dynamics(self.model.clone().with_load(load).dynamics());
    }

    /// Changes the friction of the joints.
    pub fn set_friction(&mut self, friction: [Friction; N]) {
        self.model.friction = friction;
    }

    /// The safety module.
    pub fn safety(&self) -> &SafetyModule {
        &self.safety
    }

    /// The safety module, to press its buttons.
    pub fn safety_mut(&mut self) -> &mut SafetyModule {
        &mut self.safety
    }

    /// Shorts the windings of a joint's motors, or ends that: `MODE` 0 or 2 of its pucks.
    ///
    /// Ignores a joint that does not exist.
    pub fn set_idle(&mut self, joint: usize, idle: bool) {
        if let Some(slot) = self.idle.get_mut(joint) {
            *slot = idle;
        }
    }

    /// Pushes the tool with a force in the base frame, N, until the next call; a value that is not finite does not
    /// push.
    pub fn push(&mut self, force: Vector3<f64>) {
        self.push = force.map(|value| within(value, MAX_PUSH));
    }

    /// Applies external torques to the joints, Nm, until the next call; a value that is not finite does not twist.
    pub fn twist(&mut self, torques: Joints<N>) {
        self.twist = torques.map(|value| within(value, MAX_PUSH));
    }

    /// Sets the torques that contact with other bodies puts on the joints, Nm, until told otherwise; they add to those of
    /// [`push`](Self::push) and [`twist`](Self::twist). Not a number counts as 0.
    pub fn set_contact_torques(&mut self, torques: Joints<N>) {
        self.contact = torques.map(|value| within(value, MAX_PUSH));
    }

    /// Returns the torques that contact with other bodies puts on the joints, Nm.
    pub fn contact_torques(&self) -> Joints<N> {
        self.contact
    }

    /// The speed the safety module judges: of the elbow or of the end of the forearm, m/s.
    pub fn speed(&self) -> f64 {
        if N <= ELBOW {
            return 0.0;
        }
        let chain = &self.model.chain;
        let frames = chain.frames(&self.plant.angles);
        let elbow = frames[ELBOW - 1].translation.vector;
        let forearm = &frames[ELBOW];
        let end = forearm.translation.vector + forearm.rotation * Vector3::new(0.0, 0.0, FOREARM);
        let speed_of = |point: &Vector3<f64>, joints: usize| {
            let velocity = chain.jacobian_of(&frames, point, joints) * self.plant.velocities;
            velocity.fixed_rows::<3>(0).norm()
        };
        speed_of(&elbow, ELBOW).max(speed_of(&end, ELBOW + 1))
    }

    /// Whole units, as on the bus.
    fn command(&mut self, torques: &Joints<N>) {
        let motors = self.model.transmission.motor_torques(torques);
        for (motor, command) in self.commands.iter_mut().enumerate() {
            let units = self.model.motors[motor].units_per_newton_metre * motors[motor];
            *command = within(units.floor(), MAX_COMMAND_UNITS);
        }
    }

    /// Returns the currents in the motors, A: none without power, and for an idle joint.
    fn drawn(&self) -> [f64; N] {
        let active = self.safety.mode() == SafetyMode::Active;
        std::array::from_fn(|motor| {
            let turned = |joint: usize| self.model.transmission.turns(motor, joint);
            if !active || (0..N).any(|joint| self.idle[joint] && turned(joint)) {
                return 0.0;
            }
            self.limited(motor) / UNITS_PER_AMPERE
        })
    }

    /// Returns a motor's command in units of its puck, within the puck's limit.
    fn limited(&self, motor: usize) -> f64 {
        let limit = self.model.motors[motor].limit;
        self.commands[motor].clamp(-limit, limit)
    }

    /// Returns the forces of motors and friction in this period.
    fn acting(&mut self) -> Load<N> {
        let active = self.safety.mode() == SafetyMode::Active;
        let motors = Joints::from_fn(|motor, _| {
            self.limited(motor) / self.model.motors[motor].units_per_newton_metre
        });
        let mut torques = self.model.transmission.joint_torques(&motors);
        let mut viscous = Joints::zeros();
        let mut coulomb = Joints::zeros();
        for joint in 0..N {
            let friction = self.model.friction[joint];
            viscous[joint] = friction.viscous;
            let noise = self.options.friction_noise * self.random.between(-1.0, 1.0);
            coulomb[joint] = friction.coulomb * (1.0 + noise);
            if !active || self.idle[joint] {
                torques[joint] = 0.0;
                viscous[joint] += self.braking[joint];
            }
        }
        Load {
            torques,
            coulomb,
            viscous,
        }
    }

    /// Returns the joint torques of the external forces.
    fn pushed(&self) -> Joints<N> {
        let twist = self.twist + self.contact;
        if self.push == Vector3::zeros() {
            return twist;
        }
        let (_, jacobian) = self.model.chain.forward_and_jacobian(&self.plant.angles);
        twist + jacobian.fixed_rows::<3>(0).transpose() * self.push
    }

    /// The energy of the whole arm, J: of motion and of height.
    pub fn energy(&self) -> f64 {
        let dynamics = self.plant.dynamics();
        dynamics.kinetic_energy(&self.plant.angles, &self.plant.velocities)
            + dynamics.potential_energy(&self.plant.angles)
    }
}
