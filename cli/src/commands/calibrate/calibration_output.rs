//! The result of a hand-eye calibration as text and as JSON.

use std::io::Write;

use serde_json::{Value, json};
use yarp_vision::calibration::{
    Calibration, CalibrationFile, ErrorReport, PoseErrors, write_figure,
};
use yarp_vision::{Image, Intrinsics, Pose};

use super::{Args, failed};
use crate::error::Result;

/// Largest back-projection error that is a success by default, mm RMS.
pub(super) const TARGET: f64 = 1.5;

pub(super) fn intrinsics(intrinsics: &Intrinsics) -> Value {
    let ([fx, fy], [cx, cy]) = (intrinsics.focal, intrinsics.centre);
    json!({
        "width": intrinsics.size[0],
        "height": intrinsics.size[1],
        "fx": fx, "fy": fy, "cx": cx, "cy": cy,
        "distortion": intrinsics.distortion,
    })
}

/// Adds target and success to a row.
pub(super) fn with_target(mut row: Value, target: f64, passed: bool) -> Value {
    row["target"] = json!(target);
    row["passed"] = json!(passed);
    row
}

/// Returns the rows of a homogeneous matrix.
fn matrix(pose: &Pose) -> Value {
    let matrix = pose.to_homogeneous();
    let rows = matrix
        .row_iter()
        .map(|row| row.iter().copied().collect::<Vec<f64>>());
    json!(rows.collect::<Vec<_>>())
}

fn pose_errors(errors: &PoseErrors) -> Value {
    json!({
        "position_rms_mm": errors.position.rms,
        "position_max_mm": errors.position.max,
        "angle_rms_degrees": errors.angle.rms,
        "angle_max_degrees": errors.angle.max,
    })
}

fn table_8(errors: &ErrorReport) -> Value {
    json!({
        "image_rms_pixels": errors.image_pixels,
        "all_error_in_tool": pose_errors(&errors.in_tool),
        "all_error_in_base": pose_errors(&errors.in_base),
    })
}

/// Returns the JSON object of a calibration.
pub(super) fn row(found: &Calibration) -> Value {
    let mut table_7: Vec<Value> = Vec::new();
    for method in &found.methods {
        let error = method.errors.as_ref().map(|errors| errors.back_projection);
        table_7.push(json!({"method": method.method, "back_projection_rms_mm": error}));
    }
    let error = found.errors.back_projection;
    table_7.push(json!({"method": "joint refinement", "back_projection_rms_mm": error}));
    let rejected = found.rejected.iter();
    let rejected =
        rejected.map(|(name, error)| json!({"image": name, "back_projection_mm": error}));
    let views = found.errors.views.iter().map(|view| {
        json!({
            "image": view.name,
            "back_projection_mm": view.back_projection,
            "image_pixels": view.image_pixels,
        })
    });
    json!({
        "measurement": "hand-eye",
        "used": found.errors.views.len(),
        "rejected": rejected.collect::<Vec<_>>(),
        "back_projection_rms_mm": error,
        "back_projection_rms_pixels": found.errors.pixels,
        "table_7": table_7,
        "table_8": table_8(&found.errors),
        "intrinsics": intrinsics(&found.hand_eye.camera.intrinsics),
        "camera_to_world": matrix(&found.hand_eye.camera.pose),
        "grid_to_hand": matrix(&found.hand_eye.grid_to_hand),
        "per_image": views.collect::<Vec<_>>(),
    })
}

/// Prints the tables for people.
pub(super) fn print(found: &Calibration, out: &mut dyn Write) -> Result<()> {
    writeln!(
        out,
        "Back-projection error (Table 7), RMS over {} images:",
        found.errors.views.len()
    )?;
    for method in &found.methods {
        match &method.errors {
            Some(errors) => {
                writeln!(
                    out,
                    "  {:<18} {:8.2} mm",
                    method.method, errors.back_projection
                )?;
            }
            None => writeln!(out, "  {:<18} no solution", method.method)?,
        }
    }
    let error = found.errors.back_projection;
    writeln!(out, "  {:<18} {error:8.2} mm", "joint refinement")?;
    let errors = &found.errors;
    writeln!(
        out,
        "Errors (Table 8): {:.3} pixels RMS in the image",
        errors.image_pixels
    )?;
    for (name, errors) in [("tool", &errors.in_tool), ("base", &errors.in_base)] {
        writeln!(
            out,
            "  all in the {name}: {:.2} mm RMS, {:.2} mm at most; {:.3} degrees RMS, {:.3} degrees at most",
            errors.position.rms, errors.position.max, errors.angle.rms, errors.angle.max
        )?;
    }
    for (name, error) in &found.rejected {
        match error {
            Some(error) => writeln!(out, "Rejected {name}: {error:.1} mm")?,
            None => writeln!(out, "Rejected {name}: bad image")?,
        }
    }
    Ok(())
}

/// Writes the files that were asked for.
pub(super) fn write_files(args: &Args, found: &Calibration, scene: Option<Image>) -> Result<()> {
    if let Some(path) = &args.output {
        let file = CalibrationFile {
            intrinsics: found.hand_eye.camera.intrinsics,
            pattern: found.pattern,
            image_rms: found.errors.image_pixels,
            transforms: Some((found.hand_eye.camera.pose, found.hand_eye.grid_to_hand)),
            back_projection_rms: Some(found.errors.back_projection),
            scene,
        };
        file.write(path).map_err(failed)?;
    }
    if let Some(path) = &args.figure {
        write_figure(path, &found.errors).map_err(failed)?;
    }
    Ok(())
}
