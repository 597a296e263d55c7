//! A stop of the whole device by software.

use crate::DeviceError;

/// A stop that stays until it is released; not in stock.
///
/// It is no emergency stop: it needs the program and the machine it runs on. The red button of the pendant needs
/// neither.
pub trait SoftwareStop: Send + Sync {
    /// Ramps every joint down at once, in any control mode, and has it hold; refuses every command from then on.
    ///
    /// An idle joint stays idle. Errors: those of the device; the commands are refused all the same, and stopping is tried
    /// again until every joint is at rest.
    fn stop_motion(&self) -> Result<(), DeviceError>;

    /// Has the machine brake, as far as it can; refuses every command from then on.
    ///
    /// Errors: [`DeviceError::NotSupported`] for a machine without a brake, which is then stopped, or those of the
    /// machine.
    fn brake(&self) -> Result<(), DeviceError>;

    /// Takes commands again. Nothing moves until the next one.
    fn release(&self);

    /// Returns the state.
    fn stop_state(&self) -> StopState;
}

/// State of a [`SoftwareStop`].
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum StopState {
    /// Commands are taken.
    #[default]
    Released,
    /// Stopped: the joints hold.
    Stopped,
    /// Stopped, and the machine was told to brake.
    Braked,
}

impl std::fmt::Display for StopState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Released => "released",
            Self::Stopped => "stopped",
            Self::Braked => "braked",
        })
    }
}

/// Brakes of a whole machine.
pub trait MachineBrake: Send + Sync {
    /// Has the machine brake; a person releases it at the machine.
    ///
    /// Barrett's arm falls back to idle: its safety module shorts the windings, and only the pendant activates it again.
    ///
    /// Errors: [`DeviceError::Remote`] while the machine cannot be reached.
    fn brake_machine(&self) -> Result<(), DeviceError>;
}
