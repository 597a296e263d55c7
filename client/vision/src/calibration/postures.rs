//! Postures of the arm that show the pattern to the camera: reachable, free of collisions, and well spread.

use nalgebra::{Point3, Rotation3, Unit, Vector3, Vector6};
use yarp_devices::kinematics::{Chain, Joints, Redundancy, Solver, SolverOptions};
use yarp_planning::CollisionModel;

use super::transforms::rotation_vector;
use super::{CalibrationError, HandEye, Pattern, Result};
use crate::Pose;

/// Smallest singular value of the Jacobian (m and rad per rad) of a posture that is used.
pub const MIN_SINGULAR_VALUE: f64 = 0.02;
/// Distance of a joint from its limits, rad.
const LIMIT_MARGIN: f64 = 0.05;
/// Number of poses tried per posture wanted.
const TRIES: usize = 200;
/// Multiple of the postures wanted after which no more are collected.
const SURPLUS: usize = 4;
/// Starts of the inverse kinematics for one pose.
const ATTEMPTS: usize = 6;
/// Largest tilt of the pattern against the image plane, rad.
const MAX_TILT: f64 = 0.7;
/// Distance that a line of sight keeps from the arm, m.
const SIGHT_MARGIN: f64 = 0.01;
/// Distance of a corner from the border of the image, as part of its width.
const IMAGE_MARGIN: f64 = 0.02;

/// A pseudo-random sequence (SplitMix64), the same for the same seed.
#[derive(Clone, Debug)]
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(super) fn between(&mut self, from: f64, to: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        from + (to - from) * (bits >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Chooses postures from a guess of where camera and pattern are.
#[derive(Clone, Debug)]
pub struct PostureChoice<'a> {
    /// Guess of the camera, its pose, and the pattern in the hand: a few cm and degrees wrong at most.
    pub guess: &'a HandEye,
    /// The pattern.
    pub pattern: &'a Pattern,
    /// Collision checks, in which the pattern is part of the hand.
    pub model: &'a CollisionModel,
    /// Smallest and largest distance of the middle of the pattern from the camera, m.
    pub distances: [f64; 2],
    /// Seed of the poses tried.
    pub seed: u64,
}

/// Numbers of poses that were not usable.
#[derive(Clone, Copy, Debug, Default)]
struct Refused {
    tried: usize,
    unreachable: usize,
    singular: usize,
    colliding: usize,
    hidden: usize,
}

impl PostureChoice<'_> {
    /// Returns `count` postures, in rad, each far from the others in the image and in orientation, ordered for short ways.
    ///
    /// Errors: [`CalibrationError::NoPostures`] with the reasons.
    pub fn choose(&self, count: usize) -> Result<Vec<Joints<7>>> {
        let chain = self.model.chain();
        let mut random = Random::new(self.seed);
        let mut refused = Refused::default();
        let mut found: Vec<(Joints<7>, Vector6<f64>)> = Vec::new();
        while found.len() < count * SURPLUS && refused.tried < count * TRIES {
            refused.tried += 1;
            let grid = self.random_grid(&mut random);
            let hand = self.guess.camera.pose * grid * self.guess.hand_to_grid();
            let seed = refused.tried as u64;
            if let Some(joints) = self.posture(chain, &grid, &hand, seed, &mut refused) {
                found.push((joints, feature(&grid, self.middle())));
            }
        }
        if found.len() < count {
            return Err(CalibrationError::NoPostures {
                found: found.len(),
                wanted: count,
                tried: refused.tried,
                unreachable: refused.unreachable,
                singular: refused.singular,
                colliding: refused.colliding,
                hidden: refused.hidden,
            });
        }
        Ok(in_short_order(spread(found, count)))
    }

    /// Checks one posture, for postures that a user chose.
    ///
    /// Errors: [`CalibrationError::Singular`].
    pub fn check_singularity(chain: &Chain<7>, index: usize, joints: &Joints<7>) -> Result<()> {
        let value = smallest_singular_value(chain, joints);
        if value >= MIN_SINGULAR_VALUE {
            return Ok(());
        }
        Err(CalibrationError::Singular {
            posture: index,
            value,
            expected: MIN_SINGULAR_VALUE,
        })
    }

    fn middle(&self) -> Point3<f64> {
        let half = |corners: u32| f64::from(corners - 1) * self.pattern.square() / 2.0;
        Point3::new(half(self.pattern.columns()), half(self.pattern.rows()), 0.0)
    }

    /// Returns a pose of the pattern in the camera's frame: anywhere in the image, tilted and turned.
    fn random_grid(&self, random: &mut Random) -> Pose {
        let [width, height] = self
            .guess
            .camera
            .intrinsics
            .size
            .map(|length| length as f64);
        let pixel = [
            random.between(0.12, 0.88) * width,
            random.between(0.12, 0.88) * height,
        ];
        let depth = random.between(self.distances[0], self.distances[1]);
        let place = self.guess.camera.intrinsics.direction(pixel) * depth;
        let turn = Rotation3::from_axis_angle(
            &Vector3::z_axis(),
            random.between(-std::f64::consts::PI, std::f64::consts::PI),
        );
        let (sine, cosine) = random.between(0.0, std::f64::consts::TAU).sin_cos();
        let axis = Unit::new_unchecked(Vector3::new(cosine, sine, 0.0));
        let tilt = Rotation3::from_axis_angle(&axis, MAX_TILT * random.between(0.0, 1.0).sqrt());
        let rotation = tilt * turn;
        let origin = place - rotation * self.middle().coords;
        Pose::from_parts(origin.into(), rotation)
    }

    fn posture(
        &self,
        chain: &Chain<7>,
        grid: &Pose,
        hand: &Pose,
        seed: u64,
        refused: &mut Refused,
    ) -> Option<Joints<7>> {
        if !self.is_in_image(grid) {
            refused.hidden += 1;
            return None;
        }
        let options = SolverOptions {
            attempts: ATTEMPTS,
            redundancy: Redundancy::AwayFromLimits,
            seed: self.seed ^ seed,
            ..SolverOptions::default()
        };
        let middle = |joint: usize| {
            let limits = chain.limits()[joint];
            (limits.min + limits.max) / 2.0
        };
        let start = Joints::<7>::from_fn(|joint, _| middle(joint));
        let solver = Solver::with_options(chain.clone(), options);
        let solved = solver.solve(hand, &start).ok().map(|found| found.joints);
        let Some(joints) = solved.filter(|joints| is_away_from_limits(chain, joints)) else {
            refused.unreachable += 1;
            return None;
        };
        if smallest_singular_value(chain, &joints) < MIN_SINGULAR_VALUE {
            refused.singular += 1;
            return None;
        }
        if !self.model.is_free(&joints) {
            refused.colliding += 1;
            return None;
        }
        if !self.is_in_sight(chain, &joints) {
            refused.hidden += 1;
            return None;
        }
        Some(joints)
    }

    /// Returns the corners of the pattern with its white border, in its own frame.
    fn outline(&self) -> [Point3<f64>; 5] {
        let square = self.pattern.square();
        let far = |corners: u32| f64::from(corners) * square;
        let (x, y) = (far(self.pattern.columns()), far(self.pattern.rows()));
        [
            Point3::new(-square, -square, 0.0),
            Point3::new(x, -square, 0.0),
            Point3::new(-square, y, 0.0),
            Point3::new(x, y, 0.0),
            self.middle(),
        ]
    }

    fn is_in_image(&self, grid: &Pose) -> bool {
        let intrinsics = &self.guess.camera.intrinsics;
        let [width, height] = intrinsics.size.map(|length| length as f64);
        let margin = IMAGE_MARGIN * width;
        self.outline().iter().all(|corner| {
            intrinsics.project(&(grid * corner)).is_some_and(|[u, v]| {
                let inside = |value: f64, length: f64| (margin..length - margin).contains(&value);
                inside(u, width) && inside(v, height)
            })
        })
    }

    /// Returns true if no link of the arm is between the camera and the pattern.
    fn is_in_sight(&self, chain: &Chain<7>, joints: &Joints<7>) -> bool {
        let frames = chain.frames(joints);
        let eye = Point3::from(self.guess.camera.pose.translation.vector);
        let to_world = frames[6] * self.guess.grid_to_hand;
        let outline = self.outline().map(|corner| to_world * corner);
        let normal = to_world.rotation * -Vector3::z();
        self.model.geometry().spheres().iter().all(|sphere| {
            let center = match sphere.link {
                0 => sphere.center,
                link => frames[link - 1] * sphere.center,
            };
            // Those of the pattern itself lie in its plane.
            let is_pattern = sphere.link == 7
                && normal.dot(&(center - outline[4])).abs() < sphere.radius * 0.5
                && (center - outline[4]).norm() < (outline[0] - outline[4]).norm();
            let clear = |corner: &Point3<f64>| {
                segment_distance(&eye, corner, &center) > sphere.radius + SIGHT_MARGIN
            };
            is_pattern || outline.iter().all(clear)
        })
    }
}

/// Returns where in the image, how far, and how the pattern is oriented, in comparable units.
fn feature(grid: &Pose, middle: Point3<f64>) -> Vector6<f64> {
    /// Weight of the orientation: a turn of 1 rad counts like half a metre.
    const METRES_PER_RADIAN: f64 = 0.5;
    let place = grid * middle;
    let turn = rotation_vector(&grid.rotation) * METRES_PER_RADIAN;
    Vector6::new(place.x, place.y, place.z, turn.x, turn.y, turn.z)
}

/// Takes the posture that is farthest from those taken before, again and again.
fn spread(found: Vec<(Joints<7>, Vector6<f64>)>, count: usize) -> Vec<Joints<7>> {
    let mut nearest = vec![f64::INFINITY; found.len()];
    let mut taken = Vec::with_capacity(count);
    let mut next = 0;
    while taken.len() < count {
        let (joints, place) = &found[next];
        taken.push(*joints);
        for (distance, (_, other)) in nearest.iter_mut().zip(&found) {
            *distance = distance.min((other - place).norm());
        }
        nearest[next] = -1.0;
        let farther = |one: &usize, other: &usize| nearest[*one].total_cmp(&nearest[*other]);
        next = (0..found.len()).max_by(farther).unwrap_or(0);
    }
    taken
}

/// Orders postures so that each is near the one before.
fn in_short_order(mut postures: Vec<Joints<7>>) -> Vec<Joints<7>> {
    for index in 1..postures.len() {
        let here = postures[index - 1];
        let distance = |place: &usize| (postures[*place] - here).norm();
        let nearest = (index..postures.len())
            .min_by(|one, other| distance(one).total_cmp(&distance(other)))
            .unwrap_or(index);
        postures.swap(index, nearest);
    }
    postures
}

fn is_away_from_limits(chain: &Chain<7>, joints: &Joints<7>) -> bool {
    chain
        .limits()
        .iter()
        .zip(joints.iter())
        .all(|(limits, angle)| {
            (limits.min + LIMIT_MARGIN..=limits.max - LIMIT_MARGIN).contains(angle)
        })
}

/// Returns the smallest singular value of the Jacobian of the hand.
pub(super) fn smallest_singular_value(chain: &Chain<7>, joints: &Joints<7>) -> f64 {
    let (_, jacobian) = chain.forward_and_jacobian(joints);
    let square = jacobian * jacobian.transpose();
    square.symmetric_eigenvalues().min().max(0.0).sqrt()
}

fn segment_distance(from: &Point3<f64>, to: &Point3<f64>, point: &Point3<f64>) -> f64 {
    let along = to - from;
    let share = ((point - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (from + along * share - point).norm()
}
