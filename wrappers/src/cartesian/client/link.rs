//! The four ports of a client, the conversation at opening, and calls.
//!
//! ```text
//! questions  LOCAL/rpc:o     -> REMOTE/rpc:i
//! orders     LOCAL/command:o -> REMOTE/command:i
//! poses      LOCAL/state:i   <- REMOTE/state:o
//! events     LOCAL/events:i  <- REMOTE/events:o
//! ```

use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinSet;
use yarp_devices::{CartesianInfo, DeviceError};
use yarp_ports::{Answer, Network, Port, PortOptions, Received, ReconnectingConnection};
use yarp_wire::Bottle;

use super::latest_pose::LatestPose;
use super::options::RemoteCartesianOptions;
use crate::OpenError;
use crate::cartesian::CartesianVersion;
use crate::cartesian::messages::reply::{self, Values};
use crate::cartesian::messages::{Query, Request};
use crate::open_ports::{close_all, open};
use crate::reconnect::{
    PORT_CLOSE_TIMEOUT, RPC_CARRIER, WATCH_INTERVAL, check_exists, connect_supervised, subscribe,
    to_text,
};

/// Ports connected to a server.
#[derive(Debug)]
pub(super) struct Link {
    rpc: Port,
    command: Port,
    /// Those that only take in.
    inputs: Vec<Port>,
    remote: String,
    rpc_timeout: Duration,
    pub(super) latest: Arc<LatestPose>,
    /// Connections of ours, made again whenever they are lost.
    kept: Vec<ReconnectingConnection>,
    /// Asks the server for its streams again; ends with the link.
    asking: JoinSet<()>,
}

impl Link {
    /// Opens and connects the ports in the order of stock; on an error nothing stays open.
    pub(super) async fn open(
        network: &Network,
        options: &RemoteCartesianOptions,
    ) -> Result<Self, OpenError> {
        for suffix in ["rpc:i", "command:i", "state:o", "events:o"] {
            check_exists(network, format!("{}/{suffix}", options.remote)).await?;
        }
        let latest = Arc::new(LatestPose::new(options.max_state_age));
        let local = |suffix: &str| format!("{}/{suffix}", options.local);
        let command = open(network, local("command:o"), PortOptions::new()).await?;
        let rpc = match open(network, local("rpc:o"), PortOptions::new().rpc_client()).await {
            Ok(rpc) => rpc,
            Err(error) => {
                close_all([command]).await;
                return Err(error);
            }
        };
        let mut link = Self {
            rpc,
            command,
            inputs: Vec::new(),
            remote: options.remote.clone(),
            rpc_timeout: options.rpc_timeout,
            latest,
            kept: Vec::new(),
            asking: JoinSet::new(),
        };
        match link.greet(network, options).await {
            Ok(()) => Ok(link),
            Err(error) => {
                link.close().await;
                Err(error)
            }
        }
    }

    async fn greet(
        &mut self,
        network: &Network,
        options: &RemoteCartesianOptions,
    ) -> Result<(), OpenError> {
        let latest = self.latest.clone();
        self.take_in(network, options, "state:i", move |received| {
            latest.take(received)
        })
        .await?;
        let latest = self.latest.clone();
        self.take_in(network, options, "events:i", move |received| {
            latest.take_event(received)
        })
        .await?;
        let rpc = self.at("rpc:i");
        let kept = connect_supervised(&self.rpc, &rpc, RPC_CARRIER, self.rpc_timeout).await?;
        self.kept.push(kept);
        let info = self
            .question(Query::Info, "its version", Values::info)
            .await?;
        self.check_version(&info)?;
        let command = self.at("command:i");
        let kept =
            connect_supervised(&self.command, &command, &options.carrier, self.rpc_timeout).await?;
        self.kept.push(kept);
        for (from, to) in [("state:o", 0), ("events:o", 1)] {
            let latest = self.latest.clone();
            let ends = (self.at(from), self.inputs[to].name().to_owned());
            let are_missing = move || latest.is_older_than(2 * WATCH_INTERVAL);
            subscribe(
                network,
                (&ends.0, &ends.1),
                &options.carrier,
                &mut self.asking,
                are_missing,
            )
            .await?;
        }
        match self
            .question(Query::IsOn, "that its solver is there", Values::yes_or_no)
            .await?
        {
            true => Ok(()),
            false => Err(OpenError::Query {
                question: "that its solver is there",
                source: self.refused(&Request::Get(Query::IsOn).to_bottle()),
            }),
        }
    }

    /// A server that reports another version is not compatible; one that reports none is, as in stock.
    fn check_version(&self, info: &CartesianInfo) -> Result<(), OpenError> {
        match info.server_version.as_str() {
            known if CartesianVersion::from_text(known).is_some() => Ok(()),
            "" => {
                tracing::warn!(remote = %self.remote, "the server does not report its version");
                Ok(())
            }
            other => Err(OpenError::Query {
                question: "the version of the protocol that is expected",
                source: DeviceError::Unsuitable {
                    what: "version",
                    asked: other.to_owned(),
                    expected: "2.0, or 1.1 of older ones".to_owned(),
                },
            }),
        }
    }

    async fn take_in(
        &mut self,
        network: &Network,
        options: &RemoteCartesianOptions,
        suffix: &str,
        take: impl Fn(&Received) + Send + Sync + 'static,
    ) -> Result<(), OpenError> {
        let handler = move |received: &mut Received| {
            take(received);
            Answer::Nothing
        };
        let port = PortOptions::new().handler(handler).input_only();
        let name = format!("{}/{suffix}", options.local);
        self.inputs.push(open(network, name, port).await?);
        Ok(())
    }

    async fn question<T>(
        &self,
        question: Query,
        what: &'static str,
        read: impl Fn(&Values) -> Option<T>,
    ) -> Result<T, OpenError> {
        let asked = self.ask(&Request::Get(question), read).await;
        asked.map_err(|source| OpenError::Query {
            question: what,
            source,
        })
    }

    fn at(&self, suffix: &str) -> String {
        format!("{}/{suffix}", self.remote)
    }

    pub(super) fn remote(&self) -> &str {
        &self.remote
    }

    /// Sends a request, and waits for the reply.
    pub(super) async fn ask<T>(
        &self,
        request: &Request,
        read: impl Fn(&Values) -> Option<T>,
    ) -> Result<T, DeviceError> {
        let message = request.to_bottle();
        let remote =
            |step: String,
             advice: String,
             source: Option<Box<dyn std::error::Error + Send + Sync>>| {
                let peer = self.at("rpc:i");
                DeviceError::Remote {
                    peer,
                    step,
                    advice,
                    source,
                }
            };
        let answer = self
            .rpc
            .call_within::<Bottle>(&message, self.rpc_timeout)
            .await;
        let answer = answer.map_err(|error| {
            let peer = self.at("rpc:i");
            let advice =
                format!("`yarp ping {peer}`; when the server is back, it is connected again");
            remote(
                format!("`{}`", to_text(&message)),
                advice,
                Some(Box::new(error)),
            )
        })?;
        match reply::read(answer) {
            Some(Some(values)) => read(&values).ok_or(()),
            Some(None) => return Err(self.refused(&message)),
            None => Err(()),
        }
        .map_err(|()| {
            let step = format!("understanding the answer to `{}`", to_text(&message));
            remote(
                step,
                "whether it is a cartesian controller".to_owned(),
                None,
            )
        })
    }

    fn refused(&self, message: &Bottle) -> DeviceError {
        DeviceError::Refused {
            peer: self.at("rpc:i"),
            step: format!("`{}`", to_text(message)),
            advice: "the log of the server".to_owned(),
        }
    }

    /// Sends a command without a reply.
    pub(super) async fn order(&self, request: &Request) -> Result<(), DeviceError> {
        let message = request.to_bottle();
        match self.command.write_strict(&message, None).await {
            0 => Err(DeviceError::Remote {
                peer: self.at("command:i"),
                step: format!("`{}`", to_text(&message)),
                advice: "again in a second; the connection is being made anew".to_owned(),
                source: None,
            }),
            _ => Ok(()),
        }
    }

    /// Closes the ports; takes a few seconds at the most.
    pub(super) async fn close(mut self) {
        self.asking.shutdown().await;
        let closing = close_all([self.rpc, self.command].into_iter().chain(self.inputs));
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, closing)
            .await
            .is_err()
        {
            tracing::warn!(remote = %self.remote, "closing took too long; names may be left behind");
        }
    }
}
