//! Torques in, encoder counts out.

use std::time::Duration;

use nalgebra::Vector3;

use super::arm_mechanics::{Load, Plant};
use super::command_delay::CommandDelay;
use super::elastic_cables::ElasticCables;
use super::motor_windings::MotorWindings;
use super::safety_module::SafetyMode;
use super::thermal::{SUPPLY_VOLTAGE, ThermalModel};
use super::{ArmEffects, SafetyLimits, SafetyModule};
use crate::Limits;
use crate::dynamics::{Body, Dynamics};
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

/// Purposes of random numbers beside the variation of friction.
const LATENCY_PURPOSE: u64 = 1;
const ENCODER_PURPOSE: u64 = 2;
/// Number of steps of the mechanics per period with the effects of a real arm: 0.5 ms each.
const REAL_ARM_SUBSTEPS: u32 = 4;

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
    /// Effects of a real arm; none by default.
    pub effects: ArmEffects,
}

impl SimulatorOptions {
    /// Returns the default options with all effects of a real arm, in steps of 0.5 ms.
    pub fn real_arm() -> Self {
        Self {
            substeps: REAL_ARM_SUBSTEPS,
            effects: ArmEffects::real_arm(),
            ..Self::default()
        }
    }
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
            effects: ArmEffects::default(),
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
/// * [`ArmEffects`] add what a real arm has besides; the encoders are on the motors, before the cables.
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
    /// Cables, if they are elastic: then the plant has no rotors.
    cables: Option<ElasticCables<N>>,
    safety: SafetyModule,
    braking: Joints<N>,
    idle: [bool; N],
    commands: [f64; N],
    delay: CommandDelay<N>,
    /// Commands that the motors followed in the last step.
    followed: [f64; N],
    push: Vector3<f64>,
    twist: Joints<N>,
    contact: Joints<N>,
    load: Body,
    random: Random,
    latency_random: Random,
    encoder_random: Random,
    /// Noise of the encoders' readings in this period, counts.
    noise: [f64; N],
    thermal: ThermalModel<N>,
    windings: MotorWindings<N>,
    steps: u64,
}

impl<const N: usize> Simulator<N> {
    /// An arm in its home pose, at rest, just switched on: idle.
    pub fn new(model: WamModel<N>, options: SimulatorOptions) -> Self {
        let stops = stops(&model, &options);
        let plant = Plant::new(plant_dynamics(&model, &options), stops, model.home);
        let cables = options.effects.elasticity.map(|table| {
            let of = |joint: usize| table.get(joint).copied().unwrap_or_default();
            ElasticCables::new(of, model.rotors, model.home)
        });
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
            cables,
            braking,
            safety: SafetyModule::new(options.safety),
            idle: [false; N],
            commands: [0.0; N],
            delay: CommandDelay::new(),
            followed: [0.0; N],
            push: Vector3::zeros(),
            twist: Joints::zeros(),
            contact: Joints::zeros(),
            load: Body::default(),
            random: Random::new(options.seed),
            latency_random: Random::for_purpose(options.seed, LATENCY_PURPOSE),
            encoder_random: Random::for_purpose(options.seed, ENCODER_PURPOSE),
            noise: [0.0; N],
            thermal: ThermalModel::at_rest(),
            windings: MotorWindings::at_rest(&options.effects),
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
        self.safety.set_voltage(self.supply_voltage());
        self.safety.watch(self.speed(), came, seconds);
        if commanded {
            let delay = self.latency();
            self.delay.send(self.commands, delay);
        }
        let friction = self.friction();
        let substeps = self.options.substeps.max(1);
        for _ in 0..substeps {
            self.advance(friction, seconds / f64::from(substeps));
        }
        let drawn = self.drawn();
        self.thermal.advance(|motor| drawn[motor], seconds);
        self.windings.advance(|motor| drawn[motor], seconds);
        if self.options.effects.encoder_noise > 0.0 {
            let deviation = self.options.effects.encoder_noise;
            let random = &mut self.encoder_random;
            self.noise = std::array::from_fn(|_| deviation * random.gaussian());
        }
        self.steps += 1;
        self.counts()
    }

    /// Draws the delay of a command, s.
    fn latency(&mut self) -> f64 {
        let latency = self.options.effects.latency;
        let jitter = latency.jitter.as_secs_f64();
        let added = if jitter > 0.0 {
            self.latency_random.between(0.0, jitter)
        } else {
            0.0
        };
        latency.least.as_secs_f64() + added
    }

    /// Lets links and motors move for a step.
    fn advance(&mut self, friction: JointFriction<N>, seconds: f64) {
        self.followed = self.delay.advance(seconds);
        let mut load = self.acting(friction);
        load.outside = self.pushed();
        match &mut self.cables {
            Some(cables) => cables.advance(&mut self.plant, &load, seconds),
            None => self.plant.advance(&load, seconds),
        }
    }

    /// Returns the encoder counts.
    pub fn counts(&self) -> [i32; N] {
        let angles = self.motor_side().0;
        self.model
            .transmission
            .counts_with_noise(&angles, &self.noise)
    }

    /// Returns angles and velocities of the motors as those of joints, rad and rad/s: of the links, if the cables are rigid.
    fn motor_side(&self) -> (Joints<N>, Joints<N>) {
        match &self.cables {
            Some(cables) => (cables.angles, cables.velocities),
            None => (self.plant.angles, self.plant.velocities),
        }
    }

    /// Returns the simulated time.
    pub fn time(&self) -> Duration {
        Duration::from_secs_f64(self.options.period.as_secs_f64() * self.steps as f64)
    }

    /// Returns the temperatures of the motors' pucks, °C: see `thermal.rs` for the assumptions.
    pub fn temperatures(&self) -> [f64; N] {
        self.thermal.temperatures()
    }

    /// Returns the temperatures of the motors' windings, °C; 25 °C where the effects have no windings.
    pub fn winding_temperatures(&self) -> [f64; N] {
        self.windings.temperatures()
    }

    /// Returns the joint angles at the motors, before the cables, rad: those of the links if the cables are rigid.
    pub fn motor_angles(&self) -> Joints<N> {
        self.motor_side().0
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

    /// Puts the arm into another pose, at rest, as by hand, its elastic cables stretched by gravity; a value that is not a number leaves its joint unchanged.
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
        if let Some(cables) = &mut self.cables {
            let links = self.plant.angles;
            cables.carry(&links, &self.plant.dynamics().gravity(&links));
        }
    }

    /// Returns the load on the tool plate, beside the arm of the model.
    pub fn load(&self) -> &Body {
        &self.load
    }

    /// Changes the load of the tool plate, in whose frame it is described; the controller does not know.
    pub fn set_load(&mut self, load: Body) {
        self.load = load;
        let loaded = self.model.clone().with_load(load);
        self.plant
            .set_dynamics(plant_dynamics(&loaded, &self.options));
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

    /// Returns the supply voltage, V: 48 V where the effects have no limit.
    pub fn supply_voltage(&self) -> f64 {
        match self.options.effects.supply_voltage {
            volts if volts > 0.0 => volts,
            _ => f64::from(SUPPLY_VOLTAGE),
        }
    }

    /// Changes the supply voltage, V, as a weak or a wrong supply does: the safety module judges it, and it limits the currents of motors
    /// that have windings. Ignores a voltage that is not more than 0.
    pub fn set_supply_voltage(&mut self, volts: f64) {
        if volts > 0.0 && volts.is_finite() {
            self.options.effects.supply_voltage = volts;
        }
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
        let speeds = self.motor_speeds();
        std::array::from_fn(|motor| {
            let turned = |joint: usize| self.model.transmission.turns(motor, joint);
            if !active || (0..N).any(|joint| self.idle[joint] && turned(joint)) {
                return 0.0;
            }
            self.limited(motor, speeds[motor]) / UNITS_PER_AMPERE
        })
    }

    /// Returns what a motor that turns at a speed, rad/s, makes of its command, in units of its puck: within the limits of
    /// puck and supply.
    fn limited(&self, motor: usize, speed: f64) -> f64 {
        let limit = self.model.motors[motor].limit;
        let command = self.followed[motor].clamp(-limit, limit);
        let supply = self.options.effects.supply_voltage;
        match self.windings.current_range(motor, speed, supply) {
            Some(range) => range.clamp(command / UNITS_PER_AMPERE) * UNITS_PER_AMPERE,
            None => command,
        }
    }

    /// Returns the speeds of the rotors, rad/s.
    fn motor_speeds(&self) -> Joints<N> {
        self.model.transmission.motors_of(&self.motor_side().1)
    }

    /// Draws the friction of this period, and adds the brakes of windings.
    fn friction(&mut self) -> JointFriction<N> {
        let active = self.safety.mode() == SafetyMode::Active;
        let mut found = JointFriction {
            coulomb: Joints::zeros(),
            viscous: Joints::zeros(),
        };
        for joint in 0..N {
            let friction = self.model.friction[joint];
            found.viscous[joint] = friction.viscous;
            let noise = self.options.friction_noise * self.random.between(-1.0, 1.0);
            found.coulomb[joint] = friction.coulomb * (1.0 + noise);
            if !active || self.idle[joint] {
                found.viscous[joint] += self.braking[joint];
            }
        }
        found
    }

    /// Returns the forces of motors and friction in a step.
    fn acting(&self, friction: JointFriction<N>) -> Load<N> {
        let active = self.safety.mode() == SafetyMode::Active;
        let (angles, velocities) = self.motor_side();
        let speeds = self.motor_speeds();
        let rotors = self.model.transmission.motors_of(&angles);
        let effects = &self.options.effects;
        let variation = |motor: usize| {
            let found = effects.torque_variation.get(motor);
            found.copied().unwrap_or_default()
        };
        let motors = Joints::from_fn(|motor, _| {
            let torque = self.limited(motor, speeds[motor])
                / self.model.motors[motor].units_per_newton_metre;
            let strength = self.windings.strength(motor);
            torque * strength * variation(motor).ripple_factor(rotors[motor])
        });
        let mut torques = self.model.transmission.joint_torques(&motors);
        let mut coulomb = friction.coulomb;
        for joint in 0..N {
            if !active || self.idle[joint] {
                torques[joint] = 0.0;
            }
            coulomb[joint] *= effects.stiction.factor(velocities[joint]);
        }
        // Magnets pull without a current, too.
        if effects.has_cogging() {
            let cogging =
                Joints::from_fn(|motor, _| variation(motor).cogging_torque(rotors[motor]));
            torques += self.model.transmission.joint_torques(&cogging);
        }
        Load {
            torques,
            outside: Joints::zeros(),
            coulomb,
            viscous: friction.viscous,
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

    /// The energy of the whole arm, J: of motion, of height, and of elastic cables.
    pub fn energy(&self) -> f64 {
        let dynamics = self.plant.dynamics();
        let links = &self.plant.angles;
        let cables = self.cables.as_ref();
        dynamics.kinetic_energy(links, &self.plant.velocities)
            + dynamics.potential_energy(links)
            + cables.map_or(0.0, |cables| cables.energy(links))
    }
}

/// Friction of the joints in a period.
#[derive(Clone, Copy, Debug)]
struct JointFriction<const N: usize> {
    /// Nm.
    coulomb: Joints<N>,
    /// With the brakes of windings, Nm s/rad.
    viscous: Joints<N>,
}

/// Returns the ends of the range of each joint, rad.
fn stops<const N: usize>(model: &WamModel<N>, options: &SimulatorOptions) -> [Limits; N] {
    let limits = model.chain.limits();
    std::array::from_fn(|joint| {
        let (limits, home) = (limits[joint], model.home[joint]);
        let margin = |end: f64| {
            let rests = options.effects.rests_at_home && home == end;
            if rests { 0.0 } else { STOP_MARGIN }
        };
        Limits::new(
            limits.min - margin(limits.min),
            limits.max + margin(limits.max),
        )
    })
}

/// Returns the equations of motion of the plant: without rotors if they are behind elastic cables.
fn plant_dynamics<const N: usize>(model: &WamModel<N>, options: &SimulatorOptions) -> Dynamics<N> {
    match options.effects.elasticity {
        None => model.dynamics(),
        Some(_) => Dynamics::new(
            model.chain.clone(),
            model.bodies,
            Joints::zeros(),
            model.gravity,
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weight of a car of a ton, about.
    #[test]
    fn forces_from_outside_are_cut_at_the_weight_of_a_car() {
        let mut arm = Simulator::new(WamModel::<7>::new(), SimulatorOptions::default());
        for (asked, taken) in [
            (9_999.0, 9_999.0),
            (-9_999.0, -9_999.0),
            (10_001.0, 10_000.0),
            (f64::INFINITY, 10_000.0),
            (f64::MIN, -10_000.0),
            (f64::NAN, 0.0),
        ] {
            arm.set_contact_torques(Joints::<7>::repeat(asked));
            arm.twist(Joints::<7>::repeat(asked));
            arm.push(Vector3::repeat(asked));
            assert_eq!(arm.contact_torques(), Joints::<7>::repeat(taken), "{asked}");
            assert_eq!(arm.twist, Joints::<7>::repeat(taken), "{asked}");
            assert_eq!(arm.push, Vector3::repeat(taken), "{asked}");
        }
    }
}
