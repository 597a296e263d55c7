//! The wait for the first value that a remote device publishes.

use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::DeviceError;

/// Interval between attempts.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Calls `attempt` until it returns something else than [`DeviceError::NoDataYet`], at most for `timeout`; returns what
/// the last call returned.
///
/// Blocks the calling thread.
///
/// # Errors
///
/// The error of the last call; [`DeviceError::NoDataYet`] after the timeout.
pub fn wait_first_value<T>(
    timeout: Duration,
    mut attempt: impl FnMut() -> Result<T, DeviceError>,
) -> Result<T, DeviceError> {
    let deadline = Instant::now() + timeout;
    loop {
        match attempt() {
            Err(DeviceError::NoDataYet { .. }) if Instant::now() < deadline => {
                thread::sleep(POLL_INTERVAL);
            }
            outcome => return outcome,
        }
    }
}
