//! Automatic selection of parameters: a ROC curve over each on training scenes (section 6.5.2 of the thesis).

use serde::Serialize;

use super::{Evaluation, SimulatedScene};
use crate::evaluation::{Counts, Roc};
use crate::{Detector, DetectorParameters, Result};

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
