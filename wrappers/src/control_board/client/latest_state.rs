//! The newest state that has come.

use yarp_devices::DeviceError;
use yarp_devices::clock;
use yarp_ports::Received;

use super::super::messages::JointData;
use crate::device_ports::LatestValue;

/// The newest state of the board, written by its stream and read by callers.
pub(super) type LatestState = LatestValue<State>;

/// A state of the board.
#[derive(Debug)]
pub(super) struct State {
    data: JointData,
    /// Time of the measurement: seconds since the start of 1970.
    time: f64,
}

impl LatestState {
    /// Takes in a message of the feed.
    pub(super) fn take(&self, received: &Received) {
        match received.read::<JointData>() {
            Ok(data) => {
                // Stock takes its own time where the board sends none.
                let time = received.stamp().map_or_else(clock::now, |stamp| stamp.time);
                self.store(State { data, time });
            }
            Err(error) => {
                tracing::warn!(from = %received.from, "not a state of a control board: {error}");
            }
        }
    }

    /// Shows `read` the newest state and its time, if it is not too old.
    ///
    /// `what` is requested; `read` answers `None` if the board does not know it.
    pub(super) fn read_known<T>(
        &self,
        what: &'static str,
        read: impl FnOnce(&JointData, f64) -> Option<T>,
    ) -> Result<T, DeviceError> {
        let known = self.read_part(what, |state| read(&state.data, state.time))?;
        known.ok_or_else(|| DeviceError::NotSupported {
            what: format!("{what}, which the board marks invalid,"),
        })
    }
}
