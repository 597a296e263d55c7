//! `yarp vision servo`: visual servoing on simulated tables against open loop.

use std::io::Write;
use std::process::ExitCode;

use serde_json::{Value, json};
use yarp_vision::simulated::{ServoTrialOptions, servo_trial};

use super::failed;
use crate::commands::{code, quantile};
use crate::error::Result;

/// Largest median of the distances after visual servoing, m.
const TARGET: f64 = 0.002;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Seed of scenes and calibration errors
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of trials
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    count: u64,
    /// Error of the camera's position in the calibration, mm
    #[arg(long, value_name = "MM", default_value_t = 5.0)]
    position_error: f64,
    /// Error of the camera's direction in the calibration, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 0.5)]
    angle_error: f64,
    /// Images per second
    #[arg(long, value_name = "HZ", default_value_t = 10.0)]
    rate: f64,
    /// Print one line of JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    for (name, value, [low, high]) in [
        ("--position-error", args.position_error, [0.0, 20.0]),
        ("--angle-error", args.angle_error, [0.0, 3.0]),
        ("--rate", args.rate, [1.0, 60.0]),
    ] {
        if !(low..=high).contains(&value) {
            return Err(failed(yarp_vision::VisionError::Unsuitable {
                what: name.to_owned(),
                expected: format!("{low} to {high}"),
                actual: value.to_string(),
            }));
        }
    }
    let options = ServoTrialOptions {
        position_error: args.position_error * 1e-3,
        angle_error: args.angle_error.to_radians(),
        rate: args.rate,
        ..ServoTrialOptions::default()
    };
    let (mut open, mut closed, mut seconds) = (Vec::new(), Vec::new(), Vec::new());
    let mut problems = Vec::new();
    for index in 0..args.count {
        let trial = match servo_trial(args.seed, index, &options) {
            Ok(trial) => trial,
            Err(error) => {
                problems.push(format!("{index}: {error}"));
                continue;
            }
        };
        open.push(trial.open_loop);
        closed.push(trial.closed_loop);
        seconds.push(trial.seconds);
        if let Err(error) = trial.servoed {
            problems.push(format!("{index}: {error}"));
        }
    }
    let (open, closed) = (row(&open), row(&closed));
    let arrived = args.count - problems.len() as u64;
    let passed = arrived == args.count
        && closed["median_mm"]
            .as_f64()
            .is_some_and(|median| median <= TARGET * 1e3)
        && closed["max_mm"].as_f64() < open["max_mm"].as_f64();
    let report = json!({
        "seed": args.seed,
        "count": args.count,
        "position_error_mm": args.position_error,
        "angle_error_degrees": args.angle_error,
        "images_per_second": args.rate,
        "open_loop": open,
        "servoing": closed,
        "arrived": arrived,
        "seconds": quantile(&seconds, 0.5),
        "problems": problems,
        "target_median_mm": TARGET * 1e3,
        "passed": passed,
    });
    if args.json {
        writeln!(out, "{report}")?;
    } else {
        write!(out, "{}", table(&report))?;
    }
    Ok(code(passed))
}

/// Returns the results of one way as JSON; `null` without any.
fn row(errors: &[[f64; 2]]) -> Value {
    let column = |index: usize, factor: f64| -> Vec<f64> {
        errors.iter().map(|error| error[index] * factor).collect()
    };
    let (distance, angle) = (column(0, 1e3), column(1, 1.0_f64.to_degrees()));
    json!({
        "median_mm": quantile(&distance, 0.5),
        "max_mm": quantile(&distance, 1.0),
        "median_degrees": quantile(&angle, 0.5),
        "max_degrees": quantile(&angle, 1.0),
    })
}

fn table(report: &Value) -> String {
    let mut text = String::from(
        "| | median, mm | largest, mm | median, degrees | largest, degrees |\n| --- | --- | --- | --- | --- |\n",
    );
    for (name, title) in [("open_loop", "open loop"), ("servoing", "visual servoing")] {
        let cell = |field: &str| match report[name][field].as_f64() {
            Some(value) => format!("{value:.2}"),
            None => "-".to_owned(),
        };
        text.push_str(&format!(
            "| {title} | {} | {} | {} | {} |\n",
            cell("median_mm"),
            cell("max_mm"),
            cell("median_degrees"),
            cell("max_degrees")
        ));
    }
    text.push_str(&format!(
        "arrived: {} of {}\n",
        report["arrived"], report["count"]
    ));
    for problem in report["problems"].as_array().into_iter().flatten() {
        text.push_str(&format!("{}\n", problem.as_str().unwrap_or_default()));
    }
    text
}
