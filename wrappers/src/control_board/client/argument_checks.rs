//! Checks of arguments before they are sent. Not every board checks them, so nothing else leaves here.

use yarp_devices::{AxisIndex, CalibrationParameters, DeviceError, Impedance, Limits};

/// An argument of a command for one axis.
pub(super) trait Checked {
    /// Errors: [`DeviceError::NotFinite`].
    fn check(&self, axis: AxisIndex) -> Result<(), DeviceError>;
}

impl Checked for bool {
    fn check(&self, _: AxisIndex) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// The method of a calibration.
impl Checked for u32 {
    fn check(&self, _: AxisIndex) -> Result<(), DeviceError> {
        Ok(())
    }
}

impl Checked for Limits {
    fn check(&self, axis: AxisIndex) -> Result<(), DeviceError> {
        finite(axis, "limit", &[self.min, self.max])
    }
}

impl Checked for Impedance {
    fn check(&self, axis: AxisIndex) -> Result<(), DeviceError> {
        finite(axis, "stiffness", &[self.stiffness])?;
        finite(axis, "damping", &[self.damping])
    }
}

impl Checked for [f64; 3] {
    fn check(&self, axis: AxisIndex) -> Result<(), DeviceError> {
        finite(axis, "calibration parameter", self)
    }
}

impl Checked for CalibrationParameters {
    fn check(&self, axis: AxisIndex) -> Result<(), DeviceError> {
        finite(axis, "calibration parameter", &self.parameters)?;
        finite(axis, "calibration parameter", &[self.zero])
    }
}

fn finite(axis: AxisIndex, quantity: &'static str, values: &[f64]) -> Result<(), DeviceError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&asked) => Err(DeviceError::NotFinite {
            joint: axis,
            quantity,
            asked,
        }),
        None => Ok(()),
    }
}
