//! The motors themselves.

use crate::{Axes, AxisIndex, AxisInfo, DeviceError};

/// Temperatures and gears of the motors (stock: `IMotor`). MotorSet are numbered as the axes.
pub trait Motor: AxisInfo {
    /// Temperatures, °C (`getTemperature(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn temperatures(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;

    /// Returns the maximum temperature of a motor, °C (`getTemperatureLimit`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn temperature_limit(&self, axis: AxisIndex) -> Result<f64, DeviceError>;

    /// Sets how hot a motor may become, °C (`setTemperatureLimit`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`].
    fn set_temperature_limit(&self, axis: AxisIndex, limit: f64) -> Result<(), DeviceError>;

    /// Turns of the motor per turn of the joint (`getGearboxRatio`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn gearbox_ratio(&self, axis: AxisIndex) -> Result<f64, DeviceError>;

    /// Sets the turns of the motor per turn of the joint (`setGearboxRatio`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`], [`DeviceError::OutOfRange`].
    fn set_gearbox_ratio(&self, axis: AxisIndex, ratio: f64) -> Result<(), DeviceError>;
}

/// Describes the requests about temperatures and gears of the motors; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_motor {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            motor: Motor, "iMotor", "motors" {
                numbers {
                    /// Temperature of the motor.
                    Temperature: "" ["tmp" "" "tmps"] ["getTemperatureOne" "" "getTemperatureAll"] => (each temperatures);
                    /// Maximum temperature of the motor.
                    TemperatureLimit: "" ["tmpl" "" ""] ["getTemperatureLimit" "" ""] => (axis temperature_limit);
                    /// Turns of the motor per turn of the joint.
                    GearboxRatio: "" ["gbxr" "" ""] ["getGearboxRatio" "" ""] => (axis gearbox_ratio);
                }
                settings {
                    /// Maximum temperature of the motor.
                    TemperatureLimit: "" ["tmpl" "" ""] ["setTemperatureLimit" "" ""]
                        => (axis set_temperature_limit "temperature limit");
                    /// Turns of the motor per turn of the joint.
                    GearboxRatio: "" ["gbxr" "" ""] ["setGearboxRatio" "" ""] => (axis set_gearbox_ratio "gearbox ratio");
                }
                actions {}
                queries {
                    /// Number of motors.
                    Motors -> usize: "" ["" "" "mtnm"] ["" "" "getNumberOfMotors"] => (by |motor, _| Ok(motor.axes()));
                }
                commands {}
            }
        }
    };
}
