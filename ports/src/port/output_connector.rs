//! Making of outgoing connections.

use std::sync::Arc;

use yarp_wire::carrier::{Carrier, CarrierSpec, Transport};
use yarp_wire::{Contact, WireVersion};

use super::connections::Connections;
use super::dispatch::Dispatcher;
use super::in_process;
use super::log_modifier;
use super::mjpeg_client;
use super::monitor::{MonitorError, MonitorSide, is_modifier};
use super::output::{Output, Target};
use super::port_context::PortContext;
use super::port_options::Outputs;
use crate::available_carriers;
use crate::compiled_here::CompiledHere;
use crate::error::{PortError, resolve};
use crate::network::Endpoint;
use crate::port_limits;
use crate::roles::{self, Peer, Right};
use crate::version_probe;

/// Connects a port to others; has no state of its own.
pub(crate) struct Connector {
    port: Arc<PortContext>,
    connections: Arc<Connections>,
    /// Takes what arrives over connections that are made to read.
    dispatcher: Arc<Dispatcher>,
}

impl Connector {
    pub(crate) fn new(
        port: Arc<PortContext>,
        connections: Arc<Connections>,
        dispatcher: Arc<Dispatcher>,
    ) -> Self {
        Self {
            port,
            connections,
            dispatcher,
        }
    }

    /// Connects to a reader, whose name is the answer; connections to it end first. Over a carrier
    /// that does not push, connects to a writer and reads from it.
    #[inline(never)]
    pub(crate) fn connect<'a>(
        &'a self,
        to: &'a Contact,
    ) -> CompiledHere<'a, Result<String, PortError>> {
        Box::pin(self.connect_for(to, false))
    }

    /// Connects like [`Connector::connect`]; on behalf of a peer, which needs that right on the
    /// destination.
    pub(super) async fn connect_for(
        &self,
        to: &Contact,
        peer_asks: bool,
    ) -> Result<String, PortError> {
        // As in stock, an unknown port is reported first.
        let found = self.port.network.resolve(to).await?;
        let text = to.carrier.as_deref().unwrap_or(&found.carrier);
        let spec = text.parse().ok();
        if let Some(spec) = &spec
            && let Some(carrier) = available_carriers::of(spec).filter(|carrier| !carrier.push)
        {
            if peer_asks {
                self.check_right(&found, Right::Write).await?;
            }
            mjpeg_client::pull(&self.dispatcher, &found, spec, carrier).await?;
            return Ok(found.name);
        }
        if peer_asks {
            self.check_right(&found, Right::Read).await?;
        }
        let logs = spec.as_ref().map_or(Ok(false), log_modifier::is_wanted)?;
        if logs && !self.port.options.copies {
            return Err(PortError::CopiesNotAllowed {
                name: self.port.name.clone(),
            });
        }
        if peer_asks {
            self.check_output(logs)?;
        }
        if self.port.options.outputs == Outputs::None && !logs {
            return Err(PortError::OutputsNotAllowed {
                name: self.port.name.clone(),
            });
        }
        let spec = spec.ok_or_else(|| PortError::NoCarrier {
            carrier: text.to_owned(),
            known: known_carriers(),
        })?;
        let carrier = available_carriers::of(&spec).filter(|carrier| carrier.initiates);
        let carrier = carrier.ok_or_else(|| match is_modifier(&spec.base) {
            true => PortError::Modifier(MonitorError::NoCarrier {
                name: spec.base.clone(),
            }),
            false => PortError::NoCarrier {
                carrier: spec.base.clone(),
                known: known_carriers(),
            },
        })?;
        let ends = (self.port.name.as_str(), found.name.as_str());
        let monitors =
            self.dispatcher
                .monitors()
                .of_carrier(&spec.modifiers, MonitorSide::Send, ends)?;
        self.connections.disconnect(&found.name).await;
        if self.port.options.outputs == Outputs::One
            && !logs
            && !self.connections.senders().is_empty()
        {
            return Err(PortError::AlreadyConnected {
                name: self.port.name.clone(),
            });
        }
        let opened = self.open(&found, &spec, carrier, logs).await;
        let mut output = opened?.with_monitors(monitors);
        output.logs = logs;
        self.connections.add_output(output);
        Ok(found.name)
    }

    /// Makes a connection to a reader, which is not in the list yet.
    async fn open(
        &self,
        reader: &Endpoint,
        spec: &CarrierSpec,
        carrier: &'static Carrier,
        logs: bool,
    ) -> Result<Output, PortError> {
        if carrier.transport == Transport::Local {
            return in_process::connect(&self.port, reader, spec, carrier);
        }
        let address = (reader.host.as_str(), reader.port);
        let wire_version = match self.port.options.peer_version {
            Some(wire_version) => Some(wire_version),
            // Only ports of ours have the carrier, and they read both.
            None if carrier.transport == Transport::Encrypted => None,
            None if carrier.protocol.payload_kind().are_binary() => {
                version_probe::peer_version(&reader.name, address, &self.port.network).await
            }
            None => Some(WireVersion::default()),
        };
        let group = match carrier.transport {
            Transport::Group => Some(self.connections.group(reader, logs).await?),
            _ => None,
        };
        let target = Target {
            from: &self.port.name,
            to: reader,
            spec,
            carrier,
            wire_version: wire_version.unwrap_or(self.port.options.wire_version),
            group: group.as_ref(),
            network: &self.port.network,
        };
        let connected = Output::connect(&target, self.port.cancelled.clone()).await;
        if connected.is_err() {
            self.connections.release_groups().await;
        }
        connected
    }

    /// Returns whether a peer may have the port make another connection, by what kind of connection it is and how many there are.
    ///
    /// Copies of what arrives come from this port, with its name and address: whoever may send to it would have the
    /// rights of this port at the reader. So where there are roles, one must say who may connect this port.
    fn check_output(&self, logs: bool) -> Result<(), PortError> {
        let roles = self.port.network.roles();
        if logs && roles.are_any() && !roles.name(&self.port.name) {
            let name = &self.port.name;
            let text = format!(
                "not allowed: log.in of {name}, which no role in {} names",
                roles::FILE
            );
            return Err(PortError::NotAllowed { text });
        }
        let most = port_limits::outputs();
        match self.connections.outputs().len() < most {
            true => Ok(()),
            false => Err(PortError::NotAllowed {
                text: format!(
                    "not allowed: {} has {most} outgoing connections",
                    self.port.name
                ),
            }),
        }
    }

    /// Returns whether the roles give the port at `endpoint` this right on this port.
    async fn check_right(&self, endpoint: &Endpoint, right: Right) -> Result<(), PortError> {
        let roles = self.port.network.roles();
        roles.refresh();
        let address = match roles.are_any() {
            true => resolve(&endpoint.host, endpoint.port).await,
            false => return Ok(()),
        };
        let address = address.map_err(|source| {
            PortError::connect(
                &endpoint.name,
                &endpoint.host,
                "address of the host",
                source,
            )
        })?;
        let peer = Peer {
            name: &endpoint.name,
            address: address.ip(),
        };
        match self.port.rights(peer).has(right) {
            true => Ok(()),
            false => Err(PortError::NotAllowed {
                text: self.port.refusal(peer, right),
            }),
        }
    }
}

fn known_carriers() -> String {
    available_carriers::names(|carrier| carrier.initiates).join(", ")
}
