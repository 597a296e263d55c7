//! Measures if joints move together: figure 13 of the thesis, repeated on the simulator.
//!
//! The thesis moved the tool from point to point and fitted a regression line to the positions from
//! the encoders: the path was straight except at the outer end, where a joint came near its limit.
//! Here the same is done twice, with the default solver and with the thesis's transposed Jacobian,
//! one step per control period.

use std::io::{self, Write};
use std::time::Duration;

use nalgebra::{Matrix3, Vector3};
use yarp_devices::kinematics::{Chain, Joints, Pose, Redundancy, Solver, SolverOptions, Task};
use yarp_devices::simulation::SimulatedArm;
use yarp_devices::trajectory::{JointLimits, StraightLine, StraightLineOptions};
use yarp_devices::wam::WamModel;

use crate::{DemoArm, DemoError, pose};

/// Start and target: from near the base to the outer end of the reach, in millimetres, and Euler
/// angles in rad.
const START: [f64; 3] = [400.0, -200.0, 100.0];
const TARGET: [f64; 3] = [620.0, 250.0, 350.0];
const ANGLES: [f64; 3] = [-0.30, 1.30, 0.05];
/// Number of control periods per sample: 50 samples a second, as over the network.
const SAMPLE_STEP: usize = 10;

/// Moves the joints of the simulated arm together and its tool along a line, and writes how
/// straight the path was.
///
/// Errors: those of `out`, or a pose that the arm refuses.
pub fn run(arm: DemoArm, out: &mut dyn Write) -> Result<(), DemoError> {
    run_with_paths(arm, out).map(drop)
}

/// A path of the tool.
#[derive(Clone, Debug)]
pub(crate) struct ToolPath {
    /// Inverse kinematics that led the tool.
    pub(crate) name: &'static str,
    /// Positions from the encoders, mm.
    pub(crate) places: Vec<[f64; 3]>,
    /// Ends of the regression line, mm.
    pub(crate) regression: [[f64; 3]; 2],
}

/// Does the same as [`run`] and returns the paths of the tool.
pub(crate) fn run_with_paths(
    arm: DemoArm,
    out: &mut dyn Write,
) -> Result<Vec<ToolPath>, DemoError> {
    report_joint_delays(arm, out)?;
    let model = WamModel::<7>::new();
    let start = start_joints(&model)?;
    writeln!(
        out,
        "\nThe tool on a line from ({:.0}, {:.0}, {:.0}) to ({:.0}, {:.0}, {:.0}) mm, sampled 50 times a second:\n",
        START[0], START[1], START[2], TARGET[0], TARGET[1], TARGET[2]
    )?;
    writeln!(
        out,
        "{:<34} {:>7} {:>22} {:>22} {:>12}",
        "inverse kinematics", "points", "off the regression", "off the line asked", "turned from"
    )?;
    writeln!(
        out,
        "{:<34} {:>7} {:>22} {:>22} {:>12}",
        "", "", "mean / most [mm]", "mean / most [mm]", "it [deg]"
    )?;
    let mut paths = Vec::new();
    for (name, way) in [
        ("damped least squares", Inverse::Solver),
        ("transposed Jacobian (the thesis's)", Inverse::Transposed),
    ] {
        let places = line(arm, &model, &start, way)?;
        row(name, &Straightness::of(&places), places.len(), out)?;
        paths.push(ToolPath {
            name,
            regression: regression(&places),
            places: places.into_iter().map(Into::into).collect(),
        });
    }
    writeln!(
        out,
        "\nThe thesis gives a figure and no numbers: straight, but bent at the outer end by a joint's limit."
    )?;
    Ok(paths)
}

/// Returns the ends of the regression line of positions: the first and the last position, put on it.
fn regression(places: &[Vector3<f64>]) -> [[f64; 3]; 2] {
    let (centre, along) = fitted_line(places);
    let ends = [places.first(), places.last()].map(|end| end.copied().unwrap_or(centre));
    ends.map(|end| (centre + along * (end - centre).dot(&along)).into())
}

/// Returns a point and the direction of the regression line of positions.
fn fitted_line(places: &[Vector3<f64>]) -> (Vector3<f64>, Vector3<f64>) {
    let count = places.len().max(1) as f64;
    let centre = places.iter().sum::<Vector3<f64>>() / count;
    let scatter: Matrix3<f64> = places
        .iter()
        .map(|place| (place - centre) * (place - centre).transpose())
        .sum();
    (centre, principal(&scatter))
}

/// Reports a joint move: the share of its path that each joint has completed, at tenths of the
/// time.
fn report_joint_delays(arm: DemoArm, out: &mut dyn Write) -> Result<(), DemoError> {
    let mut arm = SimulatedArm::new(WamModel::<7>::new(), arm.options());
    let start = Joints::<7>::from([0.2, 0.6, 0.0, 1.6, 0.0, 0.3, 0.0]);
    let target = Joints::<7>::from([-0.4, 0.2, 0.4, 2.0, -0.7, -0.4, 0.8]);
    arm.place(&start);
    arm.move_joints(&target, &JointLimits::uniform(0.75, 0.5))?;
    let mut seen = Vec::new();
    while arm.is_moving() {
        arm.tick();
        seen.push((arm.measured() - start).component_div(&(target - start)) * 100.0);
    }
    writeln!(
        out,
        "All joints together: how much of its way each has done by its encoder, in %.\n"
    )?;
    writeln!(
        out,
        "{:>6}  {}",
        "time",
        (1..=7)
            .map(|joint| format!("{:>8}", format!("joint {joint}")))
            .collect::<String>()
    )?;
    for tenth in 1..=10 {
        let at = seen.len() * tenth / 10 - 1;
        let shares: String = seen[at]
            .iter()
            .map(|share| format!("{share:>8.1}"))
            .collect();
        writeln!(out, "{:>4} %  {shares}", tenth * 10)?;
    }
    let apart = seen
        .iter()
        .map(|shares| shares.max() - shares.min())
        .fold(0.0, f64::max);
    writeln!(out, "At most {apart:.1} % apart.")?;
    Ok(())
}

/// Returns the joint angles for the start of the line.
fn start_joints(model: &WamModel<7>) -> Result<Joints<7>, DemoError> {
    let options = SolverOptions {
        redundancy: Redundancy::AwayFromLimits,
        ..SolverOptions::default()
    };
    let near = Joints::<7>::from([-0.4, 0.3, 0.0, 2.0, 0.0, 0.0, 0.0]);
    let solver = Solver::with_options(model.chain.clone(), options);
    Ok(solver.solve(&pose(START, ANGLES), &near)?.joints)
}

/// Solver for the joint angles along the line.
#[derive(Clone, Copy)]
enum Inverse {
    Solver,
    Transposed,
}

/// Moves along the line; returns the positions of the tool from the encoders, in millimetres.
fn line(
    arm: DemoArm,
    model: &WamModel<7>,
    start: &Joints<7>,
    way: Inverse,
) -> Result<Vec<Vector3<f64>>, DemoError> {
    let mut arm = SimulatedArm::new(model.clone(), arm.options());
    arm.place(start);
    let target = pose(TARGET, ANGLES);
    let mut places = Vec::new();
    match way {
        Inverse::Solver => {
            arm.move_line(&target, &options())?;
            while arm.is_moving() {
                arm.tick();
                places.push(arm.measured_tool().translation.vector * 1000.0);
            }
        }
        Inverse::Transposed => {
            let mut joints = arm.set_point();
            for pose in waypoints(model, &joints, &target)? {
                joints = transposed_step(&model.chain, &joints, &pose);
                arm.follow(&joints)?;
                arm.tick();
                places.push(arm.measured_tool().translation.vector * 1000.0);
            }
        }
    }
    Ok(places.into_iter().step_by(SAMPLE_STEP).collect())
}

fn options() -> StraightLineOptions {
    StraightLineOptions {
        speed: 0.2,
        acceleration: 0.2,
        ..StraightLineOptions::default()
    }
}

/// Returns the poses of the tool along the line, one per control period.
fn waypoints(
    model: &WamModel<7>,
    start: &Joints<7>,
    target: &Pose,
) -> Result<Vec<Pose>, DemoError> {
    let once = SolverOptions {
        attempts: 1,
        ..SolverOptions::default()
    };
    let solver = Solver::with_options(model.chain.clone(), once);
    let period = Duration::from_millis(2);
    let mut line = StraightLine::plan(&solver, start, target, &options(), period)?;
    Ok(std::iter::from_fn(|| line.next_joints())
        .map(|joints| model.chain.forward(&joints))
        .collect())
}

/// Applies equation 2 of the thesis once: `Δθ = α Jᵀ e`.
fn transposed_step(chain: &Chain<7>, joints: &Joints<7>, target: &Pose) -> Joints<7> {
    let (pose, jacobian) = chain.forward_and_jacobian(joints);
    let error = Task::Pose.error(target, &pose);
    let pull = jacobian.transpose() * error;
    let effect = jacobian * pull;
    let alpha = error.dot(&effect) / effect.norm_squared();
    if alpha.is_finite() {
        chain.clamp(&(joints + pull * alpha))
    } else {
        *joints
    }
}

/// Distances of positions from lines, in millimetres and degrees.
struct Straightness {
    regression_mean: f64,
    regression_most: f64,
    asked_mean: f64,
    asked_most: f64,
    turned: f64,
}

impl Straightness {
    fn of(places: &[Vector3<f64>]) -> Self {
        let count = places.len().max(1) as f64;
        let (centre, along) = fitted_line(places);
        let from = Vector3::from(START);
        let asked = (Vector3::from(TARGET) - from).normalize();
        let off = |point: &Vector3<f64>, direction: &Vector3<f64>| {
            let (mut sum, mut most) = (0.0, 0.0_f64);
            for place in places {
                let off = (place - point).cross(direction).norm();
                sum += off / count;
                most = most.max(off);
            }
            (sum, most)
        };
        let (regression_mean, regression_most) = off(&centre, &along);
        let (asked_mean, asked_most) = off(&from, &asked);
        Self {
            regression_mean,
            regression_most,
            asked_mean,
            asked_most,
            turned: along.dot(&asked).abs().min(1.0).acos().to_degrees(),
        }
    }
}

/// Returns the direction of maximum scatter: the regression line in space.
fn principal(scatter: &Matrix3<f64>) -> Vector3<f64> {
    let eigen = scatter.symmetric_eigen();
    eigen
        .eigenvectors
        .column(eigen.eigenvalues.imax())
        .into_owned()
}

fn row(name: &str, found: &Straightness, points: usize, out: &mut dyn Write) -> io::Result<()> {
    let pair = |mean: f64, most: f64| format!("{mean:.2} / {most:.2}");
    writeln!(
        out,
        "{name:<34} {points:>7} {:>22} {:>22} {:>12.2}",
        pair(found.regression_mean, found.regression_most),
        pair(found.asked_mean, found.asked_most),
        found.turned
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_line_are_straight_and_others_are_not() {
        let (from, to) = (Vector3::from(START), Vector3::from(TARGET));
        let mut places: Vec<_> = (0..=100)
            .map(|step| from.lerp(&to, f64::from(step) / 100.0))
            .collect();
        let found = Straightness::of(&places);
        assert!(found.regression_most < 1e-9 && found.asked_most < 1e-9);
        assert!(found.turned < 1e-4);
        places[50] += Vector3::new(0.0, 0.0, 10.0);
        let found = Straightness::of(&places);
        assert!(found.asked_most > 5.0 && found.regression_most > 5.0);
    }

    #[test]
    fn the_tool_goes_nearly_straight() {
        for arm in [DemoArm::Dynamic, DemoArm::Real] {
            let model = WamModel::<7>::new();
            let start = start_joints(&model).unwrap();
            let places = line(arm, &model, &start, Inverse::Solver).unwrap();
            let found = Straightness::of(&places);
            assert!(found.asked_most < 20.0, "{arm:?}: {} mm", found.asked_most);
            assert!(found.turned < 2.0, "{arm:?}: {} degrees", found.turned);
        }
    }

    #[test]
    fn both_parts_are_printed() {
        for arm in [DemoArm::Dynamic, DemoArm::Real] {
            let mut out = Vec::new();
            run(arm, &mut out).unwrap();
            let text = String::from_utf8(out).unwrap();
            assert!(text.contains("All joints together"), "{text}");
            assert!(text.contains("transposed Jacobian"), "{text}");
        }
    }
}
