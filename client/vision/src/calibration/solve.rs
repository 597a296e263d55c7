//! From views of a pattern to a calibration, unattended.

use super::calibration_report::{ErrorReport, measure};
use super::hand_eye::{MIN_VIEWS, Method, solve};
use super::intrinsic_calibration::{IntrinsicsEstimate, calibrate_intrinsics, pattern_pose, worst};
use super::postures::Random;
use super::refinement::refine;
use super::{Accuracy, CalibrationError, HandEye, Pattern, Result, View};
use crate::{Intrinsics, Pose};

/// Back-projection error below which no view is rejected, in mm: an arm of this accuracy is a good one.
const ALWAYS_ACCEPTED: f64 = 3.0;

/// Number of subsets of views that are solved for a start, and their size: with a third of the views bad, one of 60 subsets of
/// five is good with a probability of 0.9998.
const SUBSETS: usize = 60;
const SUBSET: usize = 5;
/// Multiple of the median error of the start above which a view is rejected at once.
const OUTLIER_FACTOR: f64 = 5.0;

/// Options of a calibration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SolveOptions {
    /// Standard deviations of pixels and arm.
    pub accuracy: Accuracy,
    /// Known intrinsic parameters, which stay (the thesis's *two steps*); `None` estimates them from the views (*single*).
    pub intrinsics: Option<Intrinsics>,
}

/// A solution, and its errors.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodErrors {
    /// Name of the method.
    pub method: &'static str,
    /// Errors on the views used; `None` if the method found no solution.
    pub errors: Option<ErrorReport>,
}

/// A calibration with all its reports.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The transforms and the lens.
    pub hand_eye: HandEye,
    /// The pattern.
    pub pattern: Pattern,
    /// The estimate of the intrinsic parameters before the refinement; `None` if they were given.
    pub intrinsics: Option<IntrinsicsEstimate>,
    /// Errors on the views used.
    pub errors: ErrorReport,
    /// Errors of each closed form on the same views (Table 7).
    pub methods: Vec<MethodErrors>,
    /// Name and back-projection error, in mm, of the rejected views; no number for those with a bad image.
    pub rejected: Vec<(String, Option<f64>)>,
}

/// Calibrates camera, pattern pose and, unless given, the intrinsic parameters from views of the pattern in the hand.
///
/// Bad images are rejected by their error in the image, then views by their back-projection error: worst first, while it is
/// more than 2.5 times the median and more than 3 mm.
///
/// Errors: [`CalibrationError::TooFewImages`], [`CalibrationError::Degenerate`], [`CalibrationError::NotConverged`],
/// [`CalibrationError::OpenCv`].
pub fn calibrate(
    pattern: &Pattern,
    size: [usize; 2],
    views: &[View],
    options: &SolveOptions,
) -> Result<Calibration> {
    let mut rejected = Vec::new();
    let mut used = views.to_vec();
    let (estimate, intrinsics) = match options.intrinsics {
        Some(known) => (None, known),
        None => {
            let corners: Vec<&[[f64; 2]]> = used.iter().map(|v| v.corners.as_slice()).collect();
            let estimate = calibrate_intrinsics(pattern, size, &corners)?;
            used = estimate
                .used
                .iter()
                .map(|(index, _)| views[*index].clone())
                .collect();
            let bad = estimate.rejected.iter();
            rejected.extend(bad.map(|(index, _)| (views[*index].name.clone(), None)));
            let intrinsics = estimate.intrinsics;
            (Some(estimate), intrinsics)
        }
    };
    reject_outliers(pattern, &intrinsics, &mut used, &mut rejected)?;
    loop {
        let grids = grids(pattern, &intrinsics, &used)?;
        let (methods, first) = first_solution(pattern, &intrinsics, &used, &grids)?;
        let free = estimate.is_some();
        let hand_eye = refine(&first, pattern, &used, &options.accuracy, free)?;
        let grids = self::grids(pattern, &hand_eye.camera.intrinsics, &used)?;
        let errors = measure(&hand_eye, pattern, &used, &grids);
        let sizes: Vec<f64> = errors
            .views
            .iter()
            .map(|view| view.back_projection)
            .collect();
        let bad = worst(&sizes).filter(|place| sizes[*place] > ALWAYS_ACCEPTED);
        let Some(place) = bad else {
            return Ok(Calibration {
                hand_eye,
                pattern: *pattern,
                intrinsics: estimate,
                errors,
                methods,
                rejected,
            });
        };
        rejected.push((used.remove(place).name, Some(sizes[place])));
        if used.len() < MIN_VIEWS {
            return Err(CalibrationError::TooFewImages {
                usable: used.len(),
                given: views.len(),
                expected: MIN_VIEWS,
            });
        }
    }
}

/// Rejects views that contradict what most views agree on, such as those with turned corners, which spoil every closed form.
fn reject_outliers(
    pattern: &Pattern,
    intrinsics: &Intrinsics,
    used: &mut Vec<View>,
    rejected: &mut Vec<(String, Option<f64>)>,
) -> Result<()> {
    let grids = grids(pattern, intrinsics, used)?;
    let mut random = Random::new(0);
    let mut best: Option<(f64, Vec<f64>)> = None;
    for _ in 0..SUBSETS {
        let mut order: Vec<usize> = (0..used.len()).collect();
        for place in 0..SUBSET.min(order.len()) {
            let other = random.between(place as f64, order.len() as f64) as usize;
            order.swap(place, other.min(used.len() - 1));
        }
        order.truncate(SUBSET);
        let views: Vec<View> = order.iter().map(|index| used[*index].clone()).collect();
        let poses: Vec<Pose> = order.iter().map(|index| grids[*index]).collect();
        let Ok(found) = solve(Method::Park, intrinsics, &views, &poses) else {
            continue;
        };
        let errors = measure(&found, pattern, used, &grids).views;
        let errors: Vec<f64> = errors.iter().map(|view| view.back_projection).collect();
        let mut ordered = errors.clone();
        ordered.sort_by(f64::total_cmp);
        let median = ordered[ordered.len() / 2];
        if best.as_ref().is_none_or(|(smallest, _)| median < *smallest) {
            best = Some((median, errors));
        }
    }
    // Without any solution the closed forms say why.
    let Some((median, errors)) = best else {
        return Ok(());
    };
    let limit = (OUTLIER_FACTOR * median).max(ALWAYS_ACCEPTED * OUTLIER_FACTOR);
    let mut place = 0;
    used.retain(|view| {
        let error = errors[place];
        place += 1;
        // An error that is no number is none that may stay.
        let stays = error <= limit;
        if !stays {
            rejected.push((view.name.clone(), Some(error)));
        }
        stays
    });
    Ok(())
}

/// Returns the pose of the pattern of each view, fitted to its image.
///
/// Errors: [`CalibrationError::OpenCv`].
pub fn grids(pattern: &Pattern, intrinsics: &Intrinsics, views: &[View]) -> Result<Vec<Pose>> {
    let pose = |view: &View| pattern_pose(pattern, intrinsics, &view.corners);
    views.iter().map(pose).collect()
}

/// Solves with every closed form; returns their errors and the best of them.
fn first_solution(
    pattern: &Pattern,
    intrinsics: &Intrinsics,
    views: &[View],
    grids: &[Pose],
) -> Result<(Vec<MethodErrors>, HandEye)> {
    let mut methods = Vec::new();
    let mut best: Option<(f64, HandEye)> = None;
    let mut last = CalibrationError::NotConverged { iterations: 0 };
    for method in Method::ALL {
        let errors = match solve(method, intrinsics, views, grids) {
            Ok(found) => {
                let errors = measure(&found, pattern, views, grids);
                let size = errors.pixels;
                if size.is_finite() && best.is_none_or(|(smallest, _)| size < smallest) {
                    best = Some((size, found));
                }
                Some(errors)
            }
            Err(
                error @ (CalibrationError::Degenerate { .. }
                | CalibrationError::TooFewImages { .. }),
            ) => return Err(error),
            Err(error) => {
                last = error;
                None
            }
        };
        methods.push(MethodErrors {
            method: method.name(),
            errors,
        });
    }
    let (_, first) = best.ok_or(last)?;
    Ok((methods, first))
}
