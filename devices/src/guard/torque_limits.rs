//! Limits of commanded torques.

use super::{check, pairs};
use crate::{Axes, AxisIndex, DeviceError, Limits};

const NAME: &str = "torque limits";

/// Maximum commanded torque of each joint, Nm or N; joints beyond the end of the list are unlimited.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TorqueLimits(pub Vec<f64>);

impl TorqueLimits {
    /// The largest torque of a joint, if it has one here.
    pub fn of(&self, joint: AxisIndex) -> Option<f64> {
        self.0.get(joint.index()).copied()
    }

    /// Checks a command for several joints of a device with `total` axes.
    ///
    /// Errors: [`DeviceError::Guarded`] for the first that is too much.
    pub fn check(&self, axes: Axes<'_>, total: usize, torques: &[f64]) -> Result<(), DeviceError> {
        pairs(axes, total, torques).try_for_each(|(joint, asked)| {
            let allowed = self.of(joint).map(|most| Limits::new(-most, most));
            check(NAME, joint, "torque", asked, allowed, "Nm")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_much_torque_is_named() {
        let limits = TorqueLimits(vec![10.0, 5.0]);
        let check = |torques: &[f64]| limits.check(Axes::All, torques.len(), torques);
        assert!(check(&[10.0, -5.0, 1e9]).is_ok());
        assert_eq!(
            check(&[0.0, -5.5, 0.0]).unwrap_err().to_string(),
            "the torque limits of the guard forbid it: joint 1 asked for torque -5.5 Nm, allowed -5 to 5 Nm"
        );
    }
}
