//! Names, carrier and timeouts.

use std::time::Duration;

use yarp_ports::Network;

use crate::OpenError;
use crate::open_ports::port_name;
use crate::reconnect::check_exists;

/// Options of a client of a device.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteOptions {
    pub(crate) remote: String,
    pub(crate) local: String,
    pub(crate) carrier: String,
    pub(crate) max_state_age: Duration,
    pub(crate) rpc_timeout: Duration,
}

impl RemoteOptions {
    /// The device named `remote`, by ports that begin with `local`: `/battery` and, for instance, `/me/battery`.
    ///
    /// Streams travel over `fast_tcp`, a value is trusted for 5 s, a reply is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            remote: remote.into(),
            local: local.into(),
            carrier: "fast_tcp".to_owned(),
            max_state_age: Duration::from_secs(5),
            rpc_timeout: Duration::from_secs(2),
        }
    }

    /// Sets the carrier of streams (stock: `carrier`). Queries always go over `tcp`.
    pub fn carrier(mut self, carrier: impl Into<String>) -> Self {
        self.carrier = carrier.into();
        self
    }

    /// Sets the maximum age of the newest value.
    pub fn max_state_age(mut self, age: Duration) -> Self {
        self.max_state_age = age;
        self
    }

    /// Sets the timeout of a reply and of each step of opening. Stock waits for ever.
    pub fn rpc_timeout(mut self, timeout: Duration) -> Self {
        self.rpc_timeout = timeout;
        self
    }

    /// Returns the name of a port of the server: `REMOTE/SUFFIX`, or `REMOTE` if the suffix is empty.
    pub(crate) fn remote_port(&self, suffix: &str) -> String {
        port_name(&self.remote, suffix)
    }

    /// Returns an error unless the server has these ports. Called before the client opens its own: usually the server
    /// is just not running.
    pub(crate) async fn check_remote(
        &self,
        network: &Network,
        suffixes: &[&str],
    ) -> Result<(), OpenError> {
        for suffix in suffixes {
            check_exists(network, self.remote_port(suffix)).await?;
        }
        Ok(())
    }
}

/// Makes setters of options that are also [`RemoteOptions`], in the field `common`.
macro_rules! common_setters {
    ($($(#[$doc:meta])+ $setter:ident($value:ident: $kind:ty);)+) => {
        $(
            $(#[$doc])+
            pub fn $setter(mut self, $value: $kind) -> Self {
                self.common = self.common.$setter($value);
                self
            }
        )+
    };
}

pub(crate) use common_setters;
