//! `yarp plan`: collision-free motions of the arm.

#[cfg(feature = "table")]
mod plan_evaluation;

use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use serde_json::json;
use yarp_planning::{Problem, ProblemError};

use crate::error::Result;

/// Maximum size of a scene's file, bytes.
const MAX_FILE: u64 = 16 << 20;

/// plan collision-free motions of the arm
///
/// Plans motions of a WAM with a BarrettHand among obstacles. Needs no network and no robot.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Plan a motion in a scene of a JSON file; exit code 1 if there is none
    ///
    /// {"start": [7 angles], "goals": [[7 angles]], "obstacles": [{"name": "box", "shape": {"cuboid": [0.1, 0.1, 0.2]},
    /// "position": [0.5, 0, 0.1], "rotation": [0, 0, 0.3]}]}, in m and rad. Other shapes: {"cylinder": {"radius": 0.1,
    /// "height": 0.3}}, {"sphere": {"radius": 0.1}}, "half_space".
    Solve {
        /// Scene, start and goals
        #[arg(value_name = "SCENE.json")]
        scene: PathBuf,
        /// Print one JSON object: path in rad, duration and trajectory
        #[arg(long)]
        json: bool,
    },
    /// Plan in random cluttered scenes and check each path with the physics engine; exit code 1 below target
    #[cfg(feature = "table")]
    Evaluate(plan_evaluation::Args),
}

/// Error of `yarp plan`.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PlanFailure {
    /// The file cannot be read.
    #[error("cannot read the scene {path}: {source}")]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Reason.
        source: std::io::Error,
    },
    /// The file is larger than any scene.
    #[error("the scene {path} has more than {} MiB", MAX_FILE >> 20)]
    TooLarge {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file is no scene.
    #[error("{path}: {source}")]
    Problem {
        /// Path of the file.
        path: PathBuf,
        /// Reason.
        source: ProblemError,
    },
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    match args.action {
        Action::Solve { scene, json } => solve(&scene, json, out),
        #[cfg(feature = "table")]
        Action::Evaluate(args) => plan_evaluation::run(&args, out),
    }
}

fn read(path: &Path) -> std::result::Result<Problem, PlanFailure> {
    let failed = |source| PlanFailure::File {
        path: path.to_owned(),
        source,
    };
    let mut text = String::new();
    let file = File::open(path).map_err(failed)?;
    file.take(MAX_FILE + 1)
        .read_to_string(&mut text)
        .map_err(failed)?;
    if text.len() as u64 > MAX_FILE {
        let path = path.to_owned();
        return Err(PlanFailure::TooLarge { path });
    }
    Problem::from_json(&text).map_err(|source| PlanFailure::Problem {
        path: path.to_owned(),
        source,
    })
}

/// Interval between two points of a printed trajectory, s.
const TRAJECTORY_INTERVAL: f64 = 0.02;

fn solve(path: &Path, json: bool, out: &mut dyn Write) -> Result<ExitCode> {
    let problem = read(path)?;
    let mut planner = problem.planner();
    let start = Instant::now();
    let planned = planner.plan(&problem.start, &problem.goals);
    let seconds = start.elapsed().as_secs_f64();
    let found = planned.map_err(|error| error.to_string()).and_then(|path| {
        match planner.trajectory(&path) {
            Ok(trajectory) => Ok((path, trajectory)),
            Err(error) => Err(error.to_string()),
        }
    });
    let (path, trajectory) = match found {
        Ok(found) => found,
        Err(why) => {
            if json {
                let reply = json!({"solved": false, "error": why, "planning_seconds": seconds});
                writeln!(out, "{reply}")?;
            } else {
                writeln!(out, "no path: {why}")?;
            }
            return Ok(ExitCode::FAILURE);
        }
    };
    let row = |joints: &yarp_devices::kinematics::Joints<7>| joints.as_slice().to_vec();
    if !json {
        writeln!(
            out,
            "a path of {:.3} rad in {:.3} s, planned in {:.1} ms",
            path.length(),
            trajectory.duration(),
            seconds * 1e3
        )?;
        for joints in path.postures() {
            writeln!(out, "  {:?}", row(joints))?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    let count = (trajectory.duration() / TRAJECTORY_INTERVAL).ceil() as usize;
    let points: Vec<_> = (0..=count)
        .map(|index| {
            let time = (index as f64 * TRAJECTORY_INTERVAL).min(trajectory.duration());
            json!({
                "time": time,
                "joints": row(&trajectory.joints_at(time)),
                "velocities": row(&trajectory.velocities_at(time)),
            })
        })
        .collect();
    let reply = json!({
        "solved": true,
        "planning_seconds": seconds,
        "length": path.length(),
        "duration": trajectory.duration(),
        "path": path.postures().iter().map(row).collect::<Vec<_>>(),
        "trajectory": points,
    });
    writeln!(out, "{reply}")?;
    Ok(ExitCode::SUCCESS)
}
