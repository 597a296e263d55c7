//! Addresses at which the ports of a command listen, and the hosts that can reach them.

use std::net::Ipv4Addr;

use yarp_ports::Network;
use yarp_wire::settings::Settings;

/// The option of every command that serves a device.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub(crate) struct BindArgs {
    /// Address of this machine that ports listen at; 0.0.0.0 is all. Usually all, or 127.0.0.1 if the name server is there
    #[arg(long, value_name = "ADDRESS")]
    bind: Option<Ipv4Addr>,
}

impl BindArgs {
    /// Takes the option from words that are read as settings. The error says what was expected.
    pub(crate) fn from_settings(settings: &Settings) -> Result<Self, String> {
        let Some(text) = settings.get("bind").map(|text| text.to_plain_string()) else {
            return match settings.has("bind") {
                true => Err(expected("")),
                false => Ok(Self::default()),
            };
        };
        match text.parse() {
            Ok(address) => Ok(Self {
                bind: Some(address),
            }),
            Err(_) => Err(expected(&text)),
        }
    }

    /// Returns the address that was asked for.
    pub(crate) fn address(self) -> Option<Ipv4Addr> {
        self.bind
    }

    /// Returns the network with ports that listen where the option says.
    pub(crate) fn apply(self, network: Network) -> Network {
        match self.bind {
            Some(address) => network.with_bind(address),
            None => network,
        }
    }
}

fn expected(text: &str) -> String {
    format!("--bind {text}: expected an IPv4 address of this machine, or 0.0.0.0 for all")
}

/// Warns if a device that moves can be reached from other hosts by anybody; `name` is what the user calls it.
pub(crate) fn warn_if_open(network: &Network, name: &str) {
    let address = network.listen_address();
    if !address.is_loopback() && network.key().is_none() && !network.roles().are_any() {
        tracing::warn!(
            "{name} moves, and whoever reaches {address} can move it: add a key (auth.conf) or roles (roles.conf), or \
             listen on this machine alone with --bind 127.0.0.1"
        );
    }
}
