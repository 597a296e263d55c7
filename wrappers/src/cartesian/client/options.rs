//! Names, carrier and timeouts.

use std::time::Duration;

/// Options of a [`RemoteCartesianControl`](super::RemoteCartesianControl).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteCartesianOptions {
    pub(super) remote: String,
    pub(super) local: String,
    pub(super) carrier: String,
    pub(super) max_state_age: Duration,
    pub(super) rpc_timeout: Duration,
}

impl RemoteCartesianOptions {
    /// The controller named `remote`, by ports named after `local`: `/cartController/wam` and, for instance, `/me/tool`.
    ///
    /// Poses, events and commands travel over `udp` as stock's do, the maximum age of a pose is 100 ms, the max_state_age
    /// of a reply 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            remote: remote.into(),
            local: local.into(),
            carrier: "udp".to_owned(),
            max_state_age: Duration::from_millis(100),
            rpc_timeout: Duration::from_secs(2),
        }
    }

    /// The carrier for poses, events and commands (stock: `carrier`). Questions always go over `tcp`.
    pub fn carrier(mut self, carrier: impl Into<String>) -> Self {
        self.carrier = carrier.into();
        self
    }

    /// Sets the maximum age of the newest pose (stock: `timeout`).
    pub fn max_state_age(mut self, age: Duration) -> Self {
        self.max_state_age = age;
        self
    }

    /// Sets the max_state_age of a reply and of each step of opening. Stock waits for ever.
    pub fn rpc_timeout(mut self, rpc_timeout: Duration) -> Self {
        self.rpc_timeout = rpc_timeout;
        self
    }
}
