//! `yarp vision evaluate`: detections on random simulated tables against the truth.

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use serde_json::json;
use yarp_vision::simulated::{
    Evaluation, MIN_VISIBLE, ObjectClass, SceneSet, SimulatedScenes, TRAINING_SEEDS,
    table_database, table_setup,
};
use yarp_vision::{Detector, DetectorParameters, VisionError};

use super::failed;
use crate::commands::code;
use crate::error::Result;

/// Largest median and largest position error, m, and largest median time of a detection, ms.
const MAX_MEDIAN_ERROR: f64 = 0.002;
const MAX_ERROR: f64 = 0.005;
const MAX_MILLISECONDS: f64 = 150.0;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Seed of the tables; 9000 to 9099 are those of the training tables
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of images
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..))]
    count: u64,
    /// Objects on the tables
    #[arg(long, value_name = "SET", default_value = "all", value_parser = ["all", "sift", "circles", "polygons"])]
    set: String,
    /// Parameters of the detector, JSON as `yarp vision select` writes it
    #[arg(long, value_name = "FILE")]
    parameters: Option<PathBuf>,
    /// Print one line of JSON
    #[arg(long)]
    json: bool,
    /// Print each miss, false detection and large position error to stderr
    #[arg(long)]
    mistakes: bool,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let parameters = match &args.parameters {
        None => DetectorParameters::default(),
        Some(path) => {
            let text = fs::read_to_string(path)?;
            serde_json::from_str(&text).map_err(failed)?
        }
    };
    let set = SceneSet::from_word(&args.set).unwrap_or(SceneSet::All);
    let scenes = SimulatedScenes::new(args.seed, set);
    let detector = Detector::new(table_database(), table_setup(), parameters);
    let mut detector = detector.map_err(failed)?;
    let mut evaluation = Evaluation::default();
    let mut no_room = 0;
    for index in 0..args.count {
        // A table without room for its objects is no scene.
        let Ok(scene) = scenes.scene(index) else {
            no_room += 1;
            continue;
        };
        let start = Instant::now();
        let found = match detector.detect(&scene.image, Some(&scene.depth)) {
            // An image that cannot be used has no detections: all its objects are missed.
            Err(VisionError::NoContrast { .. }) => Vec::new(),
            found => found.map_err(failed)?,
        };
        let milliseconds = start.elapsed().as_secs_f64() * 1e3;
        evaluation.add(&index.to_string(), &scene.truth, &found, milliseconds);
    }
    if args.mistakes {
        for mistake in evaluation.mistakes() {
            eprintln!("image {mistake}");
        }
    }
    let (report, passed) = report(&args, &evaluation, no_room);
    let text = match args.json {
        true => report.to_string(),
        false => format!("{report:#}"),
    };
    writeln!(out, "{text}")?;
    Ok(code(passed))
}

fn report(args: &Args, evaluation: &Evaluation, no_room: u64) -> (serde_json::Value, bool) {
    let classes = [
        ("sift", Some(ObjectClass::Sift)),
        ("circles", Some(ObjectClass::Circles)),
        ("polygons", Some(ObjectClass::Polygons)),
        ("all", None),
    ];
    let mut rows = serde_json::Map::new();
    let mut passed = true;
    for (name, class) in classes {
        let row = evaluation.row(class);
        if row.counts.targets > 0 || row.counts.detections > 0 {
            passed &= row.passed;
            rows.insert(name.to_owned(), json!(row));
        }
    }
    let [median, max] = evaluation.position_error();
    let [p50, p99] = evaluation.milliseconds();
    let position_passed = median <= MAX_MEDIAN_ERROR && max <= MAX_ERROR;
    let time_passed = p50 <= MAX_MILLISECONDS;
    passed &= position_passed && time_passed && evaluation.counts(None).targets > 0;
    let [first, last] = TRAINING_SEEDS;
    let report = json!({
        "seed": args.seed,
        "split": if (first..=last).contains(&args.seed) { "training" } else { "test" },
        "set": args.set,
        "images": evaluation.scenes(),
        "images_without_room": no_room,
        "present_if_visible": MIN_VISIBLE,
        "rows": rows,
        "position_error_mm": {
            "median": median * 1e3, "max": max * 1e3,
            "target_median": MAX_MEDIAN_ERROR * 1e3, "target_max": MAX_ERROR * 1e3,
            "passed": position_passed,
        },
        "detection_ms": { "p50": p50, "p99": p99, "target_p50": MAX_MILLISECONDS, "passed": time_passed },
        "passed": passed,
    });
    (report, passed)
}
