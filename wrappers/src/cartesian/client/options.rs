//! Whom to call, as whom, and how long to wait.

use std::time::Duration;

/// How a [`RemoteCartesianControl`](super::RemoteCartesianControl) is opened.
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
    /// Poses, events and orders travel over `udp` as stock's do, a pose is trusted for 100 ms, an answer is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            remote: remote.into(),
            local: local.into(),
            carrier: "udp".to_owned(),
            max_state_age: Duration::from_millis(100),
            rpc_timeout: Duration::from_secs(2),
        }
    }

    /// The carrier for poses, events and orders (stock: `carrier`). Questions always go over `tcp`.
    pub fn carrier(mut self, carrier: impl Into<String>) -> Self {
        self.carrier = carrier.into();
        self
    }

    /// How old the newest pose may be to be trusted (stock: `timeout`).
    pub fn max_state_age(mut self, age: Duration) -> Self {
        self.max_state_age = age;
        self
    }

    /// How long an answer, or each step of opening, is waited for. Stock waits for ever.
    pub fn rpc_timeout(mut self, rpc_timeout: Duration) -> Self {
        self.rpc_timeout = rpc_timeout;
        self
    }
}
