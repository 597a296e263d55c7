//! Joints stay inside limits.

use super::check;
use crate::{AxisIndex, DeviceError, Limits};

const NAME: &str = "joint limits";

/// Position range of each joint, degrees or metres; joints beyond the end of the list are unlimited.
///
/// A target outside is refused. A joint that moves at a velocity is stopped in time to come to rest inside, and a
/// velocity that leads further outside is refused.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointLimits(pub Vec<Limits>);

impl JointLimits {
    /// The limits of a joint, if it has any here.
    pub fn of(&self, joint: AxisIndex) -> Option<Limits> {
        self.0.get(joint.index()).copied()
    }

    /// Checks a place to go to.
    ///
    /// Errors: [`DeviceError::Guarded`].
    pub fn check_position(
        &self,
        joint: AxisIndex,
        asked: f64,
        unit: &'static str,
    ) -> Result<(), DeviceError> {
        check(NAME, joint, "position", asked, self.of(joint), unit)
    }

    /// Checks a velocity, with the joint at `position`.
    ///
    /// Errors: [`DeviceError::Guarded`] if the joint is at a limit or beyond, and this leads on.
    pub fn check_velocity(
        &self,
        joint: AxisIndex,
        asked: f64,
        position: f64,
        unit: &'static str,
    ) -> Result<(), DeviceError> {
        let Some(limits) = self.of(joint) else {
            return Ok(());
        };
        if position >= limits.max {
            let inward = Limits::new(f64::NEG_INFINITY, 0.0);
            check(
                NAME,
                joint,
                "velocity at its upper limit",
                asked,
                Some(inward),
                unit,
            )
        } else if position <= limits.min {
            let inward = Limits::new(0.0, f64::INFINITY);
            check(
                NAME,
                joint,
                "velocity at its lower limit",
                asked,
                Some(inward),
                unit,
            )
        } else {
            Ok(())
        }
    }

    /// Checks new limits for the device itself: not wider than these.
    ///
    /// Errors: [`DeviceError::Guarded`].
    pub fn check_limits(
        &self,
        joint: AxisIndex,
        asked: Limits,
        unit: &'static str,
    ) -> Result<(), DeviceError> {
        let allowed = self.of(joint);
        check(
            NAME,
            joint,
            "lower position limit",
            asked.min,
            allowed,
            unit,
        )?;
        check(
            NAME,
            joint,
            "upper position limit",
            asked.max,
            allowed,
            unit,
        )
    }
}
