//! The port that tells which devices a robot has, with the parameters of stock's `robotDescription_nws_yarp`.

use std::sync::PoisonError;

use yarp_ports::Port;
use yarp_wire::PortName;
use yarp_wrappers::OpenError;

use super::attached_server::{not_opened, single};
use super::{OpenResult, Opening};
use crate::robot::{SharedDescriptions, open_description_port};
use crate::{Attached, Future, HostError, Hosted};

/// Stock's default.
const DEFAULT_PORT_NAME: &str = "/robotDescriptionServer/rpc";

pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let name: Option<PortName> = parameters.get("local")?;
    let name = name.map_or_else(|| DEFAULT_PORT_NAME.to_owned(), |name| name.to_string());
    let devices = SharedDescriptions::default();
    let port = open_description_port(opening.network, &name, devices.clone()).await;
    let port = port.map_err(|source| {
        let source = OpenError::Port { name, source };
        not_opened(parameters.origin(), parameters.device(), source)
    })?;
    Ok(Box::new(DescriptionServer { port, devices }))
}

struct DescriptionServer {
    port: Port,
    devices: SharedDescriptions,
}

impl Hosted for DescriptionServer {
    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            let other = single(&others)?;
            let devices = other.parts.robot.clone();
            let devices = devices.ok_or_else(|| HostError::Unsuitable {
                device: other.device.clone(),
                expected: "yriDescriptionStorage, the devices of the robot",
            })?;
            *self.devices.lock().unwrap_or_else(PoisonError::into_inner) = Some(devices);
            Ok(())
        })
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            *self.devices.lock().unwrap_or_else(PoisonError::into_inner) = None;
            Ok(())
        })
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async move { self.port.close().await })
    }
}
