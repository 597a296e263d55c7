//! Addresses at which the ports of a command listen, and the hosts that can reach them.

use std::net::{IpAddr, Ipv4Addr};

use yarp_ports::Network;
use yarp_ports::roles::{Peer, Right};
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

/// A peer with an address that is in no network, reserved for documentation (RFC 5737).
pub(crate) const UNKNOWN_PEER: Peer<'static> = Peer {
    name: "/unknown",
    address: IpAddr::V4(Ipv4Addr::new(192, 0, 2, 255)),
};

/// Ports of devices that take motion commands, below the name of the device.
const COMMAND_PORTS: [&str; 2] = ["rpc:i", "command:i"];

/// Warns if any other host may move a device; `name` is what the user calls it.
pub(crate) fn warn_if_open(network: &Network, name: &str) {
    let address = network.listen_address();
    let roles = network.roles();
    let is_open = |port: &&str| {
        let port = format!("{name}/{port}");
        roles.rights(&port, UNKNOWN_PEER).has(Right::Write)
    };
    let open_port = COMMAND_PORTS.iter().find(|port| is_open(port));
    if let Some(port) = open_port
        && !address.is_loopback()
        && network.key().is_none()
    {
        tracing::warn!(
            "{name} moves, and any host that reaches {address} can move it: add a key (auth.conf) or a role that names \
             {name}/{port} (roles.conf), or listen on this machine alone with --bind 127.0.0.1"
        );
    }
}
