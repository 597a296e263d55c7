//! Servers of control boards.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_ports::Network;
use yarp_wire::PortName;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

use super::attached_server::{AttachedServer, check_period};
use super::board_remapper::Mapping;
use super::{OpenResult, Opening};
use crate::{Attached, Future, HostError, Hosted};

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
    Ok(Box::new(Server {
        network: opening.network.clone(),
        name: name.to_string(),
        options,
        networks,
        ports: AttachedServer::of(parameters),
    }))
}

/// A server whose ports are open while it is attached.
struct Server {
    network: Network,
    name: String,
    options: ControlBoardOptions,
    /// Selection of joints, if it combines several devices.
    networks: Option<Mapping>,
    ports: AttachedServer<ControlBoardServer>,
}

impl Hosted for Server {
    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            self.ports.check_free()?;
            let board: Arc<dyn Device> = match &self.networks {
                Some(networks) => networks.apply(others).await?,
                None => single_board(others)?,
            };
            let options = self.options.clone();
            let opening = ControlBoardServer::open(&self.network, board, &self.name, options);
            self.ports.open(opening).await
        })
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            self.ports.close().await;
            Ok(())
        })
    }

    fn close(mut self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async move { self.ports.close().await })
    }
}

/// Returns the board of a single device.
fn single_board(others: Vec<Attached>) -> Result<Arc<dyn Device>, HostError> {
    let [other] = &others[..] else {
        return Err(HostError::Several { got: others.len() });
    };
    let board = other.parts.board.clone();
    board.ok_or_else(|| HostError::Unsuitable {
        device: other.device.clone(),
        expected: "a device with joints",
    })
}
