//! Names, carrier and timeouts.

use std::time::Duration;

use crate::device_ports::{RemoteOptions, common_setters};

/// Options of a [`RemoteGazeControl`](super::RemoteGazeControl).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteGazeOptions {
    pub(super) common: RemoteOptions,
}

impl RemoteGazeOptions {
    /// The controller named `remote`, by ports named after `local`: `/iKinGazeCtrl` and, for instance, `/me/gaze`.
    ///
    /// Streams, events and targets travel over `udp` as stock's do, the maximum age of a fixation point and of a direction
    /// is 100 ms, the timeout of a reply 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            common: RemoteOptions::new(remote, local)
                .carrier("udp")
                .max_state_age(Duration::from_millis(100)),
        }
    }

    common_setters! {
        /// Sets the carrier for streams, events and targets (stock: `carrier`). Requests always go over `tcp`.
        carrier(carrier: impl Into<String>);
        /// Sets the maximum age of the newest message of a stream (stock: `timeout`).
        max_state_age(age: Duration);
        /// Sets the timeout of a reply and of each step of opening. Stock waits for ever.
        rpc_timeout(timeout: Duration);
    }
}
