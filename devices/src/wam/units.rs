//! The border between the degrees of the device interfaces and the radians of the mathematics behind them.
//!
//! Places stay metres on both sides; velocities and accelerations are turned like angles.

use crate::Limits;

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
