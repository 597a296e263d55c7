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
