//! Parks the joints of a device before it is closed.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::{Axes, Device, DeviceError, Mode};

/// Timeout for parking.
const PARK_TIMEOUT: Duration = Duration::from_secs(120);

/// Parks all joints of a device and waits for completion. Cancelling does not stop the joints.
///
/// Joints in a streaming mode are switched to position mode first. A device without parking is left
/// unchanged.
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
