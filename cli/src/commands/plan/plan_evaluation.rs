//! `yarp plan evaluate`: the planner in random scenes, judged by the physics engine.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use serde_json::{Value, json};
use yarp_devices::wam::WamModel;
use yarp_planning::{Obstacle, Path, Problem, Shape};
use yarp_table::{PathCheck, Solid};

use super::PlanFailure;
use crate::commands::quantile;
use crate::error::{Failure, Result};

/// Smallest part of the scenes to be solved.
const TARGET_SOLVED: f64 = 0.995;
/// Largest median and 99th percentile of the planning time, ms.
const TARGET_P50: f64 = 2.0;
const TARGET_P99: f64 = 100.0;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Seed of the scenes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of scenes
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..))]
    count: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Write arm, scenes and paths to this file, for other planners: one JSON object per line
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
}

/// The results of all scenes.
#[derive(Debug, Default)]
struct Results {
    times: Vec<f64>,
    solved: u64,
    length: f64,
    collisions: u64,
    least_distance: f64,
    without_path: Vec<u64>,
}

pub(super) fn run(args: &Args, out: &mut dyn Write) -> Result<ExitCode> {
    let failed = |source| {
        let path = args.export.clone().unwrap_or_default();
        Failure::Plan(PlanFailure::File { path, source })
    };
    let mut export = match &args.export {
        Some(path) => Some(BufWriter::new(File::create(path).map_err(failed)?)),
        None => None,
    };
    if let Some(file) = &mut export {
        writeln!(file, "{}", arm()).map_err(failed)?;
    }
    let mut results = Results {
        least_distance: f64::INFINITY,
        ..Results::default()
    };
    for index in 0..args.count {
        let problem = Problem::random(args.seed, index);
        let path = results.plan(index, &problem);
        if let Some(file) = &mut export {
            let problem: Value = serde_json::from_str(&problem.to_json()).unwrap_or_default();
            let (milliseconds, length) = (
                results.times[index as usize],
                path.map(|path| path.length()),
            );
            let line = json!({"problem": problem, "length": length, "milliseconds": milliseconds});
            writeln!(file, "{line}").map_err(failed)?;
        }
    }
    if let Some(file) = &mut export {
        file.flush().map_err(failed)?;
    }
    results.print(args, out)
}

impl Results {
    fn plan(&mut self, index: u64, problem: &Problem) -> Option<Path> {
        let mut planner = problem.planner();
        let start = Instant::now();
        let path = planner.plan(&problem.start, &problem.goals).ok();
        self.times.push(start.elapsed().as_secs_f64() * 1e3);
        let Some(path) = path else {
            self.without_path.push(index);
            return None;
        };
        self.solved += 1;
        self.length += path.length();
        let chain = WamModel::<7>::new().chain;
        let check = PathCheck::new(&chain, problem.scene.obstacles().iter().map(solid));
        let distance = check.distance_along(path.postures());
        self.least_distance = self.least_distance.min(distance);
        self.collisions += u64::from(distance <= 0.0);
        Some(path)
    }

    fn print(self, args: &Args, out: &mut dyn Write) -> Result<ExitCode> {
        // There is at least one scene.
        let at = |part: f64| quantile(&self.times, part).unwrap_or_default();
        let share = self.solved as f64 / args.count as f64;
        let (p50, p99) = (at(0.5), at(0.99));
        let ok = share >= TARGET_SOLVED
            && p50 <= TARGET_P50
            && p99 <= TARGET_P99
            && self.collisions == 0;
        let mean = self.length / self.solved.max(1) as f64;
        if args.json {
            let reply = json!({
                "seed": args.seed,
                "scenes": args.count,
                "solved": self.solved,
                "solved_share": share,
                "without_path": self.without_path,
                "p50_ms": p50,
                "p99_ms": p99,
                "max_ms": at(1.0),
                "mean_length_rad": mean,
                "collisions": self.collisions,
                "collision_checker": "parry, the collision library of rapier",
                "least_distance_m": self.least_distance,
                "passed": ok,
            });
            writeln!(out, "{reply}")?;
        } else {
            writeln!(
                out,
                "{} of {} scenes solved; {p50:.3} ms median, {p99:.3} ms 99th percentile; {mean:.3} rad on average; {} paths collide, nearest {:.4} m",
                self.solved, args.count, self.collisions, self.least_distance
            )?;
        }
        Ok(if ok {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        })
    }
}

fn solid(obstacle: &Obstacle) -> (Solid, yarp_devices::kinematics::Pose) {
    let solid = match obstacle.shape {
        Shape::Cuboid { half } => Solid::Cuboid((half * 2.0).into()),
        Shape::Cylinder {
            radius,
            half_height,
        } => Solid::Cylinder {
            radius,
            height: 2.0 * half_height,
        },
        Shape::Sphere { radius } => Solid::Sphere { radius },
        Shape::HalfSpace => Solid::HalfSpace,
    };
    (solid, obstacle.pose)
}

/// Returns the arm as the planner sees it: frames of links, limits, spheres, margin.
fn arm() -> Value {
    let problem = Problem::random(0, 0);
    let planner = problem.planner();
    let model = planner.model();
    let limits = model.chain().limits();
    let spheres: Vec<Value> = model
        .geometry()
        .spheres()
        .iter()
        .map(|sphere| {
            let center: [f64; 3] = sphere.center.into();
            json!({"link": sphere.link, "center": center, "radius": sphere.radius})
        })
        .collect();
    // The frame of each link in that before it, while the joint is at 0; the joint turns about z before it.
    let frames = model
        .chain()
        .frames(&yarp_devices::kinematics::Joints::<7>::zeros());
    let mut before = yarp_devices::kinematics::Pose::identity();
    let rows: Vec<Value> = frames
        .iter()
        .map(|frame| {
            let matrix = (before.inverse() * frame).to_homogeneous();
            before = *frame;
            json!(matrix.transpose().as_slice())
        })
        .collect();
    json!({
        "margin": yarp_planning::MARGIN,
        "limits": limits.iter().map(|range| [range.min, range.max]).collect::<Vec<_>>(),
        "links": rows,
        "spheres": spheres,
    })
}
