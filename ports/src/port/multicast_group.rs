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
    /// Destination of its datagrams.
    pub(crate) address: SocketAddrV4,
    /// The address of the interface that they go out of.
    pub(crate) local: Ipv4Addr,
    /// `true` if the group carries copies of received messages instead of the owner's messages.
    pub(crate) logs: bool,
}

impl Group {
    /// Requests a group for the port `owner` from the name server, on the interface with address
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
        // The group is freed with its owner even if the owner cannot unregister it.
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
