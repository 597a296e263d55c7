//! Joints on ports.

use std::time::Duration;

use yarp_ports::Network;
use yarp_wire::PortName;
use yarp_wire::settings::Origin;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

use super::{Opening, Outcome};
use crate::{Attached, Future, HostError, Hosted};

pub(super) async fn open(opening: Opening<'_>) -> Outcome {
    let parameters = opening.parameters;
    let name: PortName = parameters.need("name")?;
    let mut options = ControlBoardOptions::new();
    if let Some(period) = parameters.get::<Duration>("period")? {
        if !(0.001..=60.0).contains(&period.as_secs_f64()) {
            return Err(parameters.refuse("period", "0.001 to 60 seconds").into());
        }
        options = options.period(period);
    }
    Ok(Box::new(Server {
        network: opening.network.clone(),
        name: name.to_string(),
        options,
        device: parameters.device().to_owned(),
        origin: parameters.origin().clone(),
        running: None,
    }))
}

/// Its ports are open while it is attached.
struct Server {
    network: Network,
    name: String,
    options: ControlBoardOptions,
    device: String,
    origin: Origin,
    running: Option<ControlBoardServer>,
}

impl Hosted for Server {
    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            if self.running.is_some() {
                return Err(HostError::Attached);
            }
            let [other] = &others[..] else {
                return Err(HostError::Several { got: others.len() });
            };
            let board = other.parts.board.clone();
            let board = board.ok_or_else(|| HostError::Unsuitable {
                device: other.device.clone(),
                expected: "a device with joints",
            })?;
            let options = self.options.clone();
            let opened = ControlBoardServer::open(&self.network, board, &self.name, options);
            let running = opened.await.map_err(|source| HostError::Open {
                origin: self.origin.clone(),
                device: self.device.clone(),
                source,
            })?;
            self.running = Some(running);
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
