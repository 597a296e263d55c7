//! The multicast groups of a port: one transmission for all its `mcast` readers in a network.

use std::net::{Ipv4Addr, SocketAddrV4};

use yarp_wire::name_service::RegisterRequest;

use crate::error::PortError;
use crate::network::Network;

/// A group that the name server has given to a port.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) struct Group {
    /// The name under which the group is registered.
    pub(crate) name: String,
    /// Where its datagrams go.
    pub(crate) address: SocketAddrV4,
    /// The address of the interface that they go out of.
    pub(crate) local: Ipv4Addr,
    /// Whether copies of what arrives go there, instead of what the owner writes.
    pub(crate) logs: bool,
}

impl Group {
    /// Asks the name server for a group for the port `owner`, out of the interface with address
    /// `local`, for copies or for messages.
    pub(crate) async fn allocate(
        network: &Network,
        owner: &str,
        local: Ipv4Addr,
        logs: bool,
    ) -> Result<Self, PortError> {
        let asking = RegisterRequest {
            carrier: Some("mcast".to_owned()),
            ..RegisterRequest::named("...")
        };
        let given = network.register_one(asking).await?;
        let ip: Ipv4Addr = given.host.parse().map_err(|_| PortError::Refused {
            server: network.server_text(),
            request: "register ... mcast".to_owned(),
            answer: given.to_string(),
        })?;
        // So that the group goes with its owner even if the owner cannot say goodbye.
        network
            .ask(&format!("bot set {owner} owns {}", given.name))
            .await?;
        Ok(Self {
            name: given.name,
            address: SocketAddrV4::new(ip, given.port),
            local,
            logs,
        })
    }
}
