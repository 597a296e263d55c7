//! Automatic selection of parameters: a ROC curve over each on training scenes (section 6.5.2 of the thesis).

use std::path::Path;

use plotters::prelude::*;
use serde::Serialize;

use super::{Evaluation, SimulatedScene};
use crate::evaluation::{Counts, Roc};
use crate::{Detector, DetectorParameters, Result, VisionError};

/// Largest share of false detections of a selected value.
const MAX_FALSE_SHARE: f64 = 0.01;

/// ROC curve over one parameter, and the selected value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterCurve {
    /// Name of the parameter.
    pub parameter: &'static str,
    /// Points of the curve.
    pub roc: Roc,
    /// Value at the equal-error point.
    pub equal_error: f64,
    /// Selected value: most correct detections among those with at most 1 % false ones, near the middle of equals.
    pub selected: f64,
}

/// Selected parameters with the curves behind them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Selection {
    /// Parameters.
    pub parameters: DetectorParameters,
    /// One curve per parameter, in the order of selection.
    pub curves: Vec<ParameterCurve>,
}

type Setter = fn(&mut DetectorParameters, f64);

const CANDIDATES: [(&str, &[f64], Setter); 5] = [
    (
        "min_fill",
        &[0.7, 0.75, 0.8, 0.85, 0.9, 0.95],
        |parameters, value| parameters.min_fill = value,
    ),
    (
        "min_support",
        &[0.0, 0.15, 0.3, 0.45, 0.6, 0.75],
        |parameters, value| parameters.min_support = value,
    ),
    (
        "gradient",
        &[1.0, 1.5, 2.0, 3.0, 5.0],
        |parameters, value| parameters.gradient = value,
    ),
    (
        "ratio",
        &[0.65, 0.7, 0.75, 0.8, 0.85, 0.9],
        |parameters, value| parameters.ratio = value,
    ),
    (
        "min_inliers",
        &[4.0, 6.0, 8.0, 10.0, 12.0, 16.0, 24.0],
        |parameters, value| parameters.min_inliers = value as usize,
    ),
];

/// Selects one parameter after the other on training scenes, each with the values selected before.
///
/// Errors: those of [`Detector::detect`].
pub fn select(detector: &mut Detector, scenes: &[SimulatedScene]) -> Result<Selection> {
    let mut parameters = detector.parameters().clone();
    let mut curves = Vec::new();
    for (name, values, set) in CANDIDATES {
        let roc = Roc::over(values, |value| {
            let mut tried = parameters.clone();
            set(&mut tried, value);
            detector.set_parameters(tried);
            counts(detector, scenes)
        })?;
        let selected = middle_of_best(&roc);
        set(&mut parameters, selected);
        curves.push(ParameterCurve {
            parameter: name,
            equal_error: roc.equal_error().map_or(selected, |point| point.value),
            roc,
            selected,
        });
    }
    detector.set_parameters(parameters.clone());
    Ok(Selection { parameters, curves })
}

fn counts(detector: &mut Detector, scenes: &[SimulatedScene]) -> Result<Counts> {
    let mut evaluation = Evaluation::default();
    for scene in scenes {
        let found = detector.detect(&scene.image, Some(&scene.depth))?;
        evaluation.add("", &scene.truth, &found, 0.0);
    }
    Ok(evaluation.counts(None))
}

/// Returns the middle one of the values that are as good as the best.
fn middle_of_best(roc: &Roc) -> f64 {
    let Some(best) = roc.best(MAX_FALSE_SHARE) else {
        return 0.0;
    };
    let equal: Vec<f64> = roc
        .points
        .iter()
        .filter(|point| point.counts == best.counts)
        .map(|point| point.value)
        .collect();
    equal[equal.len() / 2]
}

/// Writes a ROC curve as SVG: correct / present against false / detections, each point with its value.
///
/// Errors: [`VisionError::File`].
pub fn write_roc(path: &Path, curve: &ParameterCurve) -> Result<()> {
    draw(path, curve).map_err(|error| {
        VisionError::file("draw a ROC curve", path)(std::io::Error::other(error.to_string()))
    })
}

fn draw(path: &Path, curve: &ParameterCurve) -> Result<(), Box<dyn std::error::Error>> {
    let points: Vec<(f64, f64, f64)> = curve
        .roc
        .points
        .iter()
        .map(|point| {
            (
                point.counts.false_share(),
                point.counts.recall(),
                point.value,
            )
        })
        .collect();
    let right = points.iter().map(|point| point.0).fold(0.05, f64::max) * 1.1;
    let bottom = points.iter().map(|point| point.1).fold(0.9, f64::min) - 0.02;
    let root = SVGBackend::new(path, (640, 480)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(curve.parameter, ("sans-serif", 20))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(50)
        .build_cartesian_2d(0.0..right, bottom.max(0.0)..1.0)?;
    chart
        .configure_mesh()
        .x_desc("false detections / detections")
        .y_desc("correct detections / present objects")
        .draw()?;
    let line: Vec<(f64, f64)> = points.iter().map(|point| (point.0, point.1)).collect();
    chart.draw_series([PathElement::new(line, BLUE)])?;
    chart.draw_series(points.iter().map(|(x, y, value)| {
        let style = if *value == curve.selected {
            RED.filled()
        } else {
            BLUE.filled()
        };
        Circle::new((*x, *y), 4, style)
    }))?;
    chart.draw_series(
        points
            .iter()
            .map(|(x, y, value)| Text::new(format!("{value}"), (*x, *y), ("sans-serif", 12))),
    )?;
    root.present()?;
    Ok(())
}
