//! Effects by which a real arm differs from its equations of motion: their parameters, with units and sources.
//!
//! Sources: D1001 is Barrett's user's manual of the arm, WIKI its support wiki (`CANbusSpecifications`), BT the older btclient, OWD the
//! public driver owd, MOTORS the table of motors of the arm that MIT's `wamif.c` and the hardware page of the University of
//! Waterloo (`UW-Advanced-Robotics-Lab/lab-wiki`, `Waterloo-Steel:Spec-Hardware`) have. *Assumed* is what nobody publishes;
//! `docs/real-arm-simulation.md` says why the size is plausible.

use std::time::Duration;

use super::thermal::SUPPLY_VOLTAGE;

/// Number of joints, and of motors, that the tables describe; an arm with fewer has the first of them.
pub(super) const TABLE_LENGTH: usize = 7;

/// Effects of a real arm in a [`Simulator`](super::Simulator). The default has none of them.
///
/// ```
/// use std::time::Duration;
/// use yarp_devices::simulation::{ArmEffects, SimulatorOptions};
///
/// // The real arm, on a bus that is slower.
/// let mut effects = ArmEffects::real_arm();
/// effects.latency.least = Duration::from_millis(2);
/// let options = SimulatorOptions { effects, ..SimulatorOptions::real_arm() };
/// assert_ne!(options.effects, ArmEffects::default());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ArmEffects {
    /// Time from a reading of the encoders to the torque that follows from it.
    pub latency: CommandLatency,
    /// Standard deviation of the noise of an encoder, counts. It adds to the rounding to whole counts.
    pub encoder_noise: f64,
    /// Torque of each motor that varies with the angle of its rotor.
    pub torque_variation: [TorqueVariation; TABLE_LENGTH],
    /// Elastic cables between motors and links; `None`: the cables are rigid.
    pub elasticity: Option<[CableElasticity; TABLE_LENGTH]>,
    /// Friction of a joint that begins to move.
    pub stiction: Stiction,
    /// Windings of the motors, which heat up; `None`: motors are as strong as when they are cold.
    pub windings: Option<[Winding; TABLE_LENGTH]>,
    /// Supply voltage of the motors, V, which limits the current of a motor that turns; 0: no limit. Needs
    /// [`windings`](Self::windings).
    pub supply_voltage: f64,
    /// The stops that the arm is folded onto are exactly at its home pose, so that it does not sink while it has no power there.
    pub rests_at_home: bool,
}

/// Delay of torque commands.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct CommandLatency {
    /// Least delay.
    pub least: Duration,
    /// Most that is added to it, evenly distributed.
    pub jitter: Duration,
}

/// Torque of a motor that varies with the angle of its rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TorqueVariation {
    /// Amplitude of the cogging torque, Nm of the motor: also without current.
    pub cogging: f64,
    /// Amplitude of the torque ripple, as a share of the torque of the current.
    pub ripple: f64,
    /// Number of periods of both per turn of the rotor.
    pub periods_per_turn: f64,
}

/// Elasticity of the cables of a joint, seen at the joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CableElasticity {
    /// Nm/rad; 0 or less counts as rigid as 1e9 Nm/rad.
    pub stiffness: f64,
    /// Nm s/rad.
    pub damping: f64,
}

/// Friction of a joint at low speed (Stribeck): `coulomb (1 + (breakaway - 1) exp(-(speed / stribeck_speed)²))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiction {
    /// Torque that gets a joint at rest to move, as a multiple of Coulomb friction; 1 or more.
    pub breakaway: f64,
    /// Speed at which 37 % of the excess is left, rad/s.
    pub stribeck_speed: f64,
}

/// Friction at rest is Coulomb friction.
impl Default for Stiction {
    fn default() -> Self {
        Self {
            breakaway: 1.0,
            stribeck_speed: STRIBECK_SPEED,
        }
    }
}

/// Winding of a motor: a body that the current heats.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Winding {
    /// Resistance at 25 °C, ohm.
    pub resistance: f64,
    /// Voltage of the turning motor, V s/rad.
    pub back_emf: f64,
    /// Rise of the temperature above that of the surroundings, °C/W.
    pub thermal_resistance: f64,
    /// Time after which 63 % of a change is reached, s.
    pub time_constant: f64,
}

/// WIKI: 850 µs of a period are traffic of seven joints at 1 Mbit/s: a query, seven positions, two frames of torques.
const BUS_TIME: Duration = Duration::from_micros(850);
/// Assumed: computation and wake-up of a host with a real-time kernel.
const HOST_JITTER: Duration = Duration::from_micros(100);
/// 0.03 degrees, of 4096 counts per turn: transition noise of the data sheet of a magnetic encoder with 12 bits (AS5045, slow
/// mode; 0.06 in the fast one). D1001 says magnetic, with 4096 counts, and not which.
const ENCODER_NOISE: f64 = 0.03 * 4096.0 / 360.0;
/// Assumed: a share of the continuous torque (MOTORS). OWD measures cogging of motors on pucks with up to 0.03 Nm.
const COGGING_SHARE: f64 = 0.01;
/// Continuous torques, Nm (MOTORS).
const CONTINUOUS_TORQUES: [f64; TABLE_LENGTH] = [1.490, 1.490, 1.490, 1.490, 0.356, 0.356, 0.091];
/// Assumed, as of motors with sinusoidal currents.
const RIPPLE: f64 = 0.02;
/// BT: `POLES` of the pucks. A ripple of currents with three phases has three periods for each pole; so has the cogging
/// of nine slots for eight poles or the like, which is assumed.
const POLES: [f64; TABLE_LENGTH] = [12.0, 12.0, 12.0, 12.0, 8.0, 8.0, 6.0];
const PERIODS_PER_POLE: f64 = 3.0;
/// Assumed, Nm/rad: 10 Hz and more with the arm stretched out.
const STIFFNESSES: [f64; TABLE_LENGTH] = [10_000.0, 10_000.0, 4000.0, 4000.0, 500.0, 500.0, 150.0];
/// Assumed: damping per stiffness, s; 3 % of the critical damping at 10 Hz.
const DAMPING_TIME: f64 = 1e-3;
/// Assumed.
const BREAKAWAY: f64 = 1.2;
const STRIBECK_SPEED: f64 = 0.02;
/// Ohm, and V s/rad (MOTORS).
const RESISTANCES: [f64; TABLE_LENGTH] = [3.473, 3.473, 3.473, 3.473, 6.213, 6.213, 5.205];
const BACK_EMFS: [f64; TABLE_LENGTH] = [0.457, 0.457, 0.457, 0.457, 0.236, 0.236, 0.067];
/// °C/W: from the continuous torque, which brings a winding from 25 to 155 °C.
const THERMAL_RESISTANCES: [f64; TABLE_LENGTH] = [2.33, 2.33, 2.33, 2.33, 6.1, 6.1, 8.97];
/// Assumed, s: heat capacity of the mass of a motor.
const WINDING_TIMES: [f64; TABLE_LENGTH] = [800.0, 800.0, 800.0, 800.0, 700.0, 700.0, 250.0];

impl ArmEffects {
    /// Returns the effects of Barrett's arm.
    pub fn real_arm() -> Self {
        Self {
            latency: CommandLatency {
                least: BUS_TIME,
                jitter: HOST_JITTER,
            },
            encoder_noise: ENCODER_NOISE,
            torque_variation: std::array::from_fn(|motor| TorqueVariation {
                cogging: COGGING_SHARE * CONTINUOUS_TORQUES[motor],
                ripple: RIPPLE,
                periods_per_turn: PERIODS_PER_POLE * POLES[motor],
            }),
            elasticity: Some(STIFFNESSES.map(|stiffness| CableElasticity {
                stiffness,
                damping: DAMPING_TIME * stiffness,
            })),
            stiction: Stiction {
                breakaway: BREAKAWAY,
                stribeck_speed: STRIBECK_SPEED,
            },
            windings: Some(std::array::from_fn(|motor| Winding {
                resistance: RESISTANCES[motor],
                back_emf: BACK_EMFS[motor],
                thermal_resistance: THERMAL_RESISTANCES[motor],
                time_constant: WINDING_TIMES[motor],
            })),
            supply_voltage: f64::from(SUPPLY_VOLTAGE),
            // Joint 2 is on its lower stop and joint 4 on its upper one (libbarrett, `autohome.cpp` and `zerocal.conf`).
            rests_at_home: true,
        }
    }
}

impl ArmEffects {
    /// Returns whether any motor cogs.
    pub(super) fn has_cogging(&self) -> bool {
        self.torque_variation
            .iter()
            .any(|variation| variation.cogging != 0.0)
    }
}

impl TorqueVariation {
    /// Returns the cogging torque at an angle of the rotor, Nm of the motor.
    pub(super) fn cogging_torque(&self, rotor: f64) -> f64 {
        self.cogging * (self.periods_per_turn * rotor).sin()
    }

    /// Returns the torque of a current at an angle of the rotor, as a share of its mean.
    pub(super) fn ripple_factor(&self, rotor: f64) -> f64 {
        if self.ripple == 0.0 {
            return 1.0;
        }
        1.0 + self.ripple * (self.periods_per_turn * rotor).cos()
    }
}

impl Stiction {
    /// Returns the multiple of Coulomb friction at a speed, rad/s.
    pub(super) fn factor(&self, speed: f64) -> f64 {
        let excess = self.breakaway - 1.0;
        if excess <= 0.0 || self.stribeck_speed <= 0.0 {
            return 1.0;
        }
        1.0 + excess * (-(speed / self.stribeck_speed).powi(2)).exp()
    }
}
