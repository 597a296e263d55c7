//! Names, carrier and timeouts.

use std::time::Duration;

use yarp_wire::WireVersion;

use crate::device_ports::{RemoteOptions, common_setters};

/// Options of a remote control board; the names are those of stock's parameters.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteControlBoardOptions {
    pub(super) common: RemoteOptions,
    pub(super) ignores_protocol: bool,
    pub(super) wire_version: Option<WireVersion>,
}

impl RemoteControlBoardOptions {
    /// The board named `remote`, by ports that begin with `local`: `/wam` and, for instance, `/me/wam`.
    ///
    /// Commands and state travel over `fast_tcp`, a state is trusted for 0.5 s, an answer is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            common: RemoteOptions::new(remote, local).max_state_age(Duration::from_millis(500)),
            ignores_protocol: false,
            wire_version: None,
        }
    }

    common_setters! {
        /// Sets the carrier for commands and state (stock: `carrier`, by default `udp`). Queries always go over `tcp`.
        carrier(carrier: impl Into<String>);
        /// Sets the maximum age of the newest state (stock: `timeout`, as here 0.5 s).
        max_state_age(age: Duration);
        /// Sets the timeout of a reply and of each step of opening. Stock waits for ever.
        rpc_timeout(timeout: Duration);
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
