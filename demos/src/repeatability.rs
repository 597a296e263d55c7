//! Measures the repeatability of the arm: table 5 of the thesis, repeated on the simulator.
//!
//! The thesis moved its arm to four poses 500 times and compared the final positions from the
//! encoders with the targets. The simulated arm has the published gains, friction and masses, and a
//! gravity compensation measured on another arm; nothing was fitted to the table, so the numbers
//! agree in magnitude only.

use std::io::{self, Write};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use yarp_devices::kinematics::{Joints, Pose, Redundancy, Solver, SolverOptions};
use yarp_devices::simulation::SimulatedArm;
use yarp_devices::trajectory::{JointLimits, StraightLineOptions};
use yarp_devices::wam::WamModel;

use crate::{DemoArm, DemoError, pose};

/// Target and results of the thesis. Millimetres, and Euler angles in rad.
struct Row {
    place: [f64; 3],
    angles: [f64; 3],
    mean: [f64; 3],
    error: f64,
    spread: f64,
}

/// Equation 4 and table 5 of the thesis.
const THESIS: [Row; 4] = [
    Row {
        place: [500.0, 150.0, 0.0],
        angles: [-0.50, 1.57, 0.00],
        mean: [497.69, 143.65, 12.44],
        error: 14.1605,
        spread: 0.5899,
    },
    Row {
        place: [600.0, 150.0, 100.0],
        angles: [-0.30, 1.30, 0.05],
        mean: [598.30, 150.98, 99.54],
        error: 2.1184,
        spread: 0.0885,
    },
    Row {
        place: [600.0, 0.0, 200.0],
        angles: [-0.20, 1.00, 0.10],
        mean: [599.90, 3.60, 194.57],
        error: 6.5304,
        spread: 0.3387,
    },
    Row {
        place: [500.0, 0.0, 100.0],
        angles: [-0.30, 1.30, 0.05],
        mean: [504.94, -1.30, 101.98],
        error: 5.5140,
        spread: 0.0672,
    },
];

/// Tool speed of the server that the thesis used, m/s (MIT's `wamif`), and its acceleration in
/// m/s².
const SPEED: f64 = 0.2;
/// Time that the arm has to come to rest before the measurement.
const SETTLE_TIME: Duration = Duration::from_millis(500);

/// Positions in millimetres.
type Positions = Vec<Vector3<f64>>;

/// Moves the simulated arm to the four poses `repeat` times and writes the thesis's table beside
/// the measured one.
///
/// Errors: those of `out`, or a pose that the arm refuses.
pub fn run(repeat: usize, arm: DemoArm, out: &mut dyn Write) -> Result<(), DemoError> {
    run_with_offsets(repeat, arm, out).map(drop)
}

/// Does the same as [`run`] and returns, for each pose, the number of each visit and its distance from the target in mm.
pub(crate) fn run_with_offsets(
    repeat: usize,
    arm: DemoArm,
    out: &mut dyn Write,
) -> Result<Vec<Vec<[f64; 2]>>, DemoError> {
    let began = Instant::now();
    let (ends, simulated) = measure(repeat, arm)?;
    let took = began.elapsed();
    writeln!(
        out,
        "Four poses, {repeat} times each: where the encoders say the tool came to rest."
    )?;
    writeln!(
        out,
        "{:.0} s of the simulated arm in {:.1} s, {:.0} times real time.\n",
        simulated.as_secs_f64(),
        took.as_secs_f64(),
        simulated.as_secs_f64() / took.as_secs_f64()
    )?;
    table(&ends, out)?;
    writeln!(
        out,
        "\nThe error is the mean of the distances to the target, the spread their standard deviation."
    )?;
    let offsets = THESIS.iter().zip(&ends).map(|(row, ends)| {
        let off = |(visit, end): (usize, &Vector3<f64>)| {
            [(visit + 1) as f64, (end - Vector3::from(row.place)).norm()]
        };
        ends.iter().enumerate().map(off).collect()
    });
    Ok(offsets.collect())
}

/// Returns the final positions of the tool, pose by pose, in millimetres, and the duration of the
/// motion.
fn measure(repeat: usize, arm: DemoArm) -> Result<(Vec<Positions>, Duration), DemoError> {
    let targets = THESIS.map(|row| pose(row.place, row.angles));
    let model = WamModel::<7>::new();
    let mut arm = SimulatedArm::new(model.clone(), arm.options());
    arm.move_joints(
        &preferred_joints(&model, &targets[0])?,
        &JointLimits::uniform(0.75, 0.5),
    )?;
    arm.finish(SETTLE_TIME);
    let line = StraightLineOptions {
        speed: SPEED,
        acceleration: SPEED,
        ..StraightLineOptions::default()
    };
    let mut ends = vec![Vec::with_capacity(repeat); targets.len()];
    for _ in 0..repeat {
        // The first pose comes last, so that it is also reached from its neighbour.
        for number in [1, 2, 3, 0] {
            arm.move_line(&targets[number], &line)?;
            arm.finish(SETTLE_TIME);
            let end = arm.measured_tool().translation.vector;
            ends[number].push(end * 1000.0);
        }
    }
    Ok((ends, arm.simulator().time()))
}

/// Returns joint angles for a pose, away from the limits.
fn preferred_joints(model: &WamModel<7>, target: &Pose) -> Result<Joints<7>, DemoError> {
    let options = SolverOptions {
        redundancy: Redundancy::AwayFromLimits,
        ..SolverOptions::default()
    };
    let start = Joints::<7>::from([0.0, 0.5, 0.0, 1.8, 0.0, 0.0, 0.0]);
    let solver = Solver::with_options(model.chain.clone(), options);
    Ok(solver.solve(target, &start)?.joints)
}

fn table(ends: &[Positions], out: &mut dyn Write) -> io::Result<()> {
    writeln!(
        out,
        "{:<7}  {:<17} | {:<25} {:>6} {:>7} | {:<25} {:>6} {:>7}",
        "[mm]", "target", "thesis: mean", "error", "spread", "here: mean", "error", "spread"
    )?;
    let mut sums = [0.0; 4];
    for (number, (row, ends)) in THESIS.iter().zip(ends).enumerate() {
        let found = Statistics::of(ends, &Vector3::from(row.place));
        writeln!(
            out,
            "{:<7}  {:<17} | {:<25} {:>6.2} {:>7.4} | {:<25} {:>6.2} {:>7.4}",
            format!("Point {}", number + 1),
            format_position(&row.place, 0),
            format_position(&row.mean, 2),
            row.error,
            row.spread,
            format_position(&found.mean.into(), 2),
            found.error,
            found.spread
        )?;
        for (sum, value) in sums
            .iter_mut()
            .zip([row.error, row.spread, found.error, found.spread])
        {
            *sum += value / THESIS.len() as f64;
        }
    }
    let [error, spread, our_error, our_spread] = sums;
    writeln!(
        out,
        "{:<7}  {:<17} | {:<25} {error:>6.2} {spread:>7.4} | {:<25} {our_error:>6.2} {our_spread:>7.4}",
        "Average", "", "", ""
    )
}

fn format_position(millimetres: &[f64; 3], decimals: usize) -> String {
    let [x, y, z] = millimetres;
    format!("({x:.decimals$}, {y:.decimals$}, {z:.decimals$})")
}

/// Statistics of one pose, as in the thesis's table.
struct Statistics {
    mean: Vector3<f64>,
    /// Mean distance to the target.
    error: f64,
    /// Standard deviation of the distances to the target.
    spread: f64,
}

impl Statistics {
    fn of(ends: &[Vector3<f64>], target: &Vector3<f64>) -> Self {
        let count = ends.len().max(1) as f64;
        let mean = ends.iter().sum::<Vector3<f64>>() / count;
        let distances = || ends.iter().map(|end| (end - target).norm());
        let average = distances().sum::<f64>() / count;
        let variance = distances()
            .map(|distance| (distance - average).powi(2))
            .sum::<f64>()
            / count;
        Self {
            mean,
            error: average,
            spread: variance.sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the interpretation of the thesis's columns: the mean of the distances is slightly
    /// larger than the distance of the mean.
    #[test]
    fn the_thesis_errors_are_mean_distances() {
        for row in &THESIS {
            let off = Vector3::from(row.mean) - Vector3::from(row.place);
            let more = row.error - off.norm();
            assert!((0.0..0.15).contains(&more), "{off}");
        }
    }

    #[test]
    fn statistics_of_known_points() {
        let target = Vector3::zeros();
        let ends = [Vector3::new(3.0, 0.0, 0.0), Vector3::new(5.0, 0.0, 0.0)];
        let found = Statistics::of(&ends, &target);
        assert_eq!((found.mean.x, found.error, found.spread), (4.0, 4.0, 1.0));
    }

    #[test]
    fn the_arm_reaches_each_pose_repeatably() {
        let mut out = Vec::new();
        let (ends, _) = measure(4, DemoArm::Dynamic).unwrap();
        table(&ends, &mut out).unwrap();
        for (row, ends) in THESIS.iter().zip(&ends) {
            assert_eq!(ends.len(), 4);
            let found = Statistics::of(ends, &Vector3::from(row.place));
            assert!(found.error < 15.0, "{} mm", found.error);
            assert!(found.spread < 2.0, "{} mm", found.spread);
        }
        let table = String::from_utf8(out).unwrap();
        assert_eq!(table.lines().count(), 6, "{table}");
        assert!(table.contains("7.08"), "the thesis's average: {table}");
    }

    /// The thesis's arm ended 7.08 mm from its targets on average, and 14.16 mm at most.
    #[test]
    fn with_the_effects_of_a_real_arm_it_is_as_far_off_as_the_thesis_at_most() {
        let (ends, _) = measure(4, DemoArm::Real).unwrap();
        let found: Vec<_> = THESIS
            .iter()
            .zip(&ends)
            .map(|(row, ends)| Statistics::of(ends, &Vector3::from(row.place)).error)
            .collect();
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        assert!(mean < 7.0808, "{found:?} mm");
        assert!(found.iter().all(|error| *error < 14.1605), "{found:?} mm");
        let (ideal, _) = measure(1, DemoArm::Dynamic).unwrap();
        assert_ne!(ends[0][0], ideal[0][0], "it has effects");
    }
}
