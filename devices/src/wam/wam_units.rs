//! Conversion between the degrees of the device interfaces and the radians of the mathematics behind them.
//!
//! Places stay metres on both sides; velocities and accelerations are turned like angles.

use crate::Limits;
use crate::simulation::Gains;

/// Degrees, or per second, as radians.
pub fn radians<const N: usize>(degrees: [f64; N]) -> [f64; N] {
    degrees.map(f64::to_radians)
}

/// Radians, or per second, as degrees.
pub fn degrees<const N: usize>(radians: [f64; N]) -> [f64; N] {
    radians.map(f64::to_degrees)
}

/// Limits in radians as limits in degrees.
pub fn limits_in_degrees(radians: Limits) -> Limits {
    Limits::new(radians.min.to_degrees(), radians.max.to_degrees())
}

/// Gains per radian as gains per degree; torques stay Nm.
pub fn gains_per_degree(per_radian: Gains) -> Gains {
    let one = 1.0_f64.to_radians();
    Gains {
        proportional: per_radian.proportional * one,
        integral: per_radian.integral * one,
        derivative: per_radian.derivative * one,
        limit: per_radian.limit,
    }
}

/// Gains per degree as gains per radian; torques stay Nm.
pub fn gains_per_radian(per_degree: Gains) -> Gains {
    let one = 1.0_f64.to_degrees();
    Gains {
        proportional: per_degree.proportional * one,
        integral: per_degree.integral * one,
        derivative: per_degree.derivative * one,
        limit: per_degree.limit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back_is_the_same() {
        let angles = [0.0, 90.0, -180.0];
        let back = degrees(radians(angles));
        assert!(
            angles
                .iter()
                .zip(back)
                .all(|(one, other)| (one - other).abs() < 1e-12)
        );
        let gains = Gains::new(900.0, 2.5, 10.0, 25.0);
        let per_degree = gains_per_degree(gains);
        assert!((per_degree.proportional - 15.707_963_267_948_966).abs() < 1e-12);
        let back = gains_per_radian(per_degree);
        assert!((back.proportional - 900.0).abs() < 1e-9 && back.limit == 25.0);
        let limits = limits_in_degrees(Limits::new(0.0, std::f64::consts::PI));
        assert_eq!(limits, Limits::new(0.0, 180.0));
    }
}
