//! Joints go where they are parked before their device ends.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::{Axes, Device, DeviceError, Mode};

/// How long joints have to get there.
const PARK_TIMEOUT: Duration = Duration::from_secs(120);

/// Parks all joints of a device and waits until they are there; cancelling leaves them on their way.
///
/// Joints that follow a stream of commands are told to move by positions first. A device that knows no parking stays
/// as it is.
pub async fn park(device: Arc<dyn Device>) -> Result<(), DeviceError> {
    let work = tokio::task::spawn_blocking(move || {
        let Some(calibration) = device.control_calibration() else {
            return Ok(());
        };
        if let Some(modes) = device.control_mode() {
            let total = calibration.axes();
            modes.set_control_modes(Axes::All, &vec![Mode::Position; total])?;
        }
        calibration.park_robot(true)
    });
    match tokio::time::timeout(PARK_TIMEOUT, work).await {
        Ok(Ok(parked)) => parked,
        Ok(Err(panicked)) => std::panic::resume_unwind(panicked.into_panic()),
        Err(_) => Err(DeviceError::NotSupported {
            what: "parking within two minutes".to_owned(),
        }),
    }
}
