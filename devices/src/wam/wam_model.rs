//! The WAM arm as numbers: everything the mathematics and the simulation need to know of it.
//!
//! Sources, as in [`parameters`](super::parameters()): LB is the public driver libbarrett (`config/wam7w.conf`, `wam4.conf`), D1001 Barrett's user's
//! manual, OWD the public driver owd, BT the older btclient.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::transmission::{MAGNETIC_COUNTS, Transmission};
use crate::Limits;
use crate::dynamics::{Body, Dynamics, GravityCalibration};
use crate::kinematics::{Chain, DhRow, Joints, Pose};
use crate::simulation::Gains;

use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

/// Parameters of a WAM arm with `N` joints: 4 or 7, in metres, kilograms, **radians** and newton metres.
///
/// All of it is open to change; [`WamModel::<7>::new`] and [`WamModel::<4>::new`] are Barrett's arms without a hand.
///
/// ```
/// use yarp_devices::dynamics::Body;
/// use yarp_devices::kinematics::Pose;
/// use yarp_devices::wam::WamModel;
///
/// // With a hand of 1.2 kg, whose palm is 12 cm beyond the tool plate.
/// let arm = WamModel::<7>::new()
///     .with_tool(Pose::translation(0.0, 0.0, 0.12))
///     .with_load(Body::point(1.2, [0.0, 0.0, 0.06].into()));
/// assert_eq!(arm.home[3], 3.13);
/// ```
#[derive(Clone, Debug)]
pub struct WamModel<const N: usize> {
    /// Links, joint limits and the tool.
    pub chain: Chain<N>,
    /// Frame of the tool plate, where the arm ends, in the frame of the last link: with four joints that link begins at the
    /// elbow.
    pub plate: Pose,
    /// Each link in the frame of its row; a load is part of the last.
    pub bodies: [Body; N],
    /// The inertia of the motors' rotors, seen at the joints, kg m².
    pub rotors: Joints<N>,
    /// m/s².
    pub gravity: f64,
    /// The moments the controller compensates gravity with: measured on an arm, so they differ from `bodies`.
    pub calibration: GravityCalibration<N>,
    /// The folded pose the arm is put in before it starts.
    pub home: Joints<N>,
    /// From joints to motors.
    pub transmission: Transmission<N>,
    /// One per motor.
    pub motors: [Motor; N],
    /// Of each joint.
    pub friction: [Friction; N],
    /// Of the position loop of each joint.
    pub gains: [Gains; N],
    /// Signs of a joint that has stalled or collided; `None`: none is looked for.
    pub stall: Option<StallLimits<N>>,
}

/// Signs of a joint that has stalled or collided: it does not get on although its position loop pushes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StallLimits<const N: usize> {
    /// Torques of the position loops, without gravity, Nm: a joint whose loop is limited to less counts at its limit.
    pub torques: [f64; N],
    /// Distance from the set point, deg.
    pub error: f64,
    /// Time for which a joint shows one of these without getting on.
    pub time: Duration,
}

/// Friction of a joint, its cables and its motor together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Friction {
    /// Torque that gets the joint moving, and keeps it moving, Nm.
    pub coulomb: f64,
    /// Additional torque per speed, Nm s/rad.
    pub viscous: f64,
}

/// Response of a motor to its commands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motor {
    /// Units of command per Nm of the motor (puck property `IPNM`).
    pub units_per_newton_metre: f64,
    /// The largest command it follows, in units (puck property `MT`).
    pub limit: f64,
    /// Braking of its shorted windings, Nm s/rad of the motor. Not published: chosen so that an arm without power
    /// sinks gently.
    pub braking: f64,
}

/// LB and D1001 tables 4 to 7, standard (distal) form.
const ROWS: [DhRow; 7] = [
    row(-FRAC_PI_2, 0.0, 0.0),
    row(FRAC_PI_2, 0.0, 0.0),
    row(-FRAC_PI_2, 0.045, 0.55),
    row(FRAC_PI_2, -0.045, 0.0),
    row(-FRAC_PI_2, 0.0, 0.30),
    row(FRAC_PI_2, 0.0, 0.0),
    row(0.0, 0.0, 0.0609),
];

/// D1001 table 6, but 3.13 instead of 3.1 at the top of the elbow, so that home is inside.
pub(super) const LIMITS: [Limits; 7] = [
    Limits::new(-2.6, 2.6),
    Limits::new(-2.0, 2.0),
    Limits::new(-2.8, 2.8),
    Limits::new(-0.9, 3.13),
    Limits::new(-4.76, 1.24),
    Limits::new(-1.6, 1.6),
    Limits::new(-3.0, 3.0),
];

/// Of owd (`WAM.cc`, `safety_torques_exceeded`).
const STALL_TORQUES: [f64; 7] = [15.0, 30.0, 10.0, 15.0, 3.0, 3.0, 3.0];
/// Tracking error of a stall, deg. Assumed: in a free move the loops stay below one degree.
const STALL_ERROR: f64 = 10.0;
/// Time of a stall. Assumed.
const STALL_TIME: Duration = Duration::from_millis(200);

/// LB `zerocal.conf`.
pub(super) const HOME: [f64; 7] = [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0];
/// LB `calgrav.c`.
const GRAVITY: f64 = 9.805;
/// The length of the bare outer link of the arm with four joints, m (LB; D1001 has 0.35).
const OUTER_LINK: f64 = 0.36;

/// BT `rotorI`.
const ROTORS: [f64; 7] = [
    0.201,
    0.182,
    0.067,
    0.034,
    0.003_322_4,
    0.003_322_4,
    0.000_466_939,
];

/// OWD `Dynamics.cc`: Coulomb in Nm, viscous in Nm s/rad.
const FRICTION: [Friction; 7] = [
    friction(2.7, 1.5),
    friction(2.5, 0.9),
    friction(1.5, 0.5),
    friction(1.1, 0.25),
    friction(0.4, 0.0),
    friction(0.4, 0.1),
    friction(0.1, 0.0),
];

/// `IPNM` of LB and `MT` of BT.
const MOTORS: [Motor; 7] = [
    motor(2700.0, 4860.0, 0.07),
    motor(2700.0, 4860.0, 0.07),
    motor(2700.0, 4860.0, 0.07),
    motor(2700.0, 4320.0, 0.07),
    motor(6500.0, 3900.0, 0.01),
    motor(6500.0, 3900.0, 0.01),
    motor(17474.0, 1600.0, 0.002),
];

/// LB `wam7w.conf`: the position loop and its maximum torque.
const GAINS: [Gains; 7] = [
    Gains::new(900.0, 2.5, 10.0, 25.0),
    Gains::new(2500.0, 5.0, 20.0, 20.0),
    Gains::new(600.0, 2.0, 5.0, 15.0),
    Gains::new(500.0, 0.5, 2.0, 15.0),
    Gains::new(50.0, 0.5, 0.5, 5.0),
    Gains::new(50.0, 0.5, 0.5, 5.0),
    Gains::new(8.0, 0.1, 0.05, 5.0),
];

/// LB: ratios 42, 28.25, 18, 9.7 and 14.93; the shoulder's differential has 28.25 / 1.68.
const JOINT_TO_MOTOR: [[f64; 7]; 7] = [
    [-42.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 28.25, -16.8155, 0.0, 0.0, 0.0, 0.0],
    [0.0, -28.25, -16.8155, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, -18.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 9.7, -9.7, 0.0],
    [0.0, 0.0, 0.0, 0.0, 9.7, 9.7, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -14.93],
];

/// LB `wam7w.conf`, September 2008: kg, mm, 1e-6 kg m² (xx, yy, zz, xy, xz, yz). Links 1 to 3 are those of both arms.
const LINKS: [Link; 7] = [
    link(
        10.7677,
        [-4.43, 121.89, -0.66],
        [134880.33, 113283.69, 90463.30, -2130.41, -124.85, 685.55],
    ),
    link(
        3.8749,
        [-2.37, 31.06, 15.42],
        [21409.58, 13778.75, 15589.06, 271.72, 24.61, -1819.20],
    ),
    link(
        1.8023,
        [-38.26, 207.51, 0.03],
        [59110.77, 3245.50, 59270.43, -2496.12, 7.38, -17.67],
    ),
    link(
        2.172_662_12,
        [5.53408, 0.06822, 119.27695],
        [10674.91, 10586.59, 2820.36, 45.03, -1355.57, -110.02],
    ),
    link(
        0.356_556_92,
        [0.05483, 28.86286, 1.48493],
        [371.12, 194.34, 382.09, -0.08, -0.03, -16.13],
    ),
    link(
        0.409_158_86,
        [-0.05923, -16.86123, 24.19052],
        [548.89, 238.46, 451.33, 0.19, -0.10, -44.30],
    ),
    link(
        0.075_482_7,
        [0.14836, 0.07252, -3.35185],
        [39.11, 38.77, 76.14, 0.19, 0.0, 0.0],
    ),
];

/// LB `wam4.conf`: link 4 without a wrist.
const OUTER_LINK_BODY: Link = link(
    1.0651,
    [10.95, -0.03, 140.54],
    [18485.77, 18916.58, 1975.17, 2.19, -1608.68, 5.15],
);

/// LB, measured moments in kg m.
const MOMENTS: [[f64; 3]; 7] = [
    [-0.46198, 0.0, -0.000165],
    [0.09325, -0.14299, 2.38276],
    [0.09103, 0.17740, 0.10942],
    [-0.12639, -0.05702, 0.54153],
    [0.002227, 0.013625, -0.001012],
    [-0.0009, -0.004992, 0.025923],
    [-0.0000396, -0.0000754, 0.0000130],
];

/// LB, measured moments of the arm with four joints in kg m.
const MOMENTS_OF_FOUR: [[f64; 3]; 4] = [
    [0.26679, 0.0, 0.000058],
    [0.00858, 0.02793, 1.37375],
    [-0.04104, 0.12370, 0.04589],
    [-0.01694, -0.00012, 0.17860],
];

impl WamModel<7> {
    /// The arm with a wrist and a bare tool plate.
    pub fn new() -> Self {
        Self::from_tables(LINKS, MOMENTS, GAINS)
    }
}

impl Default for WamModel<7> {
    fn default() -> Self {
        Self::new()
    }
}

impl WamModel<4> {
    /// The arm that ends at the outer link.
    pub fn new() -> Self {
        let [upper, shoulder, arm, ..] = LINKS;
        let [one, two, three, four, ..] = GAINS;
        let gains = [
            one,
            two,
            Gains {
                integral: 2.5,
                derivative: 10.0,
                ..three
            },
            Gains {
                derivative: 2.5,
                ..four
            },
        ];
        Self::from_tables(
            [upper, shoulder, arm, OUTER_LINK_BODY],
            MOMENTS_OF_FOUR,
            gains,
        )
        .with_plate(Pose::translation(0.0, 0.0, OUTER_LINK))
    }
}

impl Default for WamModel<4> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> WamModel<N> {
    /// Returns the same arm with its tool plate elsewhere in the frame of the last link, and no tool.
    fn with_plate(self, plate: Pose) -> Self {
        Self { plate, ..self }.with_tool(Pose::identity())
    }

    /// Returns the same arm with another tool, given by its frame in the frame of the tool plate.
    pub fn with_tool(mut self, tool: Pose) -> Self {
        self.chain = self.chain.with_tool(self.plate * tool);
        self
    }

    /// The same arm with a load bolted to its tool plate, described in the frame of the plate.
    ///
    /// The moments of the gravity compensation grow along, as a new calibration would find them.
    pub fn with_load(mut self, load: Body) -> Self {
        let Some(last) = N.checked_sub(1) else {
            return self;
        };
        let load = load.seen_from(&self.plate);
        self.bodies[last] = self.bodies[last].joined_with(&load);
        let offsets: [Vector3<f64>; N] = std::array::from_fn(|joint| self.chain.link_offset(joint));
        for (joint, moment) in self.calibration.moments.iter_mut().enumerate() {
            let arm = if joint == last {
                load.centre
            } else {
                Vector3::zeros()
            };
            *moment += (offsets[joint] + arm) * load.mass;
        }
        self
    }

    /// The same arm with other encoders, see [`OPTICAL_COUNTS`](super::OPTICAL_COUNTS).
    pub fn with_counts_per_turn(mut self, counts_per_turn: u32) -> Self {
        self.transmission = self.transmission.with_counts_per_turn(counts_per_turn);
        self
    }

    /// The same arm without friction.
    pub fn without_friction(mut self) -> Self {
        self.friction = [Friction::default(); N];
        self
    }

    /// Returns the largest torque of a joint, Nm: what its motors have at their limits, or the limit of its position
    /// loop if that is more. 0 for a joint that does not exist.
    pub fn largest_torque(&self, joint: usize) -> f64 {
        let of_motors: f64 = self
            .motors
            .iter()
            .enumerate()
            .map(|(index, motor)| {
                let torque = motor.limit / motor.units_per_newton_metre;
                self.transmission.ratio(index, joint).abs() * torque
            })
            .sum();
        let of_loop = self.gains.get(joint).map_or(0.0, |gains| gains.limit);
        of_motors.max(of_loop)
    }

    /// The equations of motion.
    pub fn dynamics(&self) -> Dynamics<N> {
        Dynamics::new(self.chain.clone(), self.bodies, self.rotors, self.gravity)
    }

    /// Arms with fewer joints have the first rows of each table.
    fn from_tables(links: [Link; N], moments: [[f64; 3]; N], gains: [Gains; N]) -> Self {
        let rows = std::array::from_fn(|joint| ROWS[joint]);
        let limits = std::array::from_fn(|joint| LIMITS[joint]);
        let joint_to_motor = SMatrix::from_fn(|motor, joint| JOINT_TO_MOTOR[motor][joint]);
        Self {
            chain: Chain::new(rows, limits),
            plate: Pose::identity(),
            bodies: links.map(Body::from),
            rotors: Joints::from_fn(|joint, _| ROTORS[joint]),
            gravity: GRAVITY,
            calibration: GravityCalibration {
                moments: moments.map(Vector3::from),
                gravity: GRAVITY,
            },
            home: Joints::from_fn(|joint, _| HOME[joint]),
            transmission: Transmission::new(joint_to_motor, MAGNETIC_COUNTS)
                .expect("the differentials have an inverse, which a test checks"),
            motors: std::array::from_fn(|joint| MOTORS[joint]),
            friction: std::array::from_fn(|joint| FRICTION[joint]),
            gains,
            stall: Some(StallLimits {
                torques: std::array::from_fn(|joint| STALL_TORQUES[joint]),
                error: STALL_ERROR,
                time: STALL_TIME,
            }),
        }
    }
}

/// Mass properties as the sources write them.
#[derive(Clone, Copy)]
struct Link {
    kilograms: f64,
    millimetres: [f64; 3],
    square_millimetres: [f64; 6],
}

impl From<Link> for Body {
    fn from(link: Link) -> Self {
        let [xx, yy, zz, xy, xz, yz] = link.square_millimetres.map(|value| value * 1e-6);
        Body {
            mass: link.kilograms,
            centre: Vector3::from(link.millimetres) * 1e-3,
            inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        }
    }
}

const fn row(alpha: f64, a: f64, d: f64) -> DhRow {
    DhRow { alpha, a, d }
}

const fn link(kilograms: f64, millimetres: [f64; 3], square_millimetres: [f64; 6]) -> Link {
    Link {
        kilograms,
        millimetres,
        square_millimetres,
    }
}

const fn friction(coulomb: f64, viscous: f64) -> Friction {
    Friction { coulomb, viscous }
}

const fn motor(units_per_newton_metre: f64, limit: f64, braking: f64) -> Motor {
    Motor {
        units_per_newton_metre,
        limit,
        braking,
    }
}
