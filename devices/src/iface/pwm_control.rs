//! Duty cycles of the motors.

use crate::{Axes, AxisInfo, DeviceError};

/// Measured and commanded duty cycles, percent, -100 to 100 (stock: `IPWMControl`).
///
/// References need [`Mode::Pwm`](crate::Mode::Pwm).
pub trait PwmControl: AxisInfo {
    /// The duty cycles given out now (`getDutyCycle(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; behind a network also [`DeviceError::NoDataYet`] and
    /// [`DeviceError::Stale`].
    fn duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;

    /// Commands these duty cycles until the next command, and returns at once (`setRefDutyCycle(s)`).
    ///
    /// Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    /// the selection; then every motor continues as before. A device behind a network may not get a refusal.
    fn set_reference_duty_cycles(
        &self,
        axes: Axes<'_>,
        duty_cycles: &[f64],
    ) -> Result<(), DeviceError>;

    /// Returns the last commanded duty cycles; 0 after a change of mode (`getRefDutyCycle(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn reference_duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}

/// Describes the requests about motor duty cycles; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_pwm_control {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            pwm_control: PwmControl, "iPWMControl", "duty cycles" {
                numbers {
                    /// The last commanded duty cycle.
                    ReferenceDutyCycle: "ipwm" ["ref" "" "refs"] ["getRefDutyCycleOne" "" "getRefDutyCycleAll"]
                        => (each reference_duty_cycles);
                    /// Duty cycle of the motor.
                    DutyCycle: "ipwm" ["pwm" "" "pwms"] ["getDutyCycleOne" "" "getDutyCycleAll"]
                        => (by |control, axes| control.duty_cycles(axes));
                }
                settings {
                    /// Give the motor this duty cycle.
                    DutyCycle: "" ["" "" ""]
                        ["setRefDutyCycleOne" "setRefDutyCycleGroup" "setRefDutyCycleAll"]
                        => (each set_reference_duty_cycles "duty cycles");
                }
                actions {}
                queries {}
                commands {}
            }
        }
    };
}
