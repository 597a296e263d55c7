//! The accumulated pixel errors of a calibration as a figure (Figure 33 of the thesis).

use std::path::Path;

use plotters::prelude::*;

use super::{CalibrationError, ErrorReport, Result};

/// Width and height of the figure.
const SIZE: (u32, u32) = (1000, 500);
/// Number of bars of the histogram.
const BARS: usize = 40;
/// Smallest error that the axes show, in pixels.
const MIN_RANGE: f64 = 0.5;

/// Writes an SVG file: left the error of each corner in the image, right a histogram of their lengths.
///
/// Errors: [`CalibrationError::File`].
pub fn write_figure(path: &Path, report: &ErrorReport) -> Result<()> {
    draw(path, report).map_err(|error| CalibrationError::File {
        path: path.to_owned(),
        problem: format!("the figure cannot be written: {error}"),
    })
}

fn draw(path: &Path, report: &ErrorReport) -> Result<(), Box<dyn std::error::Error>> {
    let lengths: Vec<f64> = report
        .image_errors
        .iter()
        .map(|[x, y]| x.hypot(*y))
        .collect();
    let largest = lengths.iter().copied().filter(|value| value.is_finite());
    let range = largest.fold(MIN_RANGE, f64::max) * 1.05;
    let root = SVGBackend::new(path, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let (left, right) = root.split_horizontally(SIZE.0 / 2);
    let mut chart = ChartBuilder::on(&left)
        .caption("Error of each corner, pixels", ("sans-serif", 18))
        .margin(10)
        .x_label_area_size(35)
        .y_label_area_size(45)
        .build_cartesian_2d(-range..range, range..-range)?;
    chart
        .configure_mesh()
        .x_desc("right")
        .y_desc("down")
        .draw()?;
    let dots = report
        .image_errors
        .iter()
        .map(|[x, y]| Circle::new((*x, *y), 1, BLUE.mix(0.5)));
    chart.draw_series(dots)?;
    let mut counts = [0_u32; BARS];
    for length in lengths.iter().filter(|length| length.is_finite()) {
        counts[((length / range * BARS as f64) as usize).min(BARS - 1)] += 1;
    }
    let tallest = counts.iter().copied().max().unwrap_or(0).max(1);
    let title = format!("RMS {:.3} pixels", report.image_pixels);
    let mut chart = ChartBuilder::on(&right)
        .caption(title, ("sans-serif", 18))
        .margin(10)
        .x_label_area_size(35)
        .y_label_area_size(45)
        .build_cartesian_2d(0.0..range, 0..tallest + tallest / 20 + 1)?;
    chart
        .configure_mesh()
        .x_desc("error, pixels")
        .y_desc("corners")
        .draw()?;
    let wide = range / BARS as f64;
    let bars = counts.iter().enumerate().map(|(index, count)| {
        let from = index as f64 * wide;
        Rectangle::new([(from, 0), (from + wide, *count)], BLUE.mix(0.6).filled())
    });
    chart.draw_series(bars)?;
    root.present()?;
    Ok(())
}
