//! Servers of control boards.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_ports::Network;
use yarp_wire::PortName;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer, OpenError, StopServer};

use super::attached_server::{AttachedServer, Choice, Server, check_period, single};
use super::board_remapper::Mapping;
use super::{OpenResult, Opening};
use crate::{Attached, Future, HostError};

pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let period = opening.parameters.get::<Duration>("period")?;
    with_period(opening, period, "0.001 to 60 seconds", None)
}

/// Opens a server with the parameters of stock's `controlboardwrapper2`: the period is a whole
/// number of milliseconds, and `networks` combine several devices.
pub(super) async fn open_old(opening: Opening<'_>) -> OpenResult {
    let period = opening.parameters.get::<usize>("period")?;
    let period = period.map(|period| Duration::from_millis(period as u64));
    let networks = match opening.parameters.has("networks") {
        true => Mapping::read(opening.parameters)?,
        false => None,
    };
    with_period(opening, period, "1 to 60000 milliseconds", networks)
}

fn with_period(
    opening: Opening<'_>,
    period: Option<Duration>,
    expected: &str,
    networks: Option<Mapping>,
) -> OpenResult {
    let parameters = opening.parameters;
    let name: PortName = parameters.need("name")?;
    let mut options = ControlBoardOptions::new();
    if let Some(period) = period {
        options = options.period(check_period(parameters, period, expected)?);
    }
    let server = AttachedServer::<StoppableBoard, _>::boxed;
    Ok(server(
        opening,
        name.to_string(),
        options,
        Boards { networks },
    ))
}

/// The server of a control board, with the software stop of the device beside it if the device has one.
struct StoppableBoard {
    board: ControlBoardServer,
    stop: Option<StopServer>,
}

impl Server for StoppableBoard {
    type Options = ControlBoardOptions;

    async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
        options: ControlBoardOptions,
    ) -> Result<Self, OpenError> {
        let board = ControlBoardServer::open(network, device.clone(), name, options).await?;
        if device.software_stop().is_none() {
            return Ok(Self { board, stop: None });
        }
        match StopServer::open(network, device, name).await {
            Ok(stop) => Ok(Self {
                board,
                stop: Some(stop),
            }),
            Err(error) => {
                board.close().await;
                Err(error)
            }
        }
    }

    /// Closes the ports; the stop is there until commands are refused.
    async fn close(self) {
        self.board.close().await;
        if let Some(stop) = self.stop {
            stop.close().await;
        }
    }
}

/// The board that a server serves: that of a single device, or of several.
struct Boards {
    /// Selection of joints, if it combines several devices.
    networks: Option<Mapping>,
}

impl Choice for Boards {
    fn choose(&mut self, others: Vec<Attached>) -> Future<'_, Result<Arc<dyn Device>, HostError>> {
        Box::pin(async move {
            match &self.networks {
                Some(networks) => Ok(networks.apply(others).await? as Arc<dyn Device>),
                None => single_board(&others),
            }
        })
    }
}

/// Returns the board of a single device.
fn single_board(others: &[Attached]) -> Result<Arc<dyn Device>, HostError> {
    let other = single(others)?;
    let board = other.parts.board.clone();
    board.ok_or_else(|| HostError::Unsuitable {
        device: other.device.clone(),
        expected: "a device with joints",
    })
}
