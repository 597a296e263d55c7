//! `yarp vision detect`: objects of an image file.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use serde_json::{Value, json};
use yarp_devices::image::image_file;
use yarp_vision::calibration::CalibrationFile;
use yarp_vision::{
    CameraModel, DepthImage, Detector, DetectorParameters, DetectorSetup, FoundObject,
    ModelDatabase, ObjectDatabase, Recogniser, RecogniserParameters, write_overlay,
};

use super::failed;
use crate::commands::code;
use crate::error::Result;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
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
    /// Depth image of the same moment: PNG of 16 bits, mm; finds objects of the database with their poses
    #[arg(long, value_name = "FILE", requires_all = ["calibration", "depth_calibration", "objects"])]
    depth: Option<PathBuf>,
    /// Calibration of the camera with its pose; of use with --depth
    #[arg(long, value_name = "FILE", requires = "depth")]
    calibration: Option<PathBuf>,
    /// Calibration of the depth sensor with its pose; of use with --depth
    #[arg(long, value_name = "FILE", requires = "depth")]
    depth_calibration: Option<PathBuf>,
    /// Object database, XML; of use with --depth
    #[arg(long, value_name = "FILE", requires = "depth")]
    objects: Option<PathBuf>,
    /// Height of the table's surface in the arm's base frame, m; of use with --depth
    #[arg(long, value_name = "METRES", default_value_t = -0.05, allow_negative_numbers = true)]
    surface: f64,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let image = image_file::read(&args.image)?;
    let start;
    let found = if let Some(path) = &args.depth {
        let depth = DepthImage::read(path).map_err(failed)?;
        let mut detector = detector(&args)?;
        start = Instant::now();
        detector.detect(&image, Some(&depth)).map_err(failed)?
    } else {
        let mut recogniser = recogniser(&args)?;
        start = Instant::now();
        let found = recogniser.detect(&image).map_err(failed)?;
        found.into_iter().map(FoundObject::without_pose).collect()
    };
    let milliseconds = start.elapsed().as_secs_f64() * 1e3;
    if let Some(path) = &args.out {
        let outlines: Vec<_> = found
            .iter()
            .map(|object| object.detection.clone())
            .collect();
        write_overlay(path, &image, &outlines).map_err(failed)?;
    }
    if args.json {
        let objects: Vec<_> = found.iter().map(described).collect();
        let report = json!({
            "image": args.image.display().to_string(),
            "milliseconds": milliseconds,
            "objects": objects,
        });
        writeln!(out, "{report}")?;
    } else {
        for object in &found {
            let [x, y] = object.detection.centre;
            let (kind, score) = (&object.kind, object.detection.score);
            writeln!(out, "{kind} at ({x:.1}, {y:.1}), score {score:.2}")?;
        }
    }
    Ok(code(!found.is_empty()))
}

fn described(object: &FoundObject) -> Value {
    let mut described = json!({
        "label": object.kind,
        "score": object.detection.score,
        "centre": object.detection.centre,
        "contour": object.detection.contour,
        "shape": object.detection.shape,
    });
    if let Some(pose) = &object.pose {
        let place = pose.position;
        described["position"] = json!([place.x, place.y, place.z]);
        described["yaw"] = json!(pose.yaw);
        described["height"] = json!(object.height);
        described["size"] = json!(object.size);
    }
    described
}

/// Returns a detector for images with depth.
fn detector(args: &Args) -> Result<Detector> {
    let camera = |path: &Option<PathBuf>| -> Result<CameraModel> {
        let path = path.as_deref().unwrap_or(Path::new(""));
        let file = CalibrationFile::read(path).map_err(failed)?;
        file.camera(path).map_err(failed)
    };
    let setup = DetectorSetup {
        camera: camera(&args.calibration)?,
        depth: Some(camera(&args.depth_calibration)?),
        surface: args.surface,
    };
    let objects = args.objects.as_deref().unwrap_or(Path::new(""));
    let database = ObjectDatabase::read(objects).map_err(failed)?;
    Detector::new(database, setup, DetectorParameters::default()).map_err(failed)
}

/// Returns a recogniser for images alone.
fn recogniser(args: &Args) -> Result<Recogniser> {
    let models = match &args.models {
        Some(folder) => ModelDatabase::read(folder).map_err(failed)?,
        None => ModelDatabase::empty(),
    };
    let mut parameters = RecogniserParameters::default();
    parameters.sift.max_side = args.sift_side;
    if let Some(radius) = args.min_radius {
        parameters.circles.radius[0] = radius;
    }
    if let Some(side) = args.min_side {
        parameters.polygons.min_side = side;
        parameters.polygons.area[0] = side * side / 2.0;
    }
    Ok(Recogniser::new(models, parameters))
}
