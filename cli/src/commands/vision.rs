//! `yarp vision`: object recognition in image files.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use serde_json::json;
use yarp_devices::image::image_file;
use yarp_vision::{ModelDatabase, Recogniser, RecogniserParameters, write_overlay};

use crate::error::{Failure, Result};

/// find objects in images
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Find printed objects, circles and polygons in an image; exits with 1 if there are none
    Detect {
        /// Image: PNG, JPEG, PPM or PGM
        image: PathBuf,
        /// Folder of reference images of printed objects, one each
        #[arg(long, value_name = "DIR")]
        models: Option<PathBuf>,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// Longer side of the image that printed objects are searched in, pixels; larger images are scaled down
        #[arg(long, value_name = "PIXELS", default_value_t = 800)]
        sift_side: usize,
        /// Smallest radius of circles, pixels
        #[arg(long, value_name = "PIXELS")]
        min_radius: Option<f64>,
        /// Shortest side of polygons, pixels
        #[arg(long, value_name = "PIXELS")]
        min_side: Option<f64>,
        /// Write the image with what was found
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
}

fn failed(error: impl std::error::Error + Send + Sync + 'static) -> Failure {
    Failure::Vision(error.into())
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let Action::Detect {
        image: path,
        models,
        json,
        sift_side,
        min_radius,
        min_side,
        out: overlay,
    } = args.action;
    let image = image_file::read(&path)?;
    let models = match models {
        Some(folder) => ModelDatabase::read(&folder).map_err(failed)?,
        None => ModelDatabase::empty(),
    };
    let mut parameters = RecogniserParameters::default();
    parameters.sift.max_side = sift_side;
    if let Some(radius) = min_radius {
        parameters.circles.radius[0] = radius;
    }
    if let Some(side) = min_side {
        parameters.polygons.min_side = side;
        parameters.polygons.area[0] = side * side / 2.0;
    }
    let mut recogniser = Recogniser::new(models, parameters);
    let start = Instant::now();
    let found = recogniser.detect(&image).map_err(failed)?;
    let milliseconds = start.elapsed().as_secs_f64() * 1e3;
    if let Some(path) = overlay {
        write_overlay(&path, &image, &found).map_err(failed)?;
    }
    if json {
        let objects: Vec<_> = found
            .iter()
            .map(|object| {
                json!({
                    "label": object.shape.label(),
                    "score": object.score,
                    "centre": object.centre,
                    "contour": object.contour,
                    "shape": object.shape,
                })
            })
            .collect();
        let report = json!({
            "image": path.display().to_string(),
            "milliseconds": milliseconds,
            "objects": objects,
        });
        writeln!(out, "{report}")?;
    } else {
        for object in &found {
            let [x, y] = object.centre;
            let label = object.shape.label();
            writeln!(
                out,
                "{label} at ({x:.1}, {y:.1}), score {:.2}",
                object.score
            )?;
        }
    }
    Ok(super::code(!found.is_empty()))
}
