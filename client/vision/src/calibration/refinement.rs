//! Joint refinement of camera pose, pattern pose, lens and the errors of the arm.
//!
//! Minimises the sum of squares of what was measured, each in units of its standard deviation: the pixels of the
//! corners, and the correction of each measured pose of the hand (Strobl and Hirzinger, *Optimal Hand-Eye Calibration*, 2006:
//! the source of the thesis's error criteria). Without the corrections an arm error of 1 mm, which is two pixels, would pass as
//! an error of the image.

use nalgebra::{DMatrix, DVector, Point3, Vector6};

use super::levenberg_marquardt::{LeastSquares, minimise};
use super::transforms::moved;
use super::{CalibrationError, HandEye, Pattern, Result};
use crate::{Intrinsics, Pose};

/// Maximum number of steps.
const MAX_ITERATIONS: usize = 200;
/// Number of intrinsic parameters.
const INTRINSIC_PARAMETERS: usize = 9;
/// Half the interval of the numerical derivative of a pose: m and rad.
const POSE_INTERVAL: f64 = 1e-6;
/// The same of the lens: pixels, and the dimensionless distortion.
const FOCAL_INTERVAL: f64 = 1e-3;
const DISTORTION_INTERVAL: f64 = 1e-6;

/// A pattern seen by the camera while the hand was at a measured pose.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Name of the image, for errors and reports.
    pub name: String,
    /// Pixels of the corners in the order of [`Pattern::corners`].
    pub corners: Vec<[f64; 2]>,
    /// Measured pose of the hand in the world.
    pub hand_to_world: Pose,
}

/// Standard deviations of what is measured, which weigh one against the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Of each coordinate of a corner, in pixels.
    pub pixels: f64,
    /// Of each coordinate of the hand's position, in m.
    pub position: f64,
    /// Of the hand's orientation about each axis, in rad.
    pub angle: f64,
}

/// 0.3 pixels, 1 mm, 0.1 degrees.
impl Default for Accuracy {
    fn default() -> Self {
        Self {
            pixels: 0.3,
            position: 1e-3,
            angle: 0.1_f64.to_radians(),
        }
    }
}

/// Refines a first solution with all views at once.
///
/// `free_lens`: refines the intrinsic parameters too (the thesis's *single step*); otherwise they stay (*two steps*).
///
/// Errors: [`CalibrationError::NotConverged`].
pub fn refine(
    first: &HandEye,
    pattern: &Pattern,
    views: &[View],
    accuracy: &Accuracy,
    free_lens: bool,
) -> Result<HandEye> {
    let problem = Bundle {
        hand_eye: *first,
        corrections: vec![Vector6::zeros(); views.len()],
        points: pattern.corners(),
        views,
        accuracy: *accuracy,
        free_lens,
    };
    let found = minimise(problem, MAX_ITERATIONS);
    let found = found.ok_or(CalibrationError::NotConverged {
        iterations: MAX_ITERATIONS,
    })?;
    Ok(found.hand_eye)
}

#[derive(Clone)]
struct Bundle<'a> {
    hand_eye: HandEye,
    /// Correction of each measured hand, in its own frame: m and rad.
    corrections: Vec<Vector6<f64>>,
    points: Vec<Point3<f64>>,
    views: &'a [View],
    accuracy: Accuracy,
    free_lens: bool,
}

impl Bundle<'_> {
    /// Returns the number of parameters that all views share: camera, pattern, lens.
    fn shared(&self) -> usize {
        12 + if self.free_lens {
            INTRINSIC_PARAMETERS
        } else {
            0
        }
    }

    /// Returns the errors of the corners of a view in units of their standard deviation; `None` behind the camera.
    fn residuals(&self, view: usize, hand_eye: &HandEye, hand: &Pose) -> Option<DVector<f64>> {
        let pose = hand_eye.grid_to_camera(hand);
        let mut all = DVector::zeros(2 * self.points.len());
        for (index, (point, seen)) in self
            .points
            .iter()
            .zip(&self.views[view].corners)
            .enumerate()
        {
            let pixel = hand_eye.camera.intrinsics.project(&(pose * point))?;
            for axis in 0..2 {
                all[2 * index + axis] = (pixel[axis] - seen[axis]) / self.accuracy.pixels;
            }
        }
        Some(all)
    }

    /// Returns the derivative of the errors of one view by the shared parameters and by the correction of its hand.
    fn jacobian(&self, view: usize) -> Option<DMatrix<f64>> {
        let shared = self.shared();
        let hand = self.hand(view, &Vector6::zeros());
        let mut all = DMatrix::zeros(2 * self.points.len(), shared + 6);
        for column in 0..shared + 6 {
            let interval = match column {
                12..16 if column < shared => FOCAL_INTERVAL,
                16.. if column < shared => DISTORTION_INTERVAL,
                _ => POSE_INTERVAL,
            };
            let at = |by: f64| {
                if column < shared {
                    return self.residuals(view, &varied(&self.hand_eye, column, by), &hand);
                }
                let hand = self.hand(view, &unit(column - shared, by));
                self.residuals(view, &self.hand_eye, &hand)
            };
            let slope = (at(interval)? - at(-interval)?) / (2.0 * interval);
            all.set_column(column, &slope);
        }
        Some(all)
    }

    /// Returns the corrected pose of a hand, its correction changed by `change`.
    fn hand(&self, view: usize, change: &Vector6<f64>) -> Pose {
        moved(
            &self.views[view].hand_to_world,
            &(self.corrections[view] + change),
        )
    }

    /// Returns the standard deviations of a correction.
    fn deviations(&self) -> Vector6<f64> {
        let (p, a) = (self.accuracy.position, self.accuracy.angle);
        Vector6::new(p, p, p, a, a, a)
    }
}

/// Returns camera, pattern and lens with shared parameter number `index` changed by `by`.
fn varied(hand_eye: &HandEye, index: usize, by: f64) -> HandEye {
    let mut varied = *hand_eye;
    match index {
        0..6 => varied.camera.pose = moved(&varied.camera.pose, &unit(index, by)),
        6..12 => varied.grid_to_hand = moved(&varied.grid_to_hand, &unit(index - 6, by)),
        _ => {
            *parameter(&mut varied.camera.intrinsics, index - 12) += by;
        }
    }
    varied
}

/// Returns one of fx, fy, cx, cy, k1, k2, p1, p2, k3.
fn parameter(intrinsics: &mut Intrinsics, index: usize) -> &mut f64 {
    match index {
        0..2 => &mut intrinsics.focal[index],
        2..4 => &mut intrinsics.centre[index - 2],
        _ => &mut intrinsics.distortion[index - 4],
    }
}

fn unit(index: usize, by: f64) -> Vector6<f64> {
    let mut motion = Vector6::zeros();
    motion[index] = by;
    motion
}

impl LeastSquares for Bundle<'_> {
    fn linearise(&self) -> (DVector<f64>, DMatrix<f64>) {
        let shared = self.shared();
        let size = shared + 6 * self.views.len();
        let (mut gradient, mut normal) = (DVector::zeros(size), DMatrix::zeros(size, size));
        for view in 0..self.views.len() {
            let residuals =
                self.residuals(view, &self.hand_eye, &self.hand(view, &Vector6::zeros()));
            let (Some(residuals), Some(jacobian)) = (residuals, self.jacobian(view)) else {
                continue;
            };
            let own = jacobian.transpose() * residuals;
            let square = jacobian.transpose() * &jacobian;
            let place = |index: usize| {
                if index < shared {
                    index
                } else {
                    6 * view + index
                }
            };
            for row in 0..shared + 6 {
                gradient[place(row)] += own[row];
                for column in 0..shared + 6 {
                    normal[(place(row), place(column))] += square[(row, column)];
                }
            }
            for (index, deviation) in self.deviations().iter().enumerate() {
                let weight = 1.0 / (deviation * deviation);
                let place = shared + 6 * view + index;
                gradient[place] += weight * self.corrections[view][index];
                normal[(place, place)] += weight;
            }
        }
        (gradient, normal)
    }

    fn cost(&self) -> f64 {
        let deviations = self.deviations();
        let mut sum = 0.0;
        for (view, correction) in self.corrections.iter().enumerate() {
            match self.residuals(view, &self.hand_eye, &self.hand(view, &Vector6::zeros())) {
                Some(residuals) => sum += residuals.norm_squared(),
                None => return f64::INFINITY,
            }
            sum += correction.component_div(&deviations).norm_squared();
        }
        sum
    }

    fn stepped(&self, step: &DVector<f64>) -> Self {
        let mut next = self.clone();
        for index in 0..self.shared() {
            next.hand_eye = varied(&next.hand_eye, index, step[index]);
        }
        for view in 0..self.views.len() {
            next.corrections[view] += step.fixed_rows::<6>(self.shared() + 6 * view);
        }
        next
    }
}
