//! `yarp table evaluate`: the time of rendering an image and of simulating a second.

use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use nalgebra::Translation3;
use serde_json::{Value, json};
use yarp_table::{
    Dataset, DatasetOptions, NoRoom, Placement, Renderer, Scene, SimulationOptions, TableSimulation,
};

use super::failed;
use crate::commands::{code, quantile};
use crate::error::Result;

/// Largest median time of rendering an image, ms, and of simulating a second, s.
const TARGET_RENDER: f64 = 100.0;
const TARGET_SECOND: f64 = 0.2;
/// Layers of objects that fall onto a simulated table, and objects of each: objects at rest cost nothing.
const LAYERS: u64 = 5;
const LAYER: usize = 6;
/// Distance between two layers, and of the lowest one from the table, m: within a second all meet.
const DISTANCE: f64 = 0.2;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Seed of the tables
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of images, and of tables
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    count: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, out: &mut dyn Write) -> Result<ExitCode> {
    let images = images(args).map_err(failed)?;
    let seconds = seconds(args).map_err(failed)?;
    let (images, seconds) = (row(&images, TARGET_RENDER), row(&seconds, TARGET_SECOND));
    let passed = images["passed"] == true && seconds["passed"] == true;
    let report = json!({
        "seed": args.seed,
        "count": args.count,
        "render_ms": images,
        "objects": LAYERS as usize * LAYER,
        "simulated_second_s": seconds,
        "passed": passed,
    });
    match args.json {
        true => writeln!(out, "{report}")?,
        false => writeln!(out, "{report:#}")?,
    }
    Ok(code(passed))
}

/// Returns the times of rendering the colour images of random tables with their truth, ms.
fn images(args: &Args) -> std::result::Result<Vec<f64>, NoRoom> {
    let dataset = Dataset::new(args.seed, DatasetOptions::default());
    let renderer = Renderer::new();
    let time = |index| {
        let (scene, effects) = dataset.scene(index)?;
        let start = Instant::now();
        let shot = renderer.render(&scene, &scene.camera(), &effects);
        let milliseconds = start.elapsed().as_secs_f64() * 1e3;
        drop(shot);
        Ok(milliseconds)
    };
    (0..args.count).map(time).collect()
}

/// Returns the times of simulating a second of objects that fall onto a table and each other, s.
fn seconds(args: &Args) -> std::result::Result<Vec<f64>, NoRoom> {
    let time = |index: u64| {
        let scene = falling(args.seed.wrapping_add(index.wrapping_mul(LAYERS)))?;
        let mut table = TableSimulation::new(scene, SimulationOptions::default());
        let start = Instant::now();
        table.run(Duration::from_secs(1));
        Ok(start.elapsed().as_secs_f64())
    };
    (0..args.count).map(time).collect()
}

/// Returns a table with layers of objects above it.
fn falling(seed: u64) -> std::result::Result<Scene, NoRoom> {
    let placement = Placement::default().with_count(LAYER);
    let mut all = Scene::empty();
    for layer in 0..LAYERS {
        let scene = Scene::random(seed.wrapping_add(layer), &placement)?;
        let up = Translation3::new(0.0, 0.0, (layer + 1) as f64 * DISTANCE);
        for mut object in scene.objects {
            object.id = all.objects.len() as u32;
            object.pose = up * object.pose;
            all.objects.push(object);
        }
    }
    Ok(all)
}

fn row(times: &[f64], target: f64) -> Value {
    let median = quantile(times, 0.5);
    json!({
        "p50": median,
        "p99": quantile(times, 0.99),
        "target_p50": target,
        "passed": median.is_some_and(|median| median <= target),
    })
}
