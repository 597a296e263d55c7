//! The parts of one port, as its tasks share them.

use std::sync::Arc;

use super::administration::Administration;
use super::connections::Connections;
use super::dispatch::Dispatcher;
use super::output_connector::Connector;
use super::port_context::PortContext;

/// A port: its connections, the dispatch of arriving messages, and its administration.
///
/// Each part holds those that it uses, in the order of the fields: a later one may use the earlier
/// ones, and none a later one.
pub(crate) struct Parts {
    pub(crate) context: Arc<PortContext>,
    pub(crate) connections: Arc<Connections>,
    pub(crate) dispatcher: Arc<Dispatcher>,
    pub(crate) connector: Arc<Connector>,
    pub(crate) administration: Administration,
}

impl Parts {
    pub(crate) fn new(context: PortContext) -> Self {
        let context = Arc::new(context);
        let connections = Arc::new(Connections::new(context.clone()));
        let dispatcher = Arc::new(Dispatcher::new(context.clone(), connections.clone()));
        let connector = Arc::new(Connector::new(
            context.clone(),
            connections.clone(),
            dispatcher.clone(),
        ));
        let administration = Administration::new(
            context.clone(),
            connections.clone(),
            dispatcher.clone(),
            connector.clone(),
        );
        Self {
            context,
            connections,
            dispatcher,
            connector,
            administration,
        }
    }
}
