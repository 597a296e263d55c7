//! The three ports of a client, the conversation at opening, and calls.

use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::DeviceError;
use yarp_ports::{Network, Port, PortOptions, Received, blocking, remote};
use yarp_wire::Bottle;

use super::super::OpenError;
use super::super::messages::{Command, Get, ProtocolVersion, Reply, Request};
use super::super::opening::{close_all, open};
use super::latest::Latest;
use super::options::RemoteControlBoardOptions;

/// Questions and orders need answers, so their carrier is not a choice.
const RPC_CARRIER: &str = "tcp";
/// How long closing may take.
const CLOSING: Duration = Duration::from_secs(3);

/// Ports connected to a board.
#[derive(Debug)]
pub(super) struct Link {
    rpc: Port,
    command: Port,
    feed: Port,
    remote: String,
    rpc_peer: String,
    command_peer: String,
    deadline: Duration,
    pub(super) latest: Arc<Latest>,
}

impl Link {
    /// Opens and connects the ports, and asks how many axes there are; on an error nothing stays open.
    pub(super) async fn open(
        network: &Network,
        options: &RemoteControlBoardOptions,
    ) -> Result<(Self, usize), OpenError> {
        let remote_name = |suffix: &str| format!("{}/{suffix}", options.remote);
        // Before anything of our own is opened: usually the board is just not running.
        for suffix in ["rpc:i", "command:i", "stateExt:o"] {
            let name = remote_name(suffix);
            match remote::exists(network, &name).await {
                Ok(true) => {}
                Ok(false) => return Err(OpenError::NoRemote { name }),
                Err(source) => return Err(OpenError::Port { name, source }),
            }
        }
        let latest = Arc::new(Latest::new(options.timeout));
        let newest = latest.clone();
        let take = move |received: &mut Received| {
            newest.take(received);
            yarp_ports::Answer::Nothing
        };
        let wanted = [
            ("rpc:o", PortOptions::new().calling()),
            ("command:o", PortOptions::new()),
            ("stateExt:i", PortOptions::new().handler(take).input_only()),
        ];
        let mut opened = Vec::new();
        for (suffix, port) in wanted {
            match open(network, format!("{}/{suffix}", options.local), port).await {
                Ok(port) => opened.push(port),
                Err(error) => {
                    close_all(opened).await;
                    return Err(error);
                }
            }
        }
        let [rpc, command, feed]: [Port; 3] = opened.try_into().expect("three were asked for");
        let link = Self {
            rpc,
            command,
            feed,
            remote: options.remote.clone(),
            rpc_peer: remote_name("rpc:i"),
            command_peer: remote_name("command:i"),
            deadline: options.deadline,
            latest,
        };
        match link.greet(network, options).await {
            Ok(axes) => Ok((link, axes)),
            Err(error) => {
                link.close().await;
                Err(error)
            }
        }
    }

    /// Connects the ports; then the version of the protocol, and the number of axes.
    async fn greet(
        &self,
        network: &Network,
        options: &RemoteControlBoardOptions,
    ) -> Result<usize, OpenError> {
        let carrier = options.carrier.as_str();
        connect(&self.rpc, &self.rpc_peer, RPC_CARRIER).await?;
        connect(&self.command, &self.command_peer, carrier).await?;
        let state = format!("{}/stateExt:o", options.remote);
        remote::connect(network, &state, self.feed.name(), Some(carrier))
            .await
            .map_err(|source| OpenError::Connect {
                from: state,
                to: self.feed.name().to_owned(),
                carrier: carrier.to_owned(),
                source: source.into(),
            })?;
        if !options.ignores_protocol {
            self.check_version().await?;
        }
        let question = "how many axes it has";
        let asked = Request::Get(Get::Axes);
        let failed = |source| OpenError::Question { question, source };
        let (reply, request) = self.exchange(asked).await.map_err(failed)?;
        match reply.count() {
            Some(0) => Err(OpenError::NoAxes),
            Some(axes) => Ok(axes),
            None => Err(failed(self.unreadable(&request, reply))),
        }
    }

    async fn check_version(&self) -> Result<(), OpenError> {
        let failed = |source| OpenError::Question {
            question: "which version of the protocol it speaks",
            source,
        };
        let asked = self.exchange(Request::ProtocolVersion).await;
        let (reply, request) = asked.map_err(failed)?;
        let expected = ProtocolVersion::CURRENT;
        match reply.read_version() {
            Some(found) if found.is_compatible(expected) => Ok(()),
            Some(found) => Err(OpenError::ProtocolVersion {
                peer: self.rpc_peer.clone(),
                expected,
                found,
            }),
            None => Err(failed(self.unreadable(&request, reply))),
        }
    }

    pub(super) fn remote(&self) -> &str {
        &self.remote
    }

    /// Asks or orders, and waits for the answer; also gives the message that was sent.
    pub(super) fn call(self: &Arc<Self>, request: Request) -> Result<(Reply, Bottle), DeviceError> {
        let link = self.clone();
        blocking::wait(async move {
            let answer = link.exchange(request).await;
            // Before anybody learns of the answer, so that dropping the board finds itself alone.
            drop(link);
            answer
        })
    }

    async fn exchange(&self, request: Request) -> Result<(Reply, Bottle), DeviceError> {
        let Some(message) = request.to_bottle() else {
            return Err(DeviceError::NotSupported {
                what: format!("{request:?} in one message"),
            });
        };
        let calling = self.rpc.call_within::<Bottle>(&message, self.deadline);
        match calling.await.map(Reply::from_bottle) {
            Ok(reply) if reply.is_refusal() => Err(DeviceError::Refused {
                peer: self.rpc_peer.clone(),
                step: format!("`{message}`"),
                advice: "the log of the control board, which has the reason".to_owned(),
            }),
            Ok(reply) => Ok((reply, message)),
            Err(error) => Err(failed(
                &self.rpc_peer,
                format!("`{message}`"),
                Some(Box::new(error)),
            )),
        }
    }

    /// Sends a command that nobody answers. Commands arrive all, and in order.
    pub(super) fn stream(self: &Arc<Self>, command: Command) -> Result<(), DeviceError> {
        let link = self.clone();
        let sent = blocking::wait(async move {
            let writing = link.command.write_strict(&command, None);
            let sent = tokio::time::timeout(link.deadline, writing).await;
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

    /// What to say of an answer that is not of the kind expected.
    pub(super) fn unreadable(&self, request: &Bottle, reply: Reply) -> DeviceError {
        let answer = reply.into_bottle();
        DeviceError::Remote {
            peer: self.rpc_peer.clone(),
            step: format!("understanding the answer `{answer}` to `{request}`"),
            advice: "whether it is a control board of YARP 3.5 to 3.12".to_owned(),
            source: None,
        }
    }

    /// Closes the ports; takes a few seconds at the most.
    pub(super) async fn close(self) {
        let closing = close_all([self.rpc, self.command, self.feed]);
        if tokio::time::timeout(CLOSING, closing).await.is_err() {
            tracing::warn!(remote = %self.remote, "closing took too long; names may be left behind");
        }
    }
}

async fn connect(port: &Port, to: &str, carrier: &str) -> Result<(), OpenError> {
    port.connect_over(to, carrier)
        .await
        .map_err(|source| OpenError::Connect {
            from: port.name().to_owned(),
            to: to.to_owned(),
            carrier: carrier.to_owned(),
            source: source.into(),
        })
}

fn failed(peer: &str, step: String, source: Option<Box<dyn Error + Send + Sync>>) -> DeviceError {
    DeviceError::Remote {
        peer: peer.to_owned(),
        step,
        advice: format!("`yarp ping {peer}`; if it is there, open the remote control board again"),
        source,
    }
}
