//! Bytes over a line.

use std::time::Duration;

use crate::DeviceError;

/// A serial line (stock: `ISerialDevice`).
pub trait SerialDevice: Send + Sync {
    /// Sends bytes, all of them (`send`).
    ///
    /// Errors: [`DeviceError::Unsuitable`] where there is no room for them.
    fn send(&self, bytes: &[u8]) -> Result<(), DeviceError>;

    /// Receives at most so many bytes (`receiveBytes`, `receiveChar`).
    ///
    /// Blocks until there is something, for `timeout` at the most; nothing then is no error.
    fn receive(&self, at_most: usize, timeout: Duration) -> Result<Vec<u8>, DeviceError>;

    /// Receives at most so many bytes up to and including the next line feed (`receiveLine`).
    ///
    /// Blocks until a line is there, for `timeout` at the most, and then gives nothing: a line that is not whole stays.
    fn receive_line(&self, at_most: usize, timeout: Duration) -> Result<Vec<u8>, DeviceError>;

    /// Raises or lowers the line "data terminal ready" (`setDTR`).
    fn set_data_terminal_ready(&self, ready: bool) -> Result<(), DeviceError>;

    /// Discards received bytes, and returns their number (`flush`).
    fn flush(&self) -> Result<usize, DeviceError>;
}
