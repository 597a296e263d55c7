//! `yarp vision`: object recognition in image files and of a table's cameras, and its evaluation on simulated tables.

mod detect_objects;
#[cfg(feature = "table")]
mod serve_vision;
#[cfg(feature = "table")]
mod servo_evaluation;
#[cfg(feature = "table")]
mod vision_evaluation;
#[cfg(feature = "table")]
mod vision_selection;

use std::io::Write;
use std::process::ExitCode;

use crate::error::{Failure, Result};

/// find objects in images, and evaluate how well
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Find printed objects, circles and polygons in an image; exits with 1 if there are none
    Detect(detect_objects::Args),
    /// Serve the objects that the cameras of a table see, for other programs; Ctrl-C ends it
    #[cfg(feature = "table")]
    Serve(serve_vision::Args),
    /// Compare detections on random simulated tables with the truth; exits with 1 below the targets
    #[cfg(feature = "table")]
    Evaluate(vision_evaluation::Args),
    /// Select the detector's parameters by ROC curves on training tables, with results on a test split
    #[cfg(feature = "table")]
    Select(vision_selection::Args),
    /// Compare visual servoing on simulated tables with open loop under an error of the calibration; exits with 1 below the target
    #[cfg(feature = "table")]
    Servo(servo_evaluation::Args),
}

fn failed(error: impl std::error::Error + Send + Sync + 'static) -> Failure {
    Failure::Vision(error.into())
}

impl Args {
    /// Returns whether it serves a port.
    pub(super) fn serves(&self) -> bool {
        match self.action {
            #[cfg(feature = "table")]
            Action::Serve(_) => true,
            _ => false,
        }
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    match args.action {
        Action::Detect(args) => detect_objects::run(args, out),
        #[cfg(feature = "table")]
        Action::Serve(args) => serve_vision::run(args, out).await,
        #[cfg(feature = "table")]
        Action::Evaluate(args) => vision_evaluation::run(args, out),
        #[cfg(feature = "table")]
        Action::Select(args) => vision_selection::run(args, out),
        #[cfg(feature = "table")]
        Action::Servo(args) => servo_evaluation::run(args, out),
    }
}
