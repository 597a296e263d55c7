//! `yarp calibrate`: intrinsic parameters of a camera, and its pose relative to an arm.

mod calibrated_robot;
mod calibration_output;
mod images;
#[cfg(all(unix, feature = "table"))]
mod simulated;

use std::error::Error;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use yarp_vision::calibration::{CalibrationError, Pattern};

use crate::error::{Failure, Result};
use crate::stock_log;

/// calibrate a camera, and its pose relative to an arm that holds a chessboard
///
/// With --images, estimates the intrinsic parameters from images of a chessboard. Otherwise moves an arm that holds a
/// chessboard to postures that it chooses, takes an image at each, and solves for camera, pose of the camera, and pose of
/// the chessboard in the hand. --simulated does this with a simulated table and compares with the truth.
///
/// Exit code 1: an error is larger than the target.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Images of a chessboard; estimates the intrinsic parameters only
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "simulated")]
    images: Vec<PathBuf>,
    /// Simulate table, arm and camera
    #[arg(long)]
    simulated: bool,
    /// Inner corners of the chessboard
    #[arg(long, value_name = "COLUMNSxROWS", default_value = "9x6")]
    pattern: Pattern,
    /// Side of a square, mm
    #[arg(long, value_name = "MM", default_value_t = 20.0)]
    square: f64,
    /// Number of images to take
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u16).range(6..=500))]
    count: u16,
    /// Seed of postures, noise and simulation
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Port of the arm
    #[arg(long, value_name = "PORT", default_value = "/wam")]
    arm: String,
    /// Port of the camera
    #[arg(long, value_name = "PORT", default_value = "/camera")]
    camera: String,
    /// File with guesses of camera and pattern pose (Hcam2world, Hgrid2hand); the usual ones without
    #[arg(long, value_name = "FILE")]
    guess: Option<PathBuf>,
    /// Largest RMS that is a success: pixels with --images (0.25), otherwise mm (1.5)
    #[arg(long, value_name = "NUMBER")]
    target: Option<f64>,
    /// Standard deviation of the noise added to corners, pixels; with --simulated
    #[arg(long, value_name = "PIXELS", default_value_t = 0.3)]
    pixel_noise: f64,
    /// RMS error of the arm's position, mm; with --simulated
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    position_error: f64,
    /// RMS error of the arm's orientation, degrees; with --simulated
    #[arg(long, value_name = "DEGREES", default_value_t = 0.1)]
    angle_error: f64,
    /// Write the calibration, .yml or .xml as OpenCV
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write the errors of all corners as a figure, .svg
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Args {
    fn pattern(&self) -> Result<Pattern> {
        self.pattern.with_square(self.square * 1e-3).map_err(failed)
    }
}

fn failed(error: impl Error + Send + Sync + 'static) -> Failure {
    Failure::Vision(error.into())
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    if args.json {
        stock_log::keep_apart();
    }
    for (name, value) in [
        ("pixel-noise", args.pixel_noise),
        ("position-error", args.position_error),
        ("angle-error", args.angle_error),
        ("target", args.target.unwrap_or_default()),
    ] {
        if !(0.0..=1000.0).contains(&value) {
            let problem = format!("expected a number of 0 to 1000, got {value}");
            let path = PathBuf::from(format!("--{name}"));
            return Err(failed(CalibrationError::File { path, problem }));
        }
    }
    if !args.images.is_empty() {
        return images::run(&args, out);
    }
    #[cfg(all(unix, feature = "table"))]
    if args.simulated {
        return simulated::run(args, out).await;
    }
    #[cfg(not(all(unix, feature = "table")))]
    if args.simulated {
        let path = PathBuf::from("--simulated");
        let problem = "this program was built without the feature `table`".to_owned();
        return Err(failed(CalibrationError::File { path, problem }));
    }
    calibrated_robot::run(args, out).await
}
