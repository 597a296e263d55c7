//! Intrinsic parameters from image files.

use std::io::Write;
use std::process::ExitCode;

use serde_json::{Value, json};
use yarp_vision::calibration::{
    CalibrationError, CalibrationFile, IntrinsicsEstimate, MIN_IMAGES, calibrate_intrinsics, detect,
};

use super::{Args, calibration_output, failed};
use crate::commands::code;
use crate::error::Result;

/// Largest RMS that is a success by default, pixels.
const TARGET: f64 = 0.25;

pub(super) fn run(args: &Args, out: &mut dyn Write) -> Result<ExitCode> {
    let pattern = args.pattern()?;
    let (mut names, mut corners, mut not_found) = (Vec::new(), Vec::new(), Vec::new());
    let mut size: Option<[usize; 2]> = None;
    for path in &args.images {
        let name = path.display().to_string();
        let image = yarp_devices::image::image_file::read(path).map_err(failed)?;
        let found = match detect(&image, &pattern, &name) {
            Ok(found) => found.corners,
            Err(CalibrationError::NoPattern { .. } | CalibrationError::Covered { .. }) => {
                not_found.push(name);
                continue;
            }
            Err(error) => return Err(failed(error)),
        };
        let (width, height) = (image.width(), image.height());
        let [expected_width, expected_height] = *size.get_or_insert([width, height]);
        if (width, height) != (expected_width, expected_height) {
            return Err(failed(CalibrationError::Size {
                image: name,
                width,
                height,
                expected_width,
                expected_height,
            }));
        }
        names.push(name);
        corners.push(found);
    }
    let given = args.images.len();
    let Some(size) = size.filter(|_| names.len() >= MIN_IMAGES) else {
        return Err(failed(CalibrationError::TooFewImages {
            usable: names.len(),
            given,
            expected: MIN_IMAGES,
        }));
    };
    let all: Vec<&[[f64; 2]]> = corners.iter().map(Vec::as_slice).collect();
    let found = calibrate_intrinsics(&pattern, size, &all).map_err(failed)?;
    if let Some(path) = &args.output {
        let file = CalibrationFile {
            intrinsics: found.intrinsics,
            pattern,
            image_rms: found.rms,
            transforms: None,
            back_projection_rms: None,
            scene: None,
        };
        file.write(path).map_err(failed)?;
    }
    let target = args.target.unwrap_or(TARGET);
    let passed = found.rms <= target;
    if args.json {
        let row = row(&found, &names, &not_found, given);
        let row = calibration_output::with_target(row, target, passed);
        writeln!(out, "{row}")?;
    } else {
        print(&found, &names, &not_found, out)?;
    }
    Ok(code(passed))
}

fn row(found: &IntrinsicsEstimate, names: &[String], not_found: &[String], given: usize) -> Value {
    let named = |list: &[(usize, f64)]| -> Vec<Value> {
        let entry =
            |(index, rms): &(usize, f64)| json!({"image": names[*index], "rms_pixels": rms});
        list.iter().map(entry).collect()
    };
    json!({
        "measurement": "intrinsics",
        "images": given,
        "boards_found": names.len(),
        "used": found.used.len(),
        "rms_pixels": found.rms,
        "rms": found.rms,
        "intrinsics": calibration_output::intrinsics(&found.intrinsics),
        "standard_deviations": found.deviations,
        "per_image": named(&found.used),
        "rejected": named(&found.rejected),
        "not_found": not_found,
    })
}

fn print(
    found: &IntrinsicsEstimate,
    names: &[String],
    not_found: &[String],
    out: &mut dyn Write,
) -> Result<()> {
    let intrinsics = &found.intrinsics;
    let ([fx, fy], [cx, cy]) = (intrinsics.focal, intrinsics.centre);
    writeln!(
        out,
        "RMS {:.4} pixels over {} images",
        found.rms,
        found.used.len()
    )?;
    writeln!(
        out,
        "focal length {fx:.2} {fy:.2}, principal point {cx:.2} {cy:.2} pixels"
    )?;
    let terms = intrinsics.distortion.map(|term| format!("{term:.5}"));
    writeln!(out, "distortion k1 k2 p1 p2 k3: {}", terms.join(" "))?;
    for (index, rms) in &found.used {
        writeln!(out, "  {}: {rms:.3}", names[*index])?;
    }
    for (index, rms) in &found.rejected {
        writeln!(out, "  {}: rejected, {rms:.3}", names[*index])?;
    }
    for name in not_found {
        writeln!(out, "  {name}: no chessboard found")?;
    }
    Ok(())
}
