//! The software stop of several devices.

use super::Remapper;
use super::axis_mapping::RemappedDevice;
use crate::{DeviceError, SoftwareStop, StopState};

impl Remapper {
    /// Returns true if every device has a software stop: a stop that leaves some of them moving would be none.
    pub(super) fn can_stop(&self) -> bool {
        self.parts
            .iter()
            .all(|part| part.device.software_stop().is_some())
    }

    fn stops(&self) -> impl Iterator<Item = (&RemappedDevice, &dyn SoftwareStop)> {
        self.parts
            .iter()
            .filter_map(|part| Some((part, part.device.software_stop()?)))
    }

    /// Sends a command to every device, even if others fail, and returns the first error.
    fn stop_each(
        &self,
        command: impl Fn(&dyn SoftwareStop) -> Result<(), DeviceError>,
    ) -> Result<(), DeviceError> {
        let mut outcome = Ok(());
        for (part, stop) in self.stops() {
            let done = command(stop).map_err(|error| part.refused(error));
            outcome = outcome.and(done);
        }
        outcome
    }
}

/// Stops, brakes and releases whole devices, with the joints that are not on this board too.
impl SoftwareStop for Remapper {
    fn stop_motion(&self) -> Result<(), DeviceError> {
        self.stop_each(|stop| stop.stop_motion())
    }

    fn brake(&self) -> Result<(), DeviceError> {
        self.stop_each(|stop| stop.brake())
    }

    fn release(&self) {
        self.stops().for_each(|(_, stop)| stop.release());
    }

    /// Returns the least of the states: the board is stopped once all devices are.
    fn stop_state(&self) -> StopState {
        let states = self.stops().map(|(_, stop)| stop.stop_state());
        states
            .min_by_key(|state| *state as u8)
            .unwrap_or(StopState::Released)
    }
}
