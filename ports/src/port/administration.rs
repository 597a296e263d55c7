//! Administration of one port: what peers ask of the port itself.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use yarp_wire::Bottle;

use super::connections::Connections;
use super::dispatch::Dispatcher;
use super::output_connector::Connector;
use super::port_context::PortContext;

/// Answers admin requests and text commands; holds the properties that peers set.
///
/// The requests are in `admin_commands.rs`, those about sockets and threads in `socket_qos.rs`, the
/// text commands in `text_commands.rs`.
pub(crate) struct Administration {
    pub(super) port: Arc<PortContext>,
    pub(super) connections: Arc<Connections>,
    pub(super) dispatcher: Arc<Dispatcher>,
    pub(super) connector: Arc<Connector>,
    properties: Mutex<Vec<(String, Bottle)>>,
}

impl Administration {
    pub(crate) fn new(
        port: Arc<PortContext>,
        connections: Arc<Connections>,
        dispatcher: Arc<Dispatcher>,
        connector: Arc<Connector>,
    ) -> Self {
        Self {
            port,
            connections,
            dispatcher,
            connector,
            properties: Mutex::default(),
        }
    }

    /// Returns the properties that peers have set, sorted by key.
    pub(super) fn properties(&self) -> MutexGuard<'_, Vec<(String, Bottle)>> {
        self.properties
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}
