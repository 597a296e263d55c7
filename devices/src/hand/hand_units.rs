//! The border between the hand's counts and the degrees of the interfaces.
//!
//! | motor | range | counts per degree |
//! | --- | --- | --- |
//! | finger, inner link | 17500 counts, 140 degrees | 125 |
//! | spread, each of two fingers | 3150 counts, 180 degrees | 17.5 |
//!
//! An encoder gives 360 counts per turn of a motor. A finger's motor drives the inner link through 125:1 and the outer
//! link, against the inner one, through 375:1; the spread goes through 17.5:1. Source: chapter 9.6 of the manual.
//!
//! The thesis measured something else for the spread: [`MEASURED_SPREAD`].

use super::gcl::Motor;

/// Counts per degree of the inner link, and how many of them there are.
const FINGER: (f64, f64) = (125.0, 17500.0);
/// Counts per degree of one finger about the palm, and how many of them there are.
const SPREAD: (f64, f64) = (17.5, 3150.0);

/// Counts of the spread per radian, as section 6.3.3 of the thesis measured it.
///
/// The thesis adds "or 20.5 counts/degree", which is twice as much as 588.235 per radian: the first can be read as the
/// angle *between* the first two fingers, which both turn, the second as that of one of them. Neither is the 17.5
/// counts per degree (1002.7 per radian) of the data sheet, which the conversions here use.
pub const MEASURED_SPREAD: f64 = 588.235;

/// Counts per degree, as the data sheet has it.
pub const fn counts_per_degree(motor: Motor) -> f64 {
    match motor {
        Motor::Spread => SPREAD.0,
        _ => FINGER.0,
    }
}

/// Counts from one end to the other.
pub const fn whole_way(motor: Motor) -> f64 {
    match motor {
        Motor::Spread => SPREAD.1,
        _ => FINGER.1,
    }
}

/// Degrees of a position in counts: of the inner link while the clutch holds, or of the spread of one finger.
pub fn degrees(motor: Motor, counts: f64) -> f64 {
    counts / counts_per_degree(motor)
}

/// Counts of an angle in degrees.
pub fn counts(motor: Motor, degrees: f64) -> f64 {
    degrees * counts_per_degree(motor)
}

/// Counts of the spread for an angle between the first two fingers, in radians, as the thesis measured it.
pub fn measured_spread_counts(between: f64) -> f64 {
    between * MEASURED_SPREAD
}

/// The angle between the first two fingers, in radians, for counts of the spread, as the thesis measured it.
pub fn measured_spread_angle(counts: f64) -> f64 {
    counts / MEASURED_SPREAD
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_the_way_are_those_of_the_data_sheet() {
        assert_eq!(degrees(Motor::F2, whole_way(Motor::F2)), 140.0);
        assert_eq!(degrees(Motor::Spread, whole_way(Motor::Spread)), 180.0);
        // A right angle between the first two fingers and the third.
        assert_eq!(counts(Motor::Spread, 90.0), 1575.0);
        let radians = 1.0_f64.to_radians();
        assert!((radians / counts_per_degree(Motor::F1) - 0.000_139_63).abs() < 1e-8);
        assert!((radians / counts_per_degree(Motor::Spread) - 0.000_997_33).abs() < 1e-8);
    }

    #[test]
    fn the_measured_value_is_17_percent_off_for_one_finger() {
        // Both fingers turn: half of the angle between them is that of one.
        let one_finger = measured_spread_counts(2.0_f64.to_radians());
        assert!((one_finger - 20.5).abs() < 0.05);
        assert!((one_finger / counts_per_degree(Motor::Spread) - 1.173).abs() < 1e-3);
        assert!((measured_spread_angle(measured_spread_counts(0.7)) - 0.7).abs() < 1e-12);
    }
}
