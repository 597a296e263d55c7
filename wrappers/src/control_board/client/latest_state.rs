//! The newest state that has come.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use yarp_devices::DeviceError;
use yarp_ports::Received;

use super::super::messages::JointData;
use yarp_devices::clock::wall_clock;

/// The newest state of the board, written by its stream and read by callers.
#[derive(Debug)]
pub(super) struct LatestState {
    state: Mutex<Option<State>>,
    max_age: Duration,
    begun: Instant,
}

#[derive(Debug)]
struct State {
    data: JointData,
    /// Time of the measurement: seconds since the start of 1970.
    time: f64,
    /// Time of arrival.
    arrived: Instant,
}

impl LatestState {
    /// A state is max_age until it is `max_age` old.
    pub(super) fn new(max_age: Duration) -> Self {
        Self {
            state: Mutex::default(),
            max_age,
            begun: Instant::now(),
        }
    }

    /// Takes in a message of the feed.
    pub(super) fn take(&self, received: &Received) {
        let data = match received.read::<JointData>() {
            Ok(data) => data,
            Err(error) => {
                tracing::warn!(from = %received.from, "not a state of a control board: {error}");
                return;
            }
        };
        let time = match received.stamp() {
            Some(stamp) => stamp.time,
            // Stock takes its own time where the board sends none.
            None => wall_clock(),
        };
        let state = State {
            data,
            time,
            arrived: Instant::now(),
        };
        *self.state.lock().unwrap_or_else(PoisonError::into_inner) = Some(state);
    }

    /// Returns whether no state has been received for so long.
    pub(super) fn is_older_than(&self, age: Duration) -> bool {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let arrived = state.as_ref().map_or(self.begun, |state| state.arrived);
        arrived.elapsed() > age
    }

    /// Shows `read` the newest state and its time, if it is max_age.
    ///
    /// `what` is requested; `read` answers `None` if the board does not know it.
    pub(super) fn read<T>(
        &self,
        what: &'static str,
        read: impl FnOnce(&JointData, f64) -> Option<T>,
    ) -> Result<T, DeviceError> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let state = state.as_ref().ok_or(DeviceError::NoDataYet { what })?;
        let age = state.arrived.elapsed();
        if age > self.max_age {
            return Err(DeviceError::Stale {
                what,
                age,
                limit: self.max_age,
            });
        }
        read(&state.data, state.time).ok_or_else(|| DeviceError::NotSupported {
            what: format!("{what}, which the board marks invalid,"),
        })
    }
}
