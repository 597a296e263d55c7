//! `yarp table render`: images of random tables as files.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use serde_json::json;
use yarp_table::{
    Class, Dataset, DatasetOptions, write_calibrations, write_depth, write_models, write_shot,
};

use super::failed;
use crate::commands::code;
use crate::error::Result;

/// Largest median time of rendering an image on two cores, ms.
const MAX_MILLISECONDS: f64 = 100.0;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Number of images
    #[arg(long, default_value_t = 1)]
    count: u64,
    /// Seed of the set
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder to write to: 000000.png, 000000.xml, ...
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Most objects on an image
    #[arg(long, value_name = "COUNT")]
    objects: Option<usize>,
    /// Only objects of this class; may be given several times
    #[arg(long = "class", value_name = "CLASS", value_parser = class)]
    classes: Vec<Class>,
    /// Write the prints of the cartons too, into DIR/models
    #[arg(long)]
    models: bool,
    /// Write depth images too, 000000-depth.png, and the calibrations of both cameras, camera.yml and depth-camera.yml
    #[arg(long)]
    depth: bool,
    /// Print the time per image as one line of JSON; exits with 1 if the median is above 100 ms
    #[arg(long)]
    json: bool,
}

fn class(word: &str) -> std::result::Result<Class, String> {
    let words: Vec<_> = Class::ALL.map(Class::word).to_vec();
    Class::from_word(word).ok_or_else(|| format!("expected one of {}", words.join(", ")))
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut options = DatasetOptions::default();
    options.placement.count = args.objects.unwrap_or(options.placement.count);
    if !args.classes.is_empty() {
        options.placement.classes.clone_from(&args.classes);
    }
    let dataset = Dataset::new(args.seed, options);
    let directory = &args.out;
    fs::create_dir_all(directory).map_err(failed)?;
    let mut times = Vec::new();
    for index in 0..args.count {
        let start = Instant::now();
        let shot = dataset.shot(index).map_err(failed)?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
        let name = format!("{index:06}");
        write_shot(directory, &name, &shot).map_err(failed)?;
        if args.depth {
            let depth = dataset.depth(index).map_err(failed)?;
            write_depth(directory, &name, &depth).map_err(failed)?;
        }
    }
    if args.depth {
        write_calibrations(directory).map_err(failed)?;
    }
    if args.models {
        write_prints(directory)?;
    }
    if args.json {
        return report(&args, times, out);
    }
    writeln!(out, "{} images in {}", args.count, directory.display())?;
    Ok(ExitCode::SUCCESS)
}

fn write_prints(directory: &Path) -> Result<()> {
    let models = directory.join("models");
    fs::create_dir_all(&models).map_err(failed)?;
    write_models(&models).map_err(failed)
}

/// Prints the times of rendering, without writing files; the first images also draw the textures.
fn report(args: &Args, mut times: Vec<f64>, out: &mut dyn Write) -> Result<ExitCode> {
    times.sort_by(f64::total_cmp);
    let median = times.get(times.len() / 2).copied().unwrap_or(0.0);
    let passed = median <= MAX_MILLISECONDS;
    let report = json!({
        "seed": args.seed,
        "images": args.count,
        "out": args.out.display().to_string(),
        "rendering_ms": {
            "p50": median, "max": times.last().copied().unwrap_or(0.0),
            "target_p50": MAX_MILLISECONDS, "passed": passed,
        },
        "passed": passed,
    });
    writeln!(out, "{report}")?;
    Ok(code(passed))
}
