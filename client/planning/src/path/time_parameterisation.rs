//! The fastest motion along a path within velocity and acceleration limits.
//!
//! The corners of the path are rounded by parabolas in joint space, each within a deviation that the margin of the
//! collision checks allows. Along the rounded path `q(s)`, with `x` the square of the path velocity and `u` the path
//! acceleration, the limits are linear: `|q' u + q'' x| <= a`, `q'^2 x <= v^2`. A backward pass over a grid finds the
//! largest `x` from which the end can still be reached, a forward pass follows it (Pham and Pham 2018, "TOPP-RA").

use yarp_devices::kinematics::Joints;
use yarp_devices::trajectory::JointLimits;

use super::Path;

/// Largest deviation of a rounded corner from the path, in rad of any joint: at the full reach of every joint together 8 mm,
/// within the margin of the collision checks.
const MAX_DEVIATION: f64 = 0.002;
/// Largest distance of two grid points, in rad of the path.
const GRID_STEP: f64 = 0.01;
/// Smallest number of grid intervals of a rounded corner, within which the direction changes.
const MIN_CORNER_STEPS: f64 = 16.0;
/// Smallest number of grid intervals of a straight piece: between two points at rest there must be one that moves.
const MIN_STRAIGHT_STEPS: f64 = 2.0;
/// Length below which there is no straight piece between two corners, rad: rounding of numbers leaves some.
const MIN_STRAIGHT: f64 = 1e-9;
/// Largest number of grid points.
const MAX_GRID: usize = 20_000;

/// An error of the time parameterisation.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// A limit is zero, negative or not finite.
    #[error("the {what} limit of joint {joint} is {limit}; expected a positive number")]
    Limit {
        /// `velocity` or `acceleration`.
        what: &'static str,
        /// Joint, counted from 0.
        joint: usize,
        /// The limit, in rad/s or rad/s².
        limit: f64,
    },
    /// The path is longer than the grid allows.
    #[error("the path has {length:.0} rad; expected at most {max:.0}")]
    TooLong {
        /// Length, in rad.
        length: f64,
        /// Maximum, in rad.
        max: f64,
    },
}

/// A motion along a path: joints as a function of time, at rest at both ends.
#[derive(Clone, Debug)]
pub struct Trajectory {
    times: Vec<f64>,
    joints: Vec<Joints<7>>,
    velocities: Vec<Joints<7>>,
}

impl Trajectory {
    /// Returns the fastest motion along a path within the limits.
    pub fn new(path: &Path, limits: &JointLimits<7>) -> Result<Self, TrajectoryError> {
        for joint in 0..7 {
            for (what, limit) in [
                ("velocity", limits.speeds[joint]),
                ("acceleration", limits.accelerations[joint]),
            ] {
                if !(limit > 0.0 && limit.is_finite()) {
                    return Err(TrajectoryError::Limit { what, joint, limit });
                }
            }
        }
        let max = GRID_STEP * MAX_GRID as f64;
        let length = path.length();
        if length > max {
            return Err(TrajectoryError::TooLong { length, max });
        }
        let grid = Grid::of(path);
        let squares = grid.squared_velocities(limits);
        Ok(grid.timed(&squares).slowed(limits))
    }

    /// Returns the motion, slowed down as a whole by as much as it exceeds an acceleration limit between grid points, whose
    /// directions differ from those in the middle of the intervals.
    fn slowed(mut self, limits: &JointLimits<7>) -> Self {
        let mut excess = 1.0_f64;
        for index in 1..self.times.len() {
            let step = self.times[index] - self.times[index - 1];
            let change = (self.velocities[index] - self.velocities[index - 1]) / step;
            for joint in 0..7 {
                excess = excess.max(change[joint].abs() / limits.accelerations[joint]);
            }
        }
        let factor = excess.sqrt();
        self.times.iter_mut().for_each(|time| *time *= factor);
        self.velocities
            .iter_mut()
            .for_each(|velocity| *velocity /= factor);
        self
    }

    /// Returns the duration, in seconds.
    pub fn duration(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// Returns the joints at a time, in rad; before the start and after the end, those at rest there.
    pub fn joints_at(&self, time: f64) -> Joints<7> {
        self.at(time).0
    }

    /// Returns the velocities at a time, in rad/s.
    pub fn velocities_at(&self, time: f64) -> Joints<7> {
        self.at(time).1
    }

    fn at(&self, time: f64) -> (Joints<7>, Joints<7>) {
        let after = self.times.partition_point(|&reached| reached <= time);
        if after == 0 {
            return (self.joints[0], Joints::<7>::zeros());
        }
        if after == self.times.len() {
            return (self.joints[after - 1], Joints::<7>::zeros());
        }
        let step = self.times[after] - self.times[after - 1];
        let part = (time - self.times[after - 1]) / step;
        let velocity = self.velocities[after - 1].lerp(&self.velocities[after], part);
        // The acceleration is constant within a step.
        let half = self.velocities[after - 1].lerp(&self.velocities[after], part / 2.0);
        let moved = half * (part * step);
        let whole = (self.velocities[after - 1] + self.velocities[after]) / 2.0 * step;
        // Rounding of the grid is spread over the step.
        let rounding = (self.joints[after] - self.joints[after - 1] - whole) * part;
        (self.joints[after - 1] + moved + rounding, velocity)
    }
}

/// Points of a rounded path with derivatives by its length.
struct Grid {
    step: Vec<f64>,
    joints: Vec<Joints<7>>,
    /// First derivatives in the middle of each interval, and at its end.
    first: Vec<Joints<7>>,
    first_at_end: Vec<Joints<7>>,
    second: Vec<Joints<7>>,
}

/// A piece of a rounded path: `q(s) = start + first s + second s²/2`, for `s` up to `length`.
struct Piece {
    start: Joints<7>,
    first: Joints<7>,
    second: Joints<7>,
    length: f64,
}

/// Rounds the corners of a path by parabolas.
fn rounded(path: &Path) -> Vec<Piece> {
    let postures = path.postures();
    let mut pieces = Vec::new();
    if postures.len() < 2 {
        return pieces;
    }
    let lengths: Vec<f64> = postures
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).norm())
        .collect();
    let directions: Vec<Joints<7>> = postures
        .windows(2)
        .zip(&lengths)
        .map(|(pair, length)| (pair[1] - pair[0]) / *length)
        .collect();
    // The part of a motion that belongs to the corner before it.
    let mut used = 0.0;
    for index in 0..lengths.len() {
        let corner = directions.get(index + 1).map_or(0.0, |next| {
            let turn = (next - directions[index]).amax();
            // A parabola over `2 l` of the path deviates by `turn l / 4` in the middle.
            let half = 4.0 * MAX_DEVIATION / turn.max(1e-9);
            half.min(lengths[index] / 2.0).min(lengths[index + 1] / 2.0)
        });
        let straight = lengths[index] - used - corner;
        if straight > MIN_STRAIGHT {
            pieces.push(Piece {
                start: postures[index] + directions[index] * used,
                first: directions[index],
                second: Joints::<7>::zeros(),
                length: straight,
            });
        }
        if corner > 0.0 {
            let next = directions[index + 1];
            pieces.push(Piece {
                start: postures[index + 1] - directions[index] * corner,
                first: directions[index],
                second: (next - directions[index]) / (2.0 * corner),
                length: 2.0 * corner,
            });
        }
        used = corner;
    }
    pieces
}

impl Grid {
    fn of(path: &Path) -> Self {
        let mut grid = Self {
            step: Vec::new(),
            joints: vec![path.postures()[0]],
            first: Vec::new(),
            first_at_end: Vec::new(),
            second: Vec::new(),
        };
        for piece in rounded(path) {
            let least = if piece.second.amax() > 0.0 {
                MIN_CORNER_STEPS
            } else {
                MIN_STRAIGHT_STEPS
            };
            let count = (piece.length / GRID_STEP).ceil().max(least);
            let step = piece.length / count;
            for index in 0..count as usize {
                // Derivatives in the middle of the interval.
                let middle = (index as f64 + 0.5) * step;
                let end = (index as f64 + 1.0) * step;
                grid.step.push(step);
                grid.first.push(piece.first + piece.second * middle);
                grid.first_at_end.push(piece.first + piece.second * end);
                grid.second.push(piece.second);
                let joints = piece.start + piece.first * end + piece.second * (end * end / 2.0);
                grid.joints.push(joints);
            }
        }
        // Without rounding: a goal at the limit of a joint must not be beyond it.
        if let Some(last) = grid.joints.last_mut() {
            *last = path.goal();
        }
        grid
    }

    /// Returns the square of the path velocity at each grid point.
    fn squared_velocities(&self, limits: &JointLimits<7>) -> Vec<f64> {
        let count = self.step.len();
        // The largest square from which the rest of the path can be done.
        let mut largest = vec![0.0; count + 1];
        for index in (0..count).rev() {
            let bound = self.velocity_bound(index, limits);
            largest[index + 1] = f64::min(largest[index + 1], bound);
            largest[index] = self.reachable(index, limits, largest[index + 1], bound);
        }
        let mut squares = vec![0.0; count + 1];
        for index in 0..count {
            let next = self.reachable(index, limits, squares[index], largest[index + 1]);
            squares[index + 1] = next.min(largest[index + 1]);
        }
        squares
    }

    /// Returns the largest square of the path velocity that the velocity limits allow within an interval.
    fn velocity_bound(&self, index: usize, limits: &JointLimits<7>) -> f64 {
        let mut bound = f64::INFINITY;
        for joint in 0..7 {
            let slope = self.first[index][joint].abs();
            if slope > 1e-9 {
                bound = bound.min((limits.speeds[joint] / slope).powi(2));
            }
            let bend = self.second[index][joint].abs();
            if bend > 1e-9 {
                // Half of the acceleration is left for the bend itself, so that some is left to change the velocity.
                bound = bound.min(limits.accelerations[joint] / (2.0 * bend));
            }
        }
        bound
    }

    /// Returns the largest square at one end of an interval, given that at the other and a bound.
    ///
    /// The acceleration along the path is `u = (end - begin) / (2 step)`; by symmetry the same bound holds in both directions.
    fn reachable(&self, index: usize, limits: &JointLimits<7>, known: f64, bound: f64) -> f64 {
        let step = self.step[index];
        let mut largest = bound;
        for joint in 0..7 {
            let slope = self.first[index][joint].abs();
            if slope < 1e-9 {
                continue;
            }
            let bend = self.second[index][joint].abs();
            // |q'| (x - known) / (2 step) + |q''| (x + known) / 2 <= a, conservatively with both terms of one sign.
            let numerator =
                limits.accelerations[joint] + slope * known / (2.0 * step) - bend * known / 2.0;
            let denominator = slope / (2.0 * step) + bend / 2.0;
            largest = largest.min((numerator / denominator).max(0.0));
        }
        largest
    }

    fn timed(self, squares: &[f64]) -> Trajectory {
        let mut times = vec![0.0];
        let mut velocities = vec![Joints::<7>::zeros()];
        let mut time = 0.0;
        for (index, step) in self.step.iter().enumerate() {
            let (begin, end) = (squares[index].sqrt(), squares[index + 1].sqrt());
            // Never at rest within the path: the limits are positive.
            time += 2.0 * step / (begin + end).max(1e-9);
            times.push(time);
            // Exact: means of the slopes beside a point would jump within a piece that is very short.
            velocities.push(self.first_at_end[index] * end);
        }
        Trajectory {
            times,
            joints: self.joints,
            velocities,
        }
    }
}
