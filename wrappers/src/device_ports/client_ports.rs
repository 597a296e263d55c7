//! A client: its ports, their connections, calls, closing.

use std::error::Error;
use std::fmt::Display;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tokio::task::JoinSet;
use yarp_devices::DeviceError;
use yarp_ports::remote_admin::{self, ConnectError};
use yarp_ports::{Answer, Network, Port, PortError, PortOptions, Received, ReconnectingConnection};
use yarp_wire::Bottle;
use yarp_wire::message::{ReadObject, WireObject};

use super::{LatestValue, Link, RemoteOptions};
use crate::OpenError;
use crate::open_ports::{close_all, open_all, port_name};
use crate::reconnect::{
    Missing, PORT_CLOSE_TIMEOUT, RPC_CARRIER, Turn, WATCH_INTERVAL, connect_supervised, subscribe,
    to_text,
};

/// Attempts to ask for events again after the stream beside them was asked for.
const EVENT_ATTEMPTS: usize = 4;

/// Names of a client's port for calls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RpcPort {
    /// Suffix of the client's port.
    pub(crate) local: &'static str,
    /// Suffix of the server's port.
    pub(crate) remote: &'static str,
}

impl RpcPort {
    /// The names that most of stock's devices have.
    pub(crate) const USUAL: Self = Self {
        local: "rpc:o",
        remote: "rpc:i",
    };
}

/// The ports of a client and their connections, which are made again when they are lost.
///
/// Ports are named by their index in the order of opening.
#[derive(Debug)]
pub(crate) struct RemotePorts {
    network: Network,
    options: RemoteOptions,
    /// Kind of device, for errors.
    device: &'static str,
    ports: Vec<Port>,
    /// Index of the port for calls.
    rpc: usize,
    rpc_peer: String,
    kept: Vec<ReconnectingConnection>,
    /// Asks the server for its streams again; ends with the ports.
    asking: JoinSet<()>,
}

impl RemotePorts {
    /// Opens ports `LOCAL/SUFFIX` (or `LOCAL`), in this order, one of them `rpc`; all of them, or none.
    ///
    /// Errors: [`OpenError::NameTaken`], [`OpenError::Port`].
    pub(crate) async fn open(
        network: &Network,
        options: &RemoteOptions,
        device: &'static str,
        rpc: RpcPort,
        wanted: Vec<(&'static str, PortOptions)>,
    ) -> Result<Self, OpenError> {
        let calls = wanted.iter().position(|(suffix, _)| *suffix == rpc.local);
        let wanted = wanted
            .into_iter()
            .map(|(suffix, port)| (port_name(&options.local, suffix), port));
        Ok(Self {
            ports: open_all(network, wanted.collect()).await?,
            network: network.clone(),
            options: options.clone(),
            device,
            rpc: calls.expect("the port for calls is among the wanted"),
            rpc_peer: options.remote_port(rpc.remote),
            kept: Vec::new(),
            asking: JoinSet::new(),
        })
    }

    /// Connects the port for calls.
    pub(crate) async fn connect_rpc(&mut self) -> Result<(), OpenError> {
        let peer = self.rpc_peer.clone();
        self.connect_to(self.rpc, &peer, RPC_CARRIER).await
    }

    /// Connects a port to the server's port `suffix`, over the carrier of streams.
    pub(crate) async fn connect(&mut self, port: usize, suffix: &str) -> Result<(), OpenError> {
        let (peer, carrier) = (self.remote_port(suffix), self.options.carrier.clone());
        self.connect_to(port, &peer, &carrier).await
    }

    async fn connect_to(
        &mut self,
        port: usize,
        peer: &str,
        carrier: &str,
    ) -> Result<(), OpenError> {
        let (port, timeout) = (&self.ports[port], self.options.rpc_timeout);
        let kept = connect_supervised(port, peer, carrier, timeout).await?;
        self.kept.push(kept);
        Ok(())
    }

    /// Has the server's port `suffix` write to a port, and again whenever `latest` is older than `age` and than twice
    /// the watch interval.
    pub(crate) async fn subscribe<T: Send + 'static>(
        &mut self,
        suffix: &str,
        port: usize,
        latest: &Arc<LatestValue<T>>,
        age: Duration,
    ) -> Result<(), OpenError> {
        let (latest, age) = (latest.clone(), age.max(2 * WATCH_INTERVAL));
        let are_missing = Box::new(move || latest.is_older_than(age));
        self.subscribe_while((suffix, port), Turn::default(), are_missing)
            .await
    }

    /// Makes the connection from the server's port `suffix` to a port at once, or ends it; one that has been subscribed to
    /// is otherwise made when its messages are missing.
    pub(crate) async fn set_connected(
        &self,
        (suffix, port): (&str, usize),
        connected: bool,
    ) -> Result<(), ConnectError> {
        let (from, to) = (self.remote_port(suffix), self.ports[port].name());
        let carrier = self.options.carrier.as_str();
        let done = match connected {
            true => remote_admin::connect(&self.network, &from, to, Some(carrier)).await,
            false => remote_admin::disconnect(&self.network, &from, to).await,
        };
        done.map(drop)
    }

    /// Has two ports of the server write to two of ours, `(suffix, port)` each. The second one is a stream of rare messages,
    /// whose absence says nothing: it is asked for again whenever the first one is, and until some time after.
    pub(crate) async fn subscribe_with_events<T: Send + 'static>(
        &mut self,
        stream: (&str, usize),
        events: (&str, usize),
        latest: &Arc<LatestValue<T>>,
    ) -> Result<(), OpenError> {
        let (latest, age) = (latest.clone(), 2 * WATCH_INTERVAL);
        let due = Arc::new(AtomicUsize::new(0));
        let remaining = due.clone();
        let are_missing = Box::new(move || {
            let missing = latest.is_older_than(age);
            if missing {
                due.store(EVENT_ATTEMPTS, Ordering::Relaxed);
            }
            missing
        });
        self.subscribe_while(stream, Turn::default(), are_missing)
            .await?;
        let one_less = move || {
            let ordering = Ordering::Relaxed;
            remaining.fetch_update(ordering, ordering, |left| left.checked_sub(1))
        };
        self.subscribe_while(
            events,
            Turn::default(),
            Box::new(move || one_less().is_ok()),
        )
        .await
    }

    /// Has the server's port `suffix` write to a port, and again whenever `are_missing` returns true, which is asked while `turn` is held.
    pub(crate) async fn subscribe_while(
        &mut self,
        (suffix, port): (&str, usize),
        turn: Turn,
        are_missing: Missing,
    ) -> Result<(), OpenError> {
        let from = self.remote_port(suffix);
        let ends = (from.as_str(), self.ports[port].name());
        let carrier = &self.options.carrier;
        subscribe(
            &self.network,
            ends,
            carrier,
            &mut self.asking,
            turn,
            are_missing,
        )
        .await
    }

    /// Returns the network, with the timeout of the client.
    pub(crate) fn network(&self) -> &Network {
        &self.network
    }

    /// Returns the names and timeouts.
    pub(crate) fn options(&self) -> &RemoteOptions {
        &self.options
    }

    /// Returns the name of the server, as it was given.
    pub(crate) fn remote(&self) -> &str {
        &self.options.remote
    }

    /// Returns the name of a port of the server.
    pub(crate) fn remote_port(&self, suffix: &str) -> String {
        self.options.remote_port(suffix)
    }

    /// Returns the name of the port that answers calls.
    pub(crate) fn rpc_peer(&self) -> &str {
        &self.rpc_peer
    }

    /// Returns a port.
    pub(crate) fn port(&self, port: usize) -> &Port {
        &self.ports[port]
    }

    /// Returns the number of ports.
    pub(crate) fn count(&self) -> usize {
        self.ports.len()
    }

    /// Closes a port with the others.
    pub(crate) fn add(&mut self, port: Port) {
        self.ports.push(port);
    }

    /// Sends a request and waits for the reply.
    pub(crate) async fn send<R: ReadObject>(
        &self,
        message: &impl WireObject,
    ) -> Result<R, PortError> {
        let timeout = self.options.rpc_timeout;
        self.ports[self.rpc].call_within(message, timeout).await
    }

    /// Sends a request and waits for the reply.
    ///
    /// Errors: [`DeviceError::Remote`].
    pub(crate) async fn call(&self, message: &impl WireObject) -> Result<Bottle, DeviceError> {
        let reply = self.send(message).await;
        reply.map_err(|error| self.lost(message, error))
    }

    /// Sends a message from a port to the server's port `suffix`, without waiting for a reply; `step` says what for.
    ///
    /// Errors: [`DeviceError::Remote`] without a connection.
    pub(crate) async fn write(
        &self,
        port: usize,
        suffix: &str,
        message: &Bottle,
        step: &str,
    ) -> Result<(), DeviceError> {
        match self.ports[port].write_strict(message, None).await {
            0 => Err(DeviceError::Remote {
                peer: self.remote_port(suffix),
                step: format!("{step}`{}`", to_text(message)),
                advice: "again in a second; the connection is being made anew".to_owned(),
                source: None,
            }),
            _ => Ok(()),
        }
    }

    /// Checks the version of the protocol that the server reports.
    ///
    /// A server that reports another version is not compatible; one that reports none is, as in stock.
    pub(crate) fn check_version(
        &self,
        version: &str,
        is_known: bool,
        expected: &str,
    ) -> Result<(), OpenError> {
        if version.is_empty() {
            tracing::warn!(
                remote = self.remote(),
                "the {} does not report its version",
                self.device
            );
            return Ok(());
        }
        if is_known {
            return Ok(());
        }
        Err(OpenError::Query {
            question: "the version of the protocol that is expected",
            source: DeviceError::Unsuitable {
                what: "version",
                asked: version.to_owned(),
                expected: expected.to_owned(),
            },
        })
    }

    /// Returns the error for a request without a reply.
    pub(crate) fn lost(&self, message: &impl WireObject, error: PortError) -> DeviceError {
        let step = format!("`{}`", to_text(message));
        self.unreachable(&self.rpc_peer, step, Some(Box::new(error)))
    }

    /// Returns the error for a step with a port of the server that cannot be reached.
    pub(crate) fn unreachable(
        &self,
        peer: &str,
        step: String,
        source: Option<Box<dyn Error + Send + Sync>>,
    ) -> DeviceError {
        let device = self.device;
        DeviceError::Remote {
            peer: peer.to_owned(),
            step,
            advice: format!("`yarp ping {peer}`; when the {device} is back, it is connected again"),
            source,
        }
    }

    /// Returns the error for a request that the server refused.
    pub(crate) fn refused(&self, said: impl Display, advice: impl Into<String>) -> DeviceError {
        DeviceError::Refused {
            peer: self.rpc_peer.clone(),
            step: format!("`{said}`"),
            advice: advice.into(),
        }
    }

    /// Returns the error for a reply of an unexpected kind.
    pub(crate) fn unreadable(&self, step: String, advice: impl Into<String>) -> DeviceError {
        DeviceError::Remote {
            peer: self.rpc_peer.clone(),
            step,
            advice: advice.into(),
            source: None,
        }
    }
}

impl Link for RemotePorts {
    async fn close(mut self) {
        self.asking.shutdown().await;
        let closing = close_all(self.ports);
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, closing)
            .await
            .is_err()
        {
            let remote = self.options.remote;
            tracing::warn!(%remote, "closing took too long; names may be left behind");
        }
    }
}

/// Returns the options of a port that only receives a stream; `take` is called for each message.
pub(crate) fn stream_port(take: impl Fn(&Received) + Send + Sync + 'static) -> PortOptions {
    let handler = move |received: &mut Received| {
        take(received);
        Answer::Nothing
    };
    PortOptions::new().handler(handler).input_only()
}
