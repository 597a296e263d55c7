//! Names, carrier and timeouts.

use std::time::Duration;

use yarp_wire::WireVersion;

/// Options of a remote control board; the names are those of stock's parameters.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteControlBoardOptions {
    pub(super) remote: String,
    pub(super) local: String,
    pub(super) carrier: String,
    pub(super) max_state_age: Duration,
    pub(super) rpc_timeout: Duration,
    pub(super) ignores_protocol: bool,
    pub(super) wire_version: Option<WireVersion>,
}

impl RemoteControlBoardOptions {
    /// The board named `remote`, by ports that begin with `local`: `/wam` and, for instance, `/me/wam`.
    ///
    /// Commands and state travel over `fast_tcp`, a state is trusted for 0.5 s, an answer is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            remote: remote.into(),
            local: local.into(),
            carrier: "fast_tcp".to_owned(),
            max_state_age: Duration::from_millis(500),
            rpc_timeout: Duration::from_secs(2),
            ignores_protocol: false,
            wire_version: None,
        }
    }

    /// The carrier for commands and state (stock: `carrier`, by default `udp`). Questions always go over `tcp`.
    pub fn carrier(mut self, carrier: impl Into<String>) -> Self {
        self.carrier = carrier.into();
        self
    }

    /// Sets the maximum age of the newest state (stock: `timeout`, as here 0.5 s).
    pub fn max_state_age(mut self, age: Duration) -> Self {
        self.max_state_age = age;
        self
    }

    /// Sets the max_state_age of a reply and of each step of opening. Stock waits for ever.
    pub fn rpc_timeout(mut self, rpc_timeout: Duration) -> Self {
        self.rpc_timeout = rpc_timeout;
        self
    }

    /// Accepts a board with another version of the protocol (stock: `ignoreProtocolCheck`).
    pub fn ignore_protocol_version(mut self) -> Self {
        self.ignores_protocol = true;
        self
    }

    /// Speaks as this wire version does, instead of finding out which the board is of. A board that serves both is
    /// spoken to as 4.0 otherwise.
    pub fn wire_version(mut self, wire_version: WireVersion) -> Self {
        self.wire_version = Some(wire_version);
        self
    }
}
