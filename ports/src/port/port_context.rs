//! Name, address and options of one port, which do not change while it is open.

use std::time::Duration;

use super::port_options::PortOptions;
use crate::cancel::{Cancel, Cancelled};
use crate::network::Network;
use crate::roles::{self, Peer, Right, Rights};

/// Timeout of the close message to a reader.
pub(crate) const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);

/// The properties of an open port that all of its parts read.
pub(crate) struct PortContext {
    pub(crate) name: String,
    pub(crate) host: String,
    /// The TCP port that it listens on.
    pub(crate) number: u16,
    pub(crate) network: Network,
    pub(crate) options: PortOptions,
    pub(crate) cancelled: Cancelled,
    /// Triggered when the port begins to close; `cancelled` follows after its peers have been
    /// notified.
    pub(crate) closing: Cancelled,
    close: Cancel,
}

impl PortContext {
    pub(crate) fn new(
        name: String,
        host: String,
        number: u16,
        network: Network,
        options: PortOptions,
        cancelled: Cancelled,
    ) -> Self {
        let (close, closing) = Cancel::new();
        Self {
            name,
            host,
            number,
            network,
            options,
            cancelled,
            closing,
            close,
        }
    }

    /// Returns what the roles in force let `peer` have this port do.
    pub(crate) fn rights(&self, peer: Peer<'_>) -> Rights {
        let roles = self.network.roles();
        let Some(administered) = &self.options.administered_port else {
            return roles.rights_at_port(&self.name, peer);
        };
        match roles.rights(administered, peer).has(Right::Administer) {
            true => Rights::ALL,
            false => Rights::NONE,
        }
    }

    /// Returns the refusal for a peer without a right.
    pub(crate) fn refusal(&self, peer: Peer<'_>, right: Right) -> String {
        match &self.options.administered_port {
            Some(administered) => roles::refusal(administered, peer, Right::Administer),
            None => roles::refusal(&self.name, peer, right),
        }
    }

    /// Triggers [`PortContext::closing`].
    pub(crate) fn close(&self) {
        self.close.cancel();
    }
}

/// Returns whether a sender's name is that of a port.
pub(crate) fn is_port(name: &str) -> bool {
    name.starts_with('/')
}
