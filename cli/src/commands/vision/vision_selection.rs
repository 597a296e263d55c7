//! `yarp vision select`: parameters of the detector from training tables.

use std::fmt::Write as _;
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use serde_json::json;
use yarp_vision::simulated::{
    Evaluation, ObjectClass, SceneSet, Selection, SimulatedScene, SimulatedScenes, TRAINING_SEEDS,
    select, table_database, table_setup, write_roc,
};
use yarp_vision::{Detector, DetectorParameters};

use super::failed;
use crate::error::Result;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Seed of the training tables; a test split of as many tables has the next seed
    #[arg(long, default_value_t = TRAINING_SEEDS[0])]
    seed: u64,
    /// Number of training images, kept in memory: about 7 MB each
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u64).range(1..=500))]
    count: u64,
    /// Folder for parameters.json, table.md and the ROC curves
    #[arg(long, value_name = "DIR", default_value = "vision-selection")]
    out: PathBuf,
    /// Print one line of JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    fs::create_dir_all(&args.out)?;
    let detector = Detector::new(
        table_database(),
        table_setup(),
        DetectorParameters::default(),
    );
    let mut detector = detector.map_err(failed)?;
    let scenes = |seed: u64| -> Vec<SimulatedScene> {
        let scenes = SimulatedScenes::new(seed, SceneSet::All);
        (0..args.count)
            .flat_map(|index| scenes.scene(index))
            .collect()
    };
    let selection = select(&mut detector, &scenes(args.seed)).map_err(failed)?;
    let mut test = Evaluation::default();
    for (index, scene) in scenes(args.seed + 1).iter().enumerate() {
        let found = detector.detect(&scene.image, Some(&scene.depth));
        let found = found.map_err(failed)?;
        test.add(&index.to_string(), &scene.truth, &found, 0.0);
    }
    let parameters = serde_json::to_string_pretty(&selection.parameters).map_err(failed)?;
    fs::write(args.out.join("parameters.json"), parameters + "\n")?;
    fs::write(args.out.join("table.md"), table(&selection, &test))?;
    for curve in &selection.curves {
        let path = args.out.join(format!("roc-{}.svg", curve.parameter));
        write_roc(&path, curve).map_err(failed)?;
    }
    let report = json!({
        "seed": args.seed,
        "test_seed": args.seed + 1,
        "images": args.count,
        "parameters": selection.parameters,
        "curves": selection.curves,
        "test": test.row(None),
    });
    if args.json {
        writeln!(out, "{report}")?;
    } else {
        write!(out, "{}", table(&selection, &test))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the curves and the results on the test split as Markdown.
fn table(selection: &Selection, test: &Evaluation) -> String {
    let mut text = String::from(
        "| parameter | value | correct / present | false / detections | |\n| --- | --- | --- | --- | --- |\n",
    );
    for curve in &selection.curves {
        for point in &curve.roc.points {
            let mark = match point.value {
                value if value == curve.selected => "selected",
                value if value == curve.equal_error => "equal error",
                _ => "",
            };
            let counts = &point.counts;
            let (parameter, value) = (curve.parameter, point.value);
            let _ = writeln!(
                text,
                "| {parameter} | {value} | {}/{} | {}/{} | {mark} |",
                counts.correct, counts.targets, counts.false_detections, counts.detections
            );
        }
    }
    text.push_str(
        "\n| test split | correct / present | false / detections |\n| --- | --- | --- |\n",
    );
    let classes = [
        ("sift", Some(ObjectClass::Sift)),
        ("circles", Some(ObjectClass::Circles)),
        ("polygons", Some(ObjectClass::Polygons)),
        ("all", None),
    ];
    for (name, class) in classes {
        let counts = test.counts(class);
        let _ = writeln!(
            text,
            "| {name} | {}/{} | {}/{} |",
            counts.correct, counts.targets, counts.false_detections, counts.detections
        );
    }
    text
}
