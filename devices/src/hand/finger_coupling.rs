//! Coupling of one motor to two links, and the clutch of a finger.
//!
//! While the clutch holds, the outer link turns a third as far as the inner one. When the torque on the inner link
//! exceeds that of the clutch, the clutch releases (TorqueSwitch): the inner link stays, and the motor turns the
//! outer one alone, four times as far per count. Opening goes the same way back.
//!
//! ```text
//! engaged:    inner = P / 125      outer = P / 375                       degrees
//! let go:     inner = BP / 125     outer = BP / 375 + (P - BP) / 93.75
//! ```
//!
//! Source: chapter 9.6 of the manual. That opening retraces the way is an assumption.

use std::f64::consts::PI;

use super::gcl::Motor;
use super::hand_units;

/// Rotation of the outer link per rotation of the inner one, while the clutch is engaged.
pub const RATIO: f64 = 1.0 / 3.0;
/// Range of the inner link, rad: 140 degrees.
pub const INNER_LIMIT: f64 = 140.0 * PI / 180.0;
/// Range of the outer link against the inner one, rad: 46.7 degrees, which the data sheet rounds to 45.
pub const OUTER_LIMIT: f64 = INNER_LIMIT * RATIO;

/// Counts per degree of the outer link, once the clutch has released.
pub(super) const OUTER_COUNTS: f64 = 93.75;

/// The two links of a finger, rad; 0 is open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Links {
    /// The inner link against the palm.
    pub inner: f64,
    /// The outer link against the inner one.
    pub outer: f64,
}

/// A motor's position that puts the links somewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorPosition {
    /// Counts of the motor.
    pub counts: f64,
    /// Position at which the inner link must be held for it, in counts; `None` while the clutch is engaged.
    pub breakaway: Option<f64>,
}

/// Returns the link angles for a motor position of `counts`, with the clutch released at `breakaway` or engaged.
///
/// A clutch that released at a place beyond the motor's is engaged again.
pub fn links(counts: f64, breakaway: Option<f64>) -> Links {
    let engaged = breakaway.map_or(counts, |place| place.min(counts));
    let inner = hand_units::degrees(Motor::F1, engaged).to_radians();
    let beyond = ((counts - engaged) / OUTER_COUNTS).to_radians();
    Links {
        inner,
        outer: inner * RATIO + beyond,
    }
}

/// Returns the motor position for these links; `None` if it is not reachable.
///
/// The outer link cannot be more open than the inner one turns it, nor either beyond its limit.
pub fn motor(links: Links) -> Option<MotorPosition> {
    const TOLERANCE: f64 = 1e-9;
    let Links { inner, outer } = links;
    let beyond = outer - inner * RATIO;
    let possible = (-TOLERANCE..=INNER_LIMIT + TOLERANCE).contains(&inner)
        && (-TOLERANCE..=OUTER_LIMIT + TOLERANCE).contains(&outer)
        && beyond >= -TOLERANCE;
    if !possible {
        return None;
    }
    let place = hand_units::counts(Motor::F1, inner.to_degrees());
    Some(match beyond <= TOLERANCE {
        true => MotorPosition {
            counts: place,
            breakaway: None,
        },
        false => MotorPosition {
            counts: place + beyond.to_degrees() * OUTER_COUNTS,
            breakaway: Some(place),
        },
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_ends_are_those_of_the_data_sheet() {
        let closed = links(17500.0, None);
        assert!((closed.inner - INNER_LIMIT).abs() < 1e-12);
        assert!((closed.outer.to_degrees() - 46.67).abs() < 0.01);
        let held = links(9000.0, Some(5000.0));
        assert!((held.inner.to_degrees() - 40.0).abs() < 1e-9);
        assert!((held.outer.to_degrees() - (40.0 / 3.0 + 4000.0 / 93.75)).abs() < 1e-9);
        assert_eq!(links(4000.0, Some(5000.0)), links(4000.0, None));
        let wrong = Links {
            inner: 1.0,
            outer: 0.2,
        };
        assert_eq!(motor(wrong), None);
    }

    proptest! {
        #[test]
        fn the_motor_comes_back(counts in 0.0..17500.0f64, part in 0.0..1.0f64) {
            for breakaway in [None, Some(counts * part)] {
                let there = links(counts, breakaway);
                prop_assume!(there.outer <= OUTER_LIMIT);
                let back = motor(there).unwrap();
                prop_assert!((back.counts - counts).abs() < 1e-6);
                let again = links(back.counts, back.breakaway);
                prop_assert!((again.outer - there.outer).abs() < 1e-9);
            }
        }
    }
}
