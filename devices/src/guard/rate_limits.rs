//! Limits of commanded speeds and accelerations.

use super::check;
use crate::{AxisIndex, DeviceError, Limits};

const NAME: &str = "rate limits";
/// Assumed duration of a step to a direct position, s: network delays and more.
const STEP_TIME: f64 = 0.1;

/// Maximum commanded speed and acceleration of each joint, per second and per second squared; joints beyond the end
/// of a list are unlimited.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RateLimits {
    /// The largest speed, deg/s or m/s.
    pub speeds: Vec<f64>,
    /// The largest acceleration, deg/s² or m/s².
    pub accelerations: Vec<f64>,
}

impl RateLimits {
    /// Checks a velocity, signed.
    ///
    /// Errors: [`DeviceError::Guarded`].
    pub fn check_velocity(
        &self,
        joint: AxisIndex,
        asked: f64,
        unit: &'static str,
    ) -> Result<(), DeviceError> {
        let allowed = self.speed(joint).map(|most| Limits::new(-most, most));
        check(NAME, joint, "velocity", asked, allowed, unit)
    }

    /// Checks a place to go to at once, with the joint at `position`: no farther than it gets in a tenth of a second.
    ///
    /// Errors: [`DeviceError::Guarded`].
    pub fn check_step(
        &self,
        joint: AxisIndex,
        asked: f64,
        position: f64,
        unit: &'static str,
    ) -> Result<(), DeviceError> {
        let near =
            |most: f64| Limits::new(position - most * STEP_TIME, position + most * STEP_TIME);
        let allowed = self.speed(joint).map(near);
        check(NAME, joint, "position at once", asked, allowed, unit)
    }

    /// Checks a reference speed or a velocity limit.
    ///
    /// Errors: [`DeviceError::Guarded`].
    pub fn check_speed(
        &self,
        joint: AxisIndex,
        asked: f64,
        unit: &'static str,
    ) -> Result<(), DeviceError> {
        let allowed = self
            .speed(joint)
            .map(|most| Limits::new(f64::NEG_INFINITY, most));
        check(NAME, joint, "speed", asked, allowed, unit)
    }

    /// Returns a reference acceleration, reduced to the joint's maximum: more is not refused, as
    /// [`MotionControl`](crate::MotionControl) has it. Values that are not finite are passed on, for the device to
    /// refuse.
    pub fn bound_acceleration(&self, joint: AxisIndex, asked: f64) -> f64 {
        match self.acceleration(joint) {
            Some(most) if asked.is_finite() => asked.min(most),
            _ => asked,
        }
    }

    /// The largest speed of a joint, if it has one here.
    pub fn speed(&self, joint: AxisIndex) -> Option<f64> {
        self.speeds.get(joint.index()).copied()
    }

    /// The largest acceleration of a joint, if it has one here.
    pub fn acceleration(&self, joint: AxisIndex) -> Option<f64> {
        self.accelerations.get(joint.index()).copied()
    }
}
