//! Images with the outlines of what was found.

use std::path::Path;

use opencv::core::{Point, Scalar, Vector};
use opencv::{imgcodecs, imgproc};

use crate::{Detection, Image, Result, Shape, VisionError, mat};

/// Writes an image with the outline and the label of each detection; the suffix of the path determines the format.
///
/// Errors: [`VisionError::OpenCv`], [`VisionError::Unsuitable`] if the file is not written.
pub fn write_overlay(path: &Path, image: &Image, detections: &[Detection]) -> Result<()> {
    let written = draw(path, image, detections)?;
    if written {
        return Ok(());
    }
    Err(VisionError::Unsuitable {
        what: format!("result image {}", path.display()),
        expected: "a writable path that ends in .png or .jpg".to_owned(),
        actual: "OpenCV wrote nothing".to_owned(),
    })
}

fn draw(path: &Path, image: &Image, detections: &[Detection]) -> Result<bool> {
    let mut canvas = mat::of_image(&image.to_rgb()?)?;
    let failed = || VisionError::cv("draw a result image");
    for detection in detections {
        let colour = match detection.shape {
            Shape::Textured { .. } => Scalar::new(0.0, 255.0, 0.0, 0.0),
            Shape::Cylinder { .. } => Scalar::new(255.0, 0.0, 255.0, 0.0),
            Shape::Polygon(_) => Scalar::new(0.0, 255.0, 255.0, 0.0),
        };
        let point = |[x, y]: [f64; 2]| Point::new(x.round() as i32, y.round() as i32);
        let outline: Vector<Point> = detection.contour.iter().copied().map(point).collect();
        imgproc::polylines(&mut canvas, &outline, true, colour, 2, imgproc::LINE_AA, 0)
            .map_err(failed())?;
        imgproc::put_text_def(
            &mut canvas,
            detection.shape.label(),
            point(detection.centre),
            imgproc::FONT_HERSHEY_SIMPLEX,
            0.5,
            colour,
        )
        .map_err(failed())?;
    }
    imgcodecs::imwrite_def(path, &canvas).map_err(failed())
}
