//! Settings that a board keeps while it is off.

use crate::DeviceError;

/// Boot memory of a control board (stock: `IControlDebug`, which no stock server offers over the network).
///
/// `setPrintFunction` has no counterpart: devices log through `tracing`, whose subscriber the program chooses.
pub trait ControlDebug: Send + Sync {
    /// Saves the present settings to the boot memory (`saveBootMemory`).
    ///
    /// Settings are those that a board has after a start: limits, reference speeds and accelerations, gains and the like. Control modes,
    /// commands and positions are none.
    ///
    /// * Errors: those of the device; then the boot memory is as before.
    fn save_boot_memory(&self) -> Result<(), DeviceError>;

    /// Applies the settings of the boot memory, as at a start of the board (`loadBootMemory`).
    ///
    /// * Errors: [`DeviceError::Moving`] while an axis moves, [`DeviceError::OutOfRange`] if an axis is outside of the saved limits, and
    ///   those of the device; then no setting has changed.
    fn load_boot_memory(&self) -> Result<(), DeviceError>;
}
