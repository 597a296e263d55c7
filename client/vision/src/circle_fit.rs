//! Circle through points in the plane.

use nalgebra::{Matrix3, Vector3};

/// Returns centre and radius of the circle through points in the least squares sense (Kåsa 1976); `None` for fewer than three
/// points and for points on a line.
pub(crate) fn circle_through(points: &[[f64; 2]]) -> Option<([f64; 2], f64)> {
    if points.len() < 3 {
        return None;
    }
    let middle = mean(points);
    let (mut matrix, mut vector) = (Matrix3::zeros(), Vector3::zeros());
    for point in points {
        let [x, y] = [point[0] - middle[0], point[1] - middle[1]];
        let row = Vector3::new(x, y, 1.0);
        matrix += row * row.transpose();
        vector += row * (x * x + y * y);
    }
    let solution = matrix.lu().solve(&vector)?;
    let (x, y) = (solution.x / 2.0, solution.y / 2.0);
    let radius = (solution.z + x * x + y * y).sqrt();
    radius
        .is_finite()
        .then_some(([middle[0] + x, middle[1] + y], radius))
}

/// Returns the mean of points; the origin if there are none.
pub(crate) fn mean(points: &[[f64; 2]]) -> [f64; 2] {
    let count = points.len().max(1) as f64;
    [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_goes_through_its_points() {
        let on = |angle: f64| [3.0 + 2.0 * angle.cos(), -1.0 + 2.0 * angle.sin()];
        let (centre, radius) = circle_through(&[0.1, 0.9, 2.0, 2.2].map(on)).unwrap();
        assert!((centre[0] - 3.0).abs() < 1e-9 && (centre[1] + 1.0).abs() < 1e-9);
        assert!((radius - 2.0).abs() < 1e-9);
    }

    #[test]
    fn two_points_and_points_on_a_line_have_no_circle() {
        assert_eq!(circle_through(&[[0.0, 0.0], [1.0, 0.0]]), None);
        let on_a_line = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
        assert_eq!(circle_through(&on_a_line), None);
    }
}
