//! Features from 0 to 1 over the range of a camera.

use crate::DeviceError;

/// Range of a control, as its driver reports it.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(in crate::camera) struct ControlRange {
    pub(in crate::camera) min: i32,
    pub(in crate::camera) max: i32,
    pub(in crate::camera) step: i32,
}

impl ControlRange {
    /// Returns the value at a fraction of the range, on a step of the driver.
    pub(in crate::camera) fn at(self, fraction: f64) -> i32 {
        let (min, max) = (i64::from(self.min), i64::from(self.max));
        let step = i64::from(self.step.max(1));
        let steps = (fraction * (max - min) as f64 / step as f64).round() as i64;
        let value = (min + steps * step).clamp(min, max.max(min));
        i32::try_from(value).unwrap_or(self.min)
    }

    /// Returns the fraction of the range at a value.
    pub(in crate::camera) fn fraction(self, value: i32) -> f64 {
        let width = f64::from(self.max) - f64::from(self.min);
        if width <= 0.0 {
            return 0.0;
        }
        ((f64::from(value) - f64::from(self.min)) / width).clamp(0.0, 1.0)
    }
}

/// Refuses values outside 0 to 1.
pub(in crate::camera) fn check_fraction(value: f64) -> Result<(), DeviceError> {
    check(value, "0 to 1")
}

/// Refuses values of the feature `Mirror` outside 0 to 1, and returns whether left and right are to be swapped.
pub(in crate::camera) fn check_mirror(value: f64) -> Result<bool, DeviceError> {
    check(value, "0 or 1").map(|()| value >= 0.5)
}

fn check(value: f64, expected: &str) -> Result<(), DeviceError> {
    if (0.0..=1.0).contains(&value) {
        return Ok(());
    }
    Err(DeviceError::Unsuitable {
        what: "the value of a feature,",
        asked: value.to_string(),
        expected: expected.to_owned(),
    })
}
