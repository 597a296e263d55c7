//! A port for torques that another program computes, with the parameters of stock's `virtualAnalogServer`.
//!
//! `networks (left wrist)` names the boards, and for each `left (0 3 0 3)` its channels: first and last of the port, first
//! and last of the board. Source: `VirtualAnalogWrapper.cpp` of YARP 3.5.

use std::sync::Arc;

use yarp_devices::Device;
use yarp_ports::Network;
use yarp_wire::PortName;
use yarp_wire::settings::{Origin, Parameters};
use yarp_wrappers::{VirtualNetwork, VirtualSensorServer};

use super::attached_server::not_opened;
use super::{OpenResult, Opening};
use crate::{Attached, Future, HostError, Hosted};

/// Maximum number of networks.
const MAX_NETWORKS: usize = 64;
/// Last channel that a network can have, as in stock.
const LAST_CHANNEL: usize = 254;

/// Opens a server, whose port is open while it is attached.
pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let name: PortName = parameters.need("name")?;
    let networks = networks(parameters)?;
    // The number of all channels, which stock does not read either.
    parameters.has("channels");
    Ok(Box::new(TorqueServer {
        network: opening.network.clone(),
        name: name.to_string(),
        networks,
        origin: parameters.origin().clone(),
        device: parameters.device().to_owned(),
        running: None,
    }))
}

fn networks(parameters: &Parameters) -> Result<Vec<VirtualNetwork>, HostError> {
    let names = parameters.list::<String>("networks")?.unwrap_or_default();
    if !(1..=MAX_NETWORKS).contains(&names.len()) {
        let expected = format!("the names of 1 to {MAX_NETWORKS} networks");
        return Err(parameters.refuse("networks", expected).into());
    }
    let mut networks = Vec::with_capacity(names.len());
    for name in names {
        let expected = format!(
            "first and last channel of the port, first and last of the board, up to {LAST_CHANNEL}"
        );
        let row = parameters.list::<usize>(&name)?.unwrap_or_default();
        let [first, last, board_first, board_last] = row[..] else {
            return Err(parameters.refuse(&name, expected).into());
        };
        let is_range = |first, last| first <= last && last <= LAST_CHANNEL;
        if !is_range(first, last) || !is_range(board_first, board_last) {
            return Err(parameters.refuse(&name, expected).into());
        }
        networks.push(VirtualNetwork {
            name,
            channels: (first, last),
            board: (board_first, board_last),
        });
    }
    Ok(networks)
}

struct TorqueServer {
    network: Network,
    name: String,
    networks: Vec<VirtualNetwork>,
    /// Origin and name of the device, for errors.
    origin: Origin,
    device: String,
    running: Option<VirtualSensorServer>,
}

impl TorqueServer {
    /// Returns the board of each network.
    fn boards(&self, others: &[Attached]) -> Result<Vec<Arc<dyn Device>>, HostError> {
        let board = |network: &VirtualNetwork| {
            let mut named = others.iter().filter(|other| other.network == network.name);
            let other = named.next().ok_or_else(|| HostError::NoNetwork {
                origin: self.origin.clone(),
                device: self.device.clone(),
                network: network.name.clone(),
            })?;
            let parts = [&other.parts.board, &other.parts.channels];
            let mut boards = parts.into_iter().flatten();
            let board = boards.find(|board| board.virtual_sensor().is_some());
            board.cloned().ok_or_else(|| HostError::Unsuitable {
                device: other.device.clone(),
                expected: "a board that takes torques from outside",
            })
        };
        self.networks.iter().map(board).collect()
    }
}

impl Hosted for TorqueServer {
    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            if self.running.is_some() {
                return Err(HostError::Attached);
            }
            let boards = self.boards(&others)?;
            let opening =
                VirtualSensorServer::open(&self.network, boards, &self.name, &self.networks);
            let opened = opening.await;
            let opened = opened.map_err(|source| not_opened(&self.origin, &self.device, source))?;
            self.running = Some(opened);
            Ok(())
        })
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            if let Some(running) = self.running.take() {
                running.close().await;
            }
            Ok(())
        })
    }

    fn close(mut self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async move {
            if let Some(running) = self.running.take() {
                running.close().await;
            }
        })
    }
}
