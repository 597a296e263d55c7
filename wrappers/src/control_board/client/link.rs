//! The three ports of a client, the conversation at opening, and calls.
//!
//! ```text
//!              3.x                                      4.0
//! calls        LOCAL/rpc:o      -> REMOTE/rpc:i         LOCAL/nwc/rpc:o  -> REMOTE/nws/rpc:i
//! commands     LOCAL/command:o  -> REMOTE/command:i     the same
//! state        LOCAL/stateExt:i <- REMOTE/stateExt:o    the same
//! ```

use std::collections::HashSet;
use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::OnceCell;
use tokio::task::JoinSet;
use yarp_devices::DeviceError;
use yarp_ports::{
    Network, Port, PortError, PortOptions, Received, ReconnectingConnection, blocking,
};
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::{Bottle, Value, WireVersion};

use super::super::OpenError;
use super::super::messages::{
    Command, Get, ProtocolVersion, Query, Reply, Request, Selection, count,
};
use super::latest_state::LatestState;
use super::motion_completion::Announcements;
use super::options::RemoteControlBoardOptions;
use crate::open_ports::{close_all, open};
use crate::reconnect::{
    PORT_CLOSE_TIMEOUT, RPC_CARRIER, WATCH_INTERVAL, check_exists, connect_supervised, subscribe,
    to_text, unsupported_request,
};
use crate::thrift::{ReturnCode, ServiceVersion};

const RPC_3: (&str, &str) = ("rpc:o", "rpc:i");
const RPC_4: (&str, &str) = ("nwc/rpc:o", "nws/rpc:i");

/// Ports connected to a board.
#[derive(Debug)]
pub(super) struct Link {
    pub(super) wire_version: WireVersion,
    rpc: Port,
    command: Port,
    feed: Port,
    remote: String,
    rpc_peer: String,
    command_peer: String,
    rpc_timeout: Duration,
    pub(super) latest: Arc<LatestState>,
    /// The connections to the board, reconnected when they are lost.
    kept: Vec<ReconnectingConnection>,
    /// Asks the board for its state again; ends with the link.
    asking: JoinSet<()>,
    /// Opened when the first numbered move is sent.
    announcements: OnceCell<Announcements>,
    network: Network,
    local: String,
    carrier: String,
}

/// Description of a board.
#[derive(Debug)]
pub(super) struct About {
    pub(super) axes: usize,
    /// The names of the interfaces it has. A board of 3.x does not report it.
    pub(super) interfaces: Option<HashSet<String>>,
}

/// Results of a request, and the text of the request, for the errors.
#[derive(Debug)]
pub(super) struct Results {
    pub(super) values: Vec<Value>,
    pub(super) said: String,
}

impl Link {
    /// Opens and connects the ports, and queries the board's description; on an error nothing stays open.
    pub(super) async fn open(
        network: &Network,
        options: &RemoteControlBoardOptions,
    ) -> Result<(Self, About), OpenError> {
        let remote_name = |suffix: &str| format!("{}/{suffix}", options.remote);
        // Before anything of our own is opened: usually the board is just not running.
        let wire_version = wire_version(network, options).await?;
        let (from, to) = match wire_version {
            WireVersion::V3 => RPC_3,
            WireVersion::V4 => RPC_4,
        };
        for suffix in ["command:i", "stateExt:o"] {
            check_exists(network, remote_name(suffix)).await?;
        }
        let latest = Arc::new(LatestState::new(options.max_state_age));
        let newest = latest.clone();
        let take = move |received: &mut Received| {
            newest.take(received);
            yarp_ports::Answer::Nothing
        };
        let wanted = [
            (from, PortOptions::new().rpc_client()),
            ("command:o", PortOptions::new()),
            ("stateExt:i", PortOptions::new().handler(take).input_only()),
        ];
        let mut opened = Vec::new();
        for (suffix, port) in wanted {
            let name = format!("{}/{suffix}", options.local);
            match open(network, name, port.wire_version(wire_version)).await {
                Ok(port) => opened.push(port),
                Err(error) => {
                    close_all(opened).await;
                    return Err(error);
                }
            }
        }
        let [rpc, command, feed]: [Port; 3] = opened.try_into().expect("three were asked for");
        let mut link = Self {
            wire_version,
            rpc,
            command,
            feed,
            remote: options.remote.clone(),
            rpc_peer: remote_name(to),
            command_peer: remote_name("command:i"),
            rpc_timeout: options.rpc_timeout,
            latest,
            kept: Vec::new(),
            asking: JoinSet::new(),
            announcements: OnceCell::new(),
            network: network.clone(),
            local: options.local.clone(),
            carrier: options.carrier.clone(),
        };
        match link.greet(network, options).await {
            Ok(about) => Ok((link, about)),
            Err(error) => {
                link.close().await;
                Err(error)
            }
        }
    }

    /// Connects the ports in the order of stock; then the version of the protocol, the number of axes and, from 4.0,
    /// the interfaces.
    async fn greet(
        &mut self,
        network: &Network,
        options: &RemoteControlBoardOptions,
    ) -> Result<About, OpenError> {
        let carrier = options.carrier.as_str();
        if self.wire_version == WireVersion::V3 {
            self.kept.push(self.call_port().await?);
        }
        let command =
            connect_supervised(&self.command, &self.command_peer, carrier, self.rpc_timeout);
        self.kept.push(command.await?);
        let state = format!("{}/stateExt:o", options.remote);
        let latest = self.latest.clone();
        let are_missing = move || latest.is_older_than(2 * WATCH_INTERVAL);
        let ends = (state.as_str(), self.feed.name());
        subscribe(network, ends, carrier, &mut self.asking, are_missing).await?;
        if self.wire_version == WireVersion::V4 {
            self.kept.push(self.call_port().await?);
        }
        if !options.ignores_protocol {
            self.check_version().await?;
        }
        let question = "how many axes it has";
        let asked = Request::Get(Get::About(Query::Axes, Selection::All));
        let failed = |source| OpenError::Query { question, source };
        let results = self.exchange(&asked).await.map_err(failed)?;
        let axes = match results.values.first().and_then(count) {
            Some(0) => return Err(OpenError::NoAxes),
            Some(axes) => axes,
            None => return Err(failed(self.unreadable(&results))),
        };
        let interfaces = match self.wire_version {
            WireVersion::V3 => None,
            WireVersion::V4 => Some(self.interfaces().await?),
        };
        Ok(About { axes, interfaces })
    }

    async fn call_port(&self) -> Result<ReconnectingConnection, OpenError> {
        connect_supervised(&self.rpc, &self.rpc_peer, RPC_CARRIER, self.rpc_timeout).await
    }

    async fn check_version(&self) -> Result<(), OpenError> {
        let failed = |source| OpenError::Query {
            question: "which version of the protocol it speaks",
            source,
        };
        let (expected, found) = match self.wire_version {
            WireVersion::V3 => {
                let results = self.exchange(&Request::ProtocolVersion).await;
                let results = results.map_err(failed)?;
                let found = Reply::from_bottle(results.values.clone().into()).read_version();
                let found = found.ok_or_else(|| failed(self.unreadable(&results)))?;
                (ProtocolVersion::CURRENT, found)
            }
            WireVersion::V4 => {
                let call = Request::ProtocolVersion.to_call().unwrap_or_default();
                let version = self.send::<ServiceVersion>(&call).await;
                let found = version
                    .map_err(|error| failed(self.lost(&call, error)))?
                    .protocol;
                let only = ProtocolVersion::only;
                (only(ServiceVersion::SERVED.protocol), only(found))
            }
        };
        if found.is_compatible(expected) {
            return Ok(());
        }
        Err(OpenError::ProtocolVersion {
            peer: self.rpc_peer.clone(),
            expected,
            found,
        })
    }

    async fn interfaces(&self) -> Result<HashSet<String>, OpenError> {
        let question = "which interfaces it has";
        let failed = |source| OpenError::Query { question, source };
        let results = self.exchange(&Request::Interfaces).await.map_err(failed)?;
        let named = |entry: &Value| {
            let [name, there] = entry.as_list()?.as_slice() else {
                return None;
            };
            let there = super::super::messages::read_flag(there)?;
            Some((name.to_plain_string(), there))
        };
        let map = results.values.first().and_then(Value::as_list);
        let entries: Option<Vec<_>> = map.and_then(|map| map.iter().map(named).collect());
        let entries = entries.ok_or_else(|| failed(self.unreadable(&results)))?;
        let there = entries.into_iter().filter(|(_, there)| *there);
        Ok(there.map(|(name, _)| name).collect())
    }

    /// The port for the ends of motions.
    pub(super) async fn announcements(&self) -> Result<&Announcements, DeviceError> {
        let (network, carrier) = (&self.network, self.carrier.as_str());
        let opening = || Announcements::open(network, &self.remote, &self.local, carrier);
        let opened = self.announcements.get_or_try_init(opening).await;
        opened.map_err(|error| match error {
            OpenError::NoRemote { name } => DeviceError::NotSupported {
                what: format!("a move with a number, for which there is no port {name},"),
            },
            error => failed(
                &self.remote,
                "opening a port for the ends of moves".to_owned(),
                Some(Box::new(error)),
            ),
        })
    }

    pub(super) fn remote(&self) -> &str {
        &self.remote
    }

    /// Sends a request, and waits for the reply.
    pub(super) fn call(self: &Arc<Self>, request: Request) -> Result<Results, DeviceError> {
        let link = self.clone();
        blocking::wait(async move {
            let answer = link.exchange(&request).await;
            // Before anybody learns of the answer, so that dropping the board finds itself alone.
            drop(link);
            answer
        })
    }

    async fn exchange(&self, request: &Request) -> Result<Results, DeviceError> {
        match self.wire_version {
            WireVersion::V3 => self.exchange_words(request).await,
            WireVersion::V4 => self.exchange_call(request).await,
        }
    }

    async fn exchange_words(&self, request: &Request) -> Result<Results, DeviceError> {
        let message = request
            .to_bottle()
            .ok_or_else(|| unsupported_request(request))?;
        let reply = self.send::<Bottle>(&message).await;
        let reply = Reply::from_bottle(reply.map_err(|error| self.lost(&message, error))?);
        let said = message.to_string();
        // Whether a joint is calibrated is answered by `[ok]` and `[fail]` themselves.
        let done = matches!(request, Request::Get(Get::About(Query::CalibrationDone, _)));
        if reply.is_refusal() && !done {
            return Err(self.refused(said, "the log of the control board, which has the reason"));
        }
        let values = match request {
            Request::Get(get) => get.read_v3(&reply),
            Request::Set(_) => reply.is_ok().then(Vec::new),
            _ => Some(reply.clone().into_bottle().into_items()),
        };
        match values {
            Some(values) => Ok(Results { values, said }),
            None => Err(self.unreadable(&Results {
                values: reply.into_bottle().into_items(),
                said,
            })),
        }
    }

    async fn exchange_call(&self, request: &Request) -> Result<Results, DeviceError> {
        let message = request
            .to_call()
            .ok_or_else(|| unsupported_request(request))?;
        let reply = self.send::<Bottle>(&message).await;
        let reply = reply.map_err(|error| self.lost(&message, error))?;
        let said = to_text(&message);
        let answer = reply.clone().into_items();
        let done = matches!(request, Request::Get(Get::About(Query::CalibrationDone, _)));
        match ReturnCode::read(reply) {
            Some((ReturnCode::Ok, _)) if done => Ok(Results {
                values: vec![Value::Int32(1)],
                said,
            }),
            Some((ReturnCode::Failed | ReturnCode::Generic, _)) if done => Ok(Results {
                values: vec![Value::Int32(0)],
                said,
            }),
            Some((ReturnCode::Ok, values)) => Ok(Results { values, said }),
            Some((code, _)) => Err(self.refused(
                said,
                &format!("the log of the control board; it answered that {code}"),
            )),
            None => Err(self.unreadable(&Results {
                values: answer,
                said,
            })),
        }
    }

    pub(super) async fn send<R: ReadObject>(
        &self,
        message: &impl WireObject,
    ) -> Result<R, PortError> {
        self.rpc.call_within::<R>(message, self.rpc_timeout).await
    }

    pub(super) fn refused(&self, said: String, advice: &str) -> DeviceError {
        DeviceError::Refused {
            peer: self.rpc_peer.clone(),
            step: format!("`{said}`"),
            advice: advice.to_owned(),
        }
    }

    pub(super) fn lost(&self, message: &impl WireObject, error: PortError) -> DeviceError {
        let step = format!("`{}`", to_text(message));
        failed(&self.rpc_peer, step, Some(Box::new(error)))
    }

    /// Sends a command without a reply. All commands arrive, and in order.
    pub(super) fn stream(self: &Arc<Self>, command: Command) -> Result<(), DeviceError> {
        let link = self.clone();
        let sent = blocking::wait(async move {
            let writing = link.command.write_strict(&command, None);
            let sent = tokio::time::timeout(link.rpc_timeout, writing).await;
            drop(link);
            sent
        });
        match sent {
            Ok(1..) => Ok(()),
            Ok(0) => Err(failed(
                &self.command_peer,
                "sending a command".to_owned(),
                None,
            )),
            Err(elapsed) => Err(failed(
                &self.command_peer,
                "sending a command".to_owned(),
                Some(Box::new(elapsed)),
            )),
        }
    }

    /// Returns the error for a reply of an unexpected kind.
    pub(super) fn unreadable(&self, results: &Results) -> DeviceError {
        let answer = Bottle::from(results.values.clone());
        let said = &results.said;
        DeviceError::Remote {
            peer: self.rpc_peer.clone(),
            step: format!("understanding the answer `{answer}` to `{said}`"),
            advice: format!(
                "whether it is a control board of YARP {}",
                self.wire_version
            ),
            source: None,
        }
    }

    /// Closes the ports; takes a few seconds at the most.
    pub(super) async fn close(mut self) {
        self.asking.shutdown().await;
        let announced = self.announcements.into_inner().map(|ends| ends.port);
        let ports = [self.rpc, self.command, self.feed];
        let closing = close_all(ports.into_iter().chain(announced));
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, closing)
            .await
            .is_err()
        {
            tracing::warn!(remote = %self.remote, "closing took too long; names may be left behind");
        }
    }
}

/// Finds out the wire version of the board: that of its RPC port.
async fn wire_version(
    network: &Network,
    options: &RemoteControlBoardOptions,
) -> Result<WireVersion, OpenError> {
    let name = |(_, to): (&str, &str)| format!("{}/{to}", options.remote);
    match options.wire_version {
        Some(WireVersion::V3) => check_exists(network, name(RPC_3))
            .await
            .map(|()| WireVersion::V3),
        Some(WireVersion::V4) => check_exists(network, name(RPC_4))
            .await
            .map(|()| WireVersion::V4),
        None => match check_exists(network, name(RPC_4)).await {
            Ok(()) => Ok(WireVersion::V4),
            Err(OpenError::NoRemote { .. }) => check_exists(network, name(RPC_3))
                .await
                .map(|()| WireVersion::V3),
            Err(error) => Err(error),
        },
    }
}

fn failed(peer: &str, step: String, source: Option<Box<dyn Error + Send + Sync>>) -> DeviceError {
    DeviceError::Remote {
        peer: peer.to_owned(),
        step,
        advice: format!("`yarp ping {peer}`; when the board is back, it is connected again"),
        source,
    }
}
