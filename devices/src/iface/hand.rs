//! A hand with fingers, as a whole.

use crate::{Axes, DeviceError};

/// A hand that is driven by commands (section 5.5.1 of the thesis; no stock interface is like it).
///
/// Angles are degrees, one per motor: the three fingers, then the spread. Calls that move **block until the motion has
/// ended**, some seconds at the most; [`abort`](Self::abort) from another thread ends them at once.
pub trait Hand: Send + Sync {
    /// Prepares the motors: the fingers open and the counters are set to zero. Needed after power-up.
    ///
    /// Errors: [`DeviceError::Remote`], as of all calls here, with the hand's own complaint as its source.
    fn initialise(&self) -> Result<(), DeviceError>;

    /// Stops all motors at once; a call in progress ends with an error that reports it.
    ///
    /// Without a motion it has no effect.
    fn abort(&self) -> Result<(), DeviceError>;

    /// Returns whether the line to the hand was there when it was last used.
    fn is_connected(&self) -> bool;

    /// Sends a command in the hand's own language; answers its text.
    ///
    /// * `command`: one line of printable ASCII, up to 255 characters.
    /// * Errors: also for commands that would change the use of the line itself.
    fn send_command(&self, command: &str) -> Result<String, DeviceError>;

    /// Moves motors to these angles, degrees, and returns when they are there.
    ///
    /// Errors: also [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], or an error of the selection; then
    /// nothing moves.
    fn move_fingers(&self, axes: Axes<'_>, angles: &[f64]) -> Result<(), DeviceError>;

    /// Returns the positions of the motors, degrees.
    fn finger_positions(&self) -> Result<[f64; 4], DeviceError>;
}
