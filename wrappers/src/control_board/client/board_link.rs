//! The three ports of a client, the conversation at opening, and calls.
//!
//! ```text
//!              3.x                                      4.0
//! calls        LOCAL/rpc:o      -> REMOTE/rpc:i         LOCAL/nwc/rpc:o  -> REMOTE/nws/rpc:i
//! commands     LOCAL/command:o  -> REMOTE/command:i     the same
//! state        LOCAL/stateExt:i <- REMOTE/stateExt:o    the same
//! ```

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::OnceCell;
use yarp_devices::DeviceError;
use yarp_ports::{Network, PortOptions};
use yarp_wire::{Bottle, Value, WireVersion};

use super::super::OpenError;
use super::super::messages::{
    Command, Get, ProtocolVersion, Query, Reply, Request, Selection, count,
};
use super::latest_state::LatestState;
use super::remote_board_options::RemoteControlBoardOptions;
use super::remote_motion_completion::Announcements;
use crate::device_ports::{LatestValue, Link, RemotePorts, RpcPort, stream_port};
use crate::reconnect::{to_text, unsupported_request};
use crate::thrift::{ReturnCode, ServiceVersion};

const RPC_3: RpcPort = RpcPort::USUAL;
const RPC_4: RpcPort = RpcPort {
    local: "nwc/rpc:o",
    remote: "nws/rpc:i",
};
/// Index of the port for commands.
const COMMAND: usize = 1;
/// Index of the port for the state.
const STATE: usize = 2;

/// Advice after a refusal without a reason.
pub(super) const REFUSAL_ADVICE: &str = "the log of the control board, which has the reason";

/// Ports connected to a board.
#[derive(Debug)]
pub(super) struct BoardLink {
    pub(super) wire_version: WireVersion,
    pub(super) ports: RemotePorts,
    command_peer: String,
    pub(super) latest: Arc<LatestState>,
    /// Opened when the first numbered move is sent.
    announcements: OnceCell<Announcements>,
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

impl Link for BoardLink {
    async fn close(self) {
        let mut ports = self.ports;
        if let Some(announcements) = self.announcements.into_inner() {
            ports.add(announcements.port);
        }
        ports.close().await;
    }
}

impl BoardLink {
    /// Opens and connects the ports, and queries the board's description; on an error nothing stays open.
    pub(super) async fn open(
        network: &Network,
        options: &RemoteControlBoardOptions,
    ) -> Result<(Self, About), OpenError> {
        let common = &options.common;
        let wire_version = wire_version(network, options).await?;
        let rpc = match wire_version {
            WireVersion::V3 => RPC_3,
            WireVersion::V4 => RPC_4,
        };
        let needed = ["command:i", "stateExt:o"];
        common.check_remote(network, &needed).await?;
        let latest = Arc::new(LatestValue::new("state", common.max_state_age));
        let newest = latest.clone();
        let wanted = [
            (rpc.local, PortOptions::new().rpc_client()),
            ("command:o", PortOptions::new()),
            (
                "stateExt:i",
                stream_port(move |received| newest.take(received)),
            ),
        ];
        let wanted = wanted.map(|(suffix, port)| (suffix, port.wire_version(wire_version)));
        let mut link = Self {
            wire_version,
            ports: RemotePorts::open(network, common, "board", rpc, wanted.into()).await?,
            command_peer: common.remote_port("command:i"),
            latest,
            announcements: OnceCell::new(),
        };
        let greeted = link.greet(options).await;
        link.unless_failed(greeted).await
    }

    /// Connects the ports in the order of stock; then the version of the protocol, the number of axes and, from 4.0,
    /// the interfaces.
    async fn greet(&mut self, options: &RemoteControlBoardOptions) -> Result<About, OpenError> {
        let ports = &mut self.ports;
        if self.wire_version == WireVersion::V3 {
            ports.connect_rpc().await?;
        }
        ports.connect(COMMAND, "command:i").await?;
        let age = Duration::ZERO;
        ports
            .subscribe("stateExt:o", STATE, &self.latest, age)
            .await?;
        if self.wire_version == WireVersion::V4 {
            ports.connect_rpc().await?;
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
                let version = self.ports.send::<ServiceVersion>(&call).await;
                let found = version
                    .map_err(|error| failed(self.ports.lost(&call, error)))?
                    .protocol;
                let only = ProtocolVersion::only;
                (only(ServiceVersion::SERVED.protocol), only(found))
            }
        };
        if found.is_compatible(expected) {
            return Ok(());
        }
        Err(OpenError::ProtocolVersion {
            peer: self.ports.rpc_peer().to_owned(),
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
        let opening = || Announcements::open(&self.ports);
        let opened = self.announcements.get_or_try_init(opening).await;
        opened.map_err(|error| match error {
            OpenError::NoRemote { name } => DeviceError::NotSupported {
                what: format!("a move with a number, for which there is no port {name},"),
            },
            error => self.ports.unreachable(
                self.ports.remote(),
                "opening a port for the ends of moves".to_owned(),
                Some(Box::new(error)),
            ),
        })
    }

    /// Sends a request, and waits for the reply.
    pub(super) async fn exchange(&self, request: &Request) -> Result<Results, DeviceError> {
        match self.wire_version {
            WireVersion::V3 => self.exchange_words(request).await,
            WireVersion::V4 => self.exchange_call(request).await,
        }
    }

    async fn exchange_words(&self, request: &Request) -> Result<Results, DeviceError> {
        let message = request
            .to_bottle()
            .ok_or_else(|| unsupported_request(request))?;
        let reply = Reply::from_bottle(self.ports.call(&message).await?);
        let said = message.to_string();
        // Whether a joint is calibrated is answered by `[ok]` and `[fail]` themselves.
        let done = matches!(request, Request::Get(Get::About(Query::CalibrationDone, _)));
        if reply.is_refusal() && !done {
            return Err(self.ports.refused(said, REFUSAL_ADVICE));
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
        let reply = self.ports.call(&message).await?;
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
            Some((code, _)) => {
                let advice = format!("the log of the control board; it answered that {code}");
                Err(self.ports.refused(said, advice))
            }
            None => Err(self.unreadable(&Results {
                values: answer,
                said,
            })),
        }
    }

    /// Sends a command without a reply. All commands arrive, and in order.
    pub(super) async fn stream(&self, command: &Command) -> Result<(), DeviceError> {
        let writing = self.ports.port(COMMAND).write_strict(command, None);
        let timeout = self.ports.options().rpc_timeout;
        let source = match tokio::time::timeout(timeout, writing).await {
            Ok(1..) => return Ok(()),
            Ok(0) => None,
            Err(elapsed) => Some(elapsed.into()),
        };
        let step = "sending a command".to_owned();
        Err(self.ports.unreachable(&self.command_peer, step, source))
    }

    /// Returns the error for a reply of an unexpected kind.
    pub(super) fn unreadable(&self, results: &Results) -> DeviceError {
        let answer = Bottle::from(results.values.clone());
        let said = &results.said;
        self.ports.unreadable(
            format!("understanding the answer `{answer}` to `{said}`"),
            format!(
                "whether it is a control board of YARP {}",
                self.wire_version
            ),
        )
    }
}

/// Finds out the wire version of the board: that of its RPC port.
async fn wire_version(
    network: &Network,
    options: &RemoteControlBoardOptions,
) -> Result<WireVersion, OpenError> {
    let has = async |rpc: RpcPort| options.common.check_remote(network, &[rpc.remote]).await;
    match options.wire_version {
        Some(WireVersion::V3) => has(RPC_3).await.map(|()| WireVersion::V3),
        Some(WireVersion::V4) => has(RPC_4).await.map(|()| WireVersion::V4),
        None => match has(RPC_4).await {
            Ok(()) => Ok(WireVersion::V4),
            Err(OpenError::NoRemote { .. }) => has(RPC_3).await.map(|()| WireVersion::V3),
            Err(error) => Err(error),
        },
    }
}
