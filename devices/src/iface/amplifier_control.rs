//! The amplifiers that feed the motors.

use crate::{Axes, AxisIndex, AxisInfo, DeviceError};

/// Amplifiers: on or off, and within which limits (stock: `IAmplifierControl`).
pub trait AmplifierControl: AxisInfo {
    /// Switches amplifiers on or off (`enableAmp`, `disableAmp`).
    ///
    /// A joint whose amplifier is switched off goes idle; switching it on leaves it idle.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn enable_amplifiers(&self, axes: Axes<'_>, enabled: bool) -> Result<(), DeviceError>;

    /// The state of the amplifiers in the device's own code; 0 is off (`getAmpStatus`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn amplifier_status(&self, axes: Axes<'_>) -> Result<Vec<i32>, DeviceError>;

    /// A limit of an amplifier (`getMaxCurrent`, `getNominalCurrent`, `getPeakCurrent`, `getPWMLimit`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn amplifier_limit(&self, limit: AmplifierLimit, axis: AxisIndex) -> Result<f64, DeviceError>;

    /// Sets a limit of an amplifier (`setMaxCurrent`, `setNominalCurrent`, `setPeakCurrent`, `setPWMLimit`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`], [`DeviceError::OutOfRange`].
    fn set_amplifier_limit(
        &self,
        limit: AmplifierLimit,
        axis: AxisIndex,
        value: f64,
    ) -> Result<(), DeviceError>;

    /// Returns the present duty cycle of an amplifier, percent (`getPWM`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn amplifier_duty_cycle(&self, axis: AxisIndex) -> Result<f64, DeviceError>;

    /// The voltage that feeds an amplifier, V (`getPowerSupplyVoltage`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn supply_voltage(&self, axis: AxisIndex) -> Result<f64, DeviceError>;
}

/// Limits of an amplifier.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum AmplifierLimit {
    /// The current at which it switches off, A.
    MaxCurrent,
    /// The current it may give for ever, A.
    NominalCurrent,
    /// The current it may give for a short time, A.
    PeakCurrent,
    /// The largest duty cycle, percent.
    DutyCycle,
}

/// Describes the requests about amplifiers; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_amplifier_control {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            amplifier_control: AmplifierControl, "iAmplifierControl", "amplifiers" {
                numbers {
                    /// Current at which the amplifier switches off.
                    MaxCurrent: "" ["maxc" "" ""] ["getMaxCurrent" "" ""]
                        => (of_axis |amplifiers, axis| amplifiers.amplifier_limit(AmplifierLimit::MaxCurrent, axis));
                    /// Current that the amplifier may give for ever.
                    NominalCurrent: "" ["acno" "" ""] ["getNominalCurrent" "" ""]
                        => (of_axis |amplifiers, axis| amplifiers.amplifier_limit(AmplifierLimit::NominalCurrent, axis));
                    /// Current that the amplifier may give for a short time.
                    PeakCurrent: "" ["acpk" "" ""] ["getPeakCurrent" "" ""]
                        => (of_axis |amplifiers, axis| amplifiers.amplifier_limit(AmplifierLimit::PeakCurrent, axis));
                    /// Largest duty cycle of the amplifier.
                    DutyCycleLimit: "" ["pwml" "" ""] ["getPWMLimit" "" ""]
                        => (of_axis |amplifiers, axis| amplifiers.amplifier_limit(AmplifierLimit::DutyCycle, axis));
                    /// Duty cycle of the amplifier.
                    AmplifierDutyCycle: "" ["pwm" "" ""] ["getPWM" "" ""] => (axis amplifier_duty_cycle);
                    /// Supply voltage of the amplifier.
                    SupplyVoltage: "" ["avsu" "" ""] ["getPowerSupplyVoltage" "" ""] => (axis supply_voltage);
                }
                settings {
                    /// Current at which the amplifier switches off.
                    MaxCurrent: "" ["maxc" "" ""] ["setMaxCurrent" "" ""]
                        => (of_axis |amplifiers, axis, value| amplifiers.set_amplifier_limit(AmplifierLimit::MaxCurrent, axis, value));
                    /// Current that the amplifier may give for ever.
                    NominalCurrent: "" ["acno" "" ""] ["setNominalCurrent" "" ""]
                        => (of_axis |amplifiers, axis, value| amplifiers.set_amplifier_limit(AmplifierLimit::NominalCurrent, axis, value));
                    /// Current that the amplifier may give for a short time.
                    PeakCurrent: "" ["acpk" "" ""] ["setPeakCurrent" "" ""]
                        => (of_axis |amplifiers, axis, value| amplifiers.set_amplifier_limit(AmplifierLimit::PeakCurrent, axis, value));
                    /// Largest duty cycle of the amplifier.
                    DutyCycleLimit: "" ["pwml" "" ""] ["setPWMLimit" "" ""]
                        => (of_axis |amplifiers, axis, value| amplifiers.set_amplifier_limit(AmplifierLimit::DutyCycle, axis, value));
                }
                actions {
                    /// Switch amplifiers on.
                    EnableAmplifiers: "" ["aen" "" ""] ["enableAmp" "" ""]
                        => (by |amplifiers, axes| amplifiers.enable_amplifiers(axes, true));
                    /// Switch amplifiers off.
                    DisableAmplifiers: "" ["adi" "" ""] ["disableAmp" "" ""]
                        => (by |amplifiers, axes| amplifiers.enable_amplifiers(axes, false));
                }
                queries {
                    /// States of amplifiers.
                    AmplifierStatus -> Vec<i32>: "" ["asts" "" "asta"] ["getAmpStatusOne" "" "getAmpStatusAll"]
                        => (each amplifier_status);
                }
                commands {}
            }
        }
    };
}
