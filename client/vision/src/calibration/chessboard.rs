//! Detection of a chessboard, its corners in an order that does not depend on the image.
//!
//! An order that depends on the image turned the pattern by 180 degrees in the thesis and spoiled its hand-eye calibration.
//! Here the colours of the squares decide, whatever the detector says.

use opencv::calib3d::{
    CALIB_CB_ACCURACY, CALIB_CB_ADAPTIVE_THRESH, CALIB_CB_EXHAUSTIVE, CALIB_CB_FAST_CHECK,
    CALIB_CB_NORMALIZE_IMAGE, find_chessboard_corners, find_chessboard_corners_sb,
};
use opencv::core::{
    Mat, MatTraitConst, Point2f, Size, TermCriteria, TermCriteria_Type, Vector, mean_std_dev_def,
};
use opencv::imgproc::corner_sub_pix;

use super::calibration_error::at;
use super::{CalibrationError, Pattern, Result};
use crate::{Image, mat};

/// Half the side of the largest window in which a corner is refined, in pixels.
const MAX_WINDOW: f64 = 11.0;
/// Half the side of the smallest one.
const MIN_WINDOW: f64 = 2.0;
/// Half the side of the window as part of the distance to the nearest other corner: it must not see that one.
const WINDOW_SHARE: f64 = 0.35;
/// End of the refinement of a corner: iterations, and pixels.
const REFINEMENT: (i32, f64) = (50, 1e-4);
/// Standard deviation of the brightness (of 255) below which an image shows nothing.
const MIN_CONTRAST: f64 = 4.0;

/// A chessboard in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// Pixels of the corners in the order of [`Pattern::corners`].
    pub corners: Vec<[f64; 2]>,
}

/// Finds all inner corners of a pattern in an image.
///
/// `name`: file or origin of the image, for errors. OpenCV's detector by contours comes first, with the settings of its
/// own calibration sample, then its detector by sectors. The corners are refined within windows that see one corner each.
///
/// Errors: [`CalibrationError::NoPattern`], [`CalibrationError::Covered`].
pub fn detect(image: &Image, pattern: &Pattern, name: &str) -> Result<Detection> {
    let grey = mat::grey_of_image(image).map_err(|error| CalibrationError::Image {
        image: name.to_owned(),
        source: Box::new(error),
    })?;
    let Some(found) = find(&grey, pattern)? else {
        check_light(&grey, name)?;
        return Err(CalibrationError::NoPattern {
            image: name.to_owned(),
            columns: pattern.columns(),
            rows: pattern.rows(),
        });
    };
    sorted(&grey, pattern, found)
}

/// Errors: [`CalibrationError::Covered`] for an image that shows nothing.
pub(super) fn check_light(grey: &Mat, name: &str) -> Result<()> {
    let (mut mean, mut deviation) = (Vector::<f64>::new(), Vector::<f64>::new());
    mean_std_dev_def(grey, &mut mean, &mut deviation).map_err(at("measuring the brightness"))?;
    let first = |values: &Vector<f64>| values.get(0).unwrap_or_default();
    let (mean, contrast) = (first(&mean), first(&deviation));
    if contrast < MIN_CONTRAST {
        return Err(CalibrationError::Covered {
            image: name.to_owned(),
            mean,
            contrast,
        });
    }
    Ok(())
}

fn find(grey: &Mat, pattern: &Pattern) -> Result<Option<Vec<[f64; 2]>>> {
    let size = Size::new(pattern.columns() as i32, pattern.rows() as i32);
    let step = "finding the chessboard";
    let mut corners = Vector::<Point2f>::new();
    let flags = CALIB_CB_ADAPTIVE_THRESH | CALIB_CB_NORMALIZE_IMAGE | CALIB_CB_FAST_CHECK;
    if find_chessboard_corners(grey, size, &mut corners, flags).map_err(at(step))?
        && corners.len() == pattern.count()
    {
        let window = window(pattern, &points(&corners)).round() as i32;
        let (iterations, pixels) = REFINEMENT;
        let kind = TermCriteria_Type::COUNT as i32 + TermCriteria_Type::EPS as i32;
        let criteria = TermCriteria::new(kind, iterations, pixels).map_err(at(step))?;
        let (size, none) = (Size::new(window, window), Size::new(-1, -1));
        corner_sub_pix(grey, &mut corners, size, none, criteria)
            .map_err(at("refining the corners"))?;
        return Ok(Some(points(&corners)));
    }
    let flags = CALIB_CB_NORMALIZE_IMAGE | CALIB_CB_EXHAUSTIVE | CALIB_CB_ACCURACY;
    let found = find_chessboard_corners_sb(grey, size, &mut corners, flags).map_err(at(step))?;
    Ok((found && corners.len() == pattern.count()).then(|| points(&corners)))
}

fn points(corners: &Vector<Point2f>) -> Vec<[f64; 2]> {
    let point = |corner: Point2f| [f64::from(corner.x), f64::from(corner.y)];
    corners.iter().map(point).collect()
}

/// Returns half the side of the window of a refinement, in pixels.
fn window(pattern: &Pattern, corners: &[[f64; 2]]) -> f64 {
    let columns = pattern.columns() as usize;
    let distance = |one: usize, other: usize| {
        let ([a, b], [c, d]) = (corners[one], corners[other]);
        (a - c).hypot(b - d)
    };
    let mut nearest = f64::INFINITY;
    for index in 0..corners.len() {
        if (index + 1) % columns != 0 {
            nearest = nearest.min(distance(index, index + 1));
        }
        if index + columns < corners.len() {
            nearest = nearest.min(distance(index, index + columns));
        }
    }
    (WINDOW_SHARE * nearest).clamp(MIN_WINDOW, MAX_WINDOW)
}

/// Puts the corners into the order of the pattern.
fn sorted(grey: &Mat, pattern: &Pattern, mut corners: Vec<[f64; 2]>) -> Result<Detection> {
    let columns = pattern.columns() as usize;
    if area(&corners, columns) < 0.0 {
        // Seen from behind: rows were counted backwards.
        for row in corners.chunks_mut(columns) {
            row.reverse();
        }
    }
    if pattern.is_unambiguous() && !is_first_square_dark(grey, &corners, columns)? {
        corners.reverse();
    }
    Ok(Detection { corners })
}

/// Returns the signed area of the quadrilateral of the outer corners: positive for x to the right and y down.
fn area(corners: &[[f64; 2]], columns: usize) -> f64 {
    let last = corners.len() - 1;
    let ring = [0, columns - 1, last, last + 1 - columns].map(|index| corners[index]);
    let cross = |index: usize| {
        let ([a, b], [c, d]) = (ring[index], ring[(index + 1) % 4]);
        a * d - b * c
    };
    (0..4).map(cross).sum::<f64>() / 2.0
}

/// Compares the squares of the colour of the first inner square with the others.
fn is_first_square_dark(grey: &Mat, corners: &[[f64; 2]], columns: usize) -> Result<bool> {
    let rows = corners.len() / columns;
    let (mut sums, mut counts) = ([0.0; 2], [0_u32; 2]);
    for row in 0..rows - 1 {
        for column in 0..columns - 1 {
            let first = row * columns + column;
            let around = [first, first + 1, first + columns, first + columns + 1];
            let middle = |axis: usize| {
                let sum: f64 = around.iter().map(|index| corners[*index][axis]).sum();
                (sum / 4.0).round() as i32
            };
            let x = middle(0).clamp(0, grey.cols() - 1);
            let y = middle(1).clamp(0, grey.rows() - 1);
            let value = *grey.at_2d::<u8>(y, x).map_err(at("reading a square"))?;
            sums[(row + column) % 2] += f64::from(value);
            counts[(row + column) % 2] += 1;
        }
    }
    Ok(sums[0] / f64::from(counts[0]) < sums[1] / f64::from(counts[1]))
}

#[cfg(test)]
mod tests {
    use opencv::core::{CV_8UC1, MatTrait, Scalar};

    use super::*;

    /// A board with squares of 20 pixels, the first inner one dark, and its corners.
    fn board() -> (Mat, Vec<[f64; 2]>) {
        let white = Scalar::all(220.0);
        let mut grey = Mat::new_rows_cols_with_default(180, 240, CV_8UC1, white).unwrap();
        for y in 20..160 {
            for x in 20..220 {
                if (x / 20 + y / 20) % 2 == 0 {
                    *grey.at_2d_mut::<u8>(y, x).unwrap() = 30;
                }
            }
        }
        let place = |index: i32| f64::from(index) * 20.0 + 39.5;
        let corners = (0..6).flat_map(|row| (0..9).map(move |column| [place(column), place(row)]));
        (grey, corners.collect())
    }

    #[test]
    fn every_order_becomes_the_one_of_the_pattern() {
        let pattern: Pattern = "9x6".parse().unwrap();
        let (grey, corners) = board();
        let mut turned = corners.clone();
        turned.reverse();
        let mut mirrored = corners.clone();
        mirrored.chunks_mut(9).for_each(<[[f64; 2]]>::reverse);
        let mut both = mirrored.clone();
        both.reverse();
        for order in [corners.clone(), turned, mirrored, both] {
            let found = sorted(&grey, &pattern, order).unwrap();
            assert_eq!(found.corners, corners);
        }
    }

    #[test]
    fn the_window_of_a_refinement_sees_one_corner() {
        let pattern: Pattern = "9x6".parse().unwrap();
        let (_, corners) = board();
        assert_eq!(window(&pattern, &corners), 7.0);
        let scaled = |factor: f64| -> Vec<[f64; 2]> {
            corners
                .iter()
                .map(|[x, y]| [x * factor, y * factor])
                .collect()
        };
        assert_eq!(window(&pattern, &scaled(0.1)), MIN_WINDOW);
        assert_eq!(window(&pattern, &scaled(10.0)), MAX_WINDOW);
    }
}
