//! Non-linear least squares: Levenberg and Marquardt's damped Gauss-Newton steps.

use nalgebra::{DMatrix, DVector};

/// Damping of the first step, relative to the diagonal of the normal matrix.
const FIRST_DAMPING: f64 = 1e-4;
/// Largest damping: no step of any size lowers the cost any more.
const MAX_DAMPING: f64 = 1e12;
/// Relative decrease of the cost below which the minimum is found.
const MIN_DECREASE: f64 = 1e-10;

/// A sum of squares over parameters that need not form a vector space.
pub(super) trait LeastSquares: Sized {
    /// Returns half the gradient and the normal matrix (J'r and J'J) for small changes of the parameters.
    fn linearise(&self) -> (DVector<f64>, DMatrix<f64>);
    /// Returns the sum of squares, or infinity where it is not defined.
    fn cost(&self) -> f64;
    /// Returns the problem with its parameters changed by `step`.
    fn stepped(&self, step: &DVector<f64>) -> Self;
}

/// Minimises the cost; `None` unless it converges within `iterations` steps.
pub(super) fn minimise<P: LeastSquares>(mut problem: P, iterations: usize) -> Option<P> {
    let mut cost = problem.cost();
    let mut damping = FIRST_DAMPING;
    if !cost.is_finite() {
        return None;
    }
    for _ in 0..iterations {
        let (gradient, normal) = problem.linearise();
        loop {
            let next = damped(&gradient, &normal, damping).map(|step| problem.stepped(&step));
            let next = next.map(|next| (next.cost(), next));
            if let Some((lower, next)) = next.filter(|(lower, _)| *lower <= cost) {
                let decrease = cost - lower;
                (problem, cost) = (next, lower);
                damping /= 10.0;
                if decrease <= MIN_DECREASE * cost || cost < f64::MIN_POSITIVE {
                    return Some(problem);
                }
                break;
            }
            damping *= 10.0;
            if damping > MAX_DAMPING {
                // Rounding alone keeps the cost from falling.
                return Some(problem);
            }
        }
    }
    None
}

fn damped(gradient: &DVector<f64>, normal: &DMatrix<f64>, damping: f64) -> Option<DVector<f64>> {
    let mut system = normal.clone();
    for index in 0..system.nrows() {
        // A parameter without influence stays.
        system[(index, index)] += damping * normal[(index, index)].max(f64::MIN_POSITIVE) + 1e-300;
    }
    let step = system.cholesky()?.solve(&-gradient);
    step.iter().all(|value| value.is_finite()).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley as squares: 10 (y - x²) and 1 - x.
    struct Valley([f64; 2]);

    impl Valley {
        fn residuals(&self) -> [f64; 2] {
            let [x, y] = self.0;
            [10.0 * (y - x * x), 1.0 - x]
        }
    }

    impl LeastSquares for Valley {
        fn linearise(&self) -> (DVector<f64>, DMatrix<f64>) {
            let jacobian = DMatrix::from_row_slice(2, 2, &[-20.0 * self.0[0], 10.0, -1.0, 0.0]);
            let residuals = DVector::from_row_slice(&self.residuals());
            (
                jacobian.transpose() * residuals,
                jacobian.transpose() * jacobian,
            )
        }

        fn cost(&self) -> f64 {
            self.residuals().iter().map(|value| value * value).sum()
        }

        fn stepped(&self, step: &DVector<f64>) -> Self {
            Self([self.0[0] + step[0], self.0[1] + step[1]])
        }
    }

    #[test]
    fn the_minimum_of_a_curved_valley_is_found() {
        let Valley([x, y]) = minimise(Valley([-1.2, 1.0]), 100).unwrap();
        assert!((x - 1.0).abs() < 1e-6 && (y - 1.0).abs() < 1e-6, "{x} {y}");
    }

    #[test]
    fn a_search_that_is_cut_off_or_undefined_gives_nothing() {
        assert!(minimise(Valley([-1.2, 1.0]), 2).is_none());
        assert!(minimise(Valley([f64::NAN, 1.0]), 100).is_none());
    }
}
