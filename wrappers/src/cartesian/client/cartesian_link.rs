//! The four ports of a client, the conversation at opening, and calls.
//!
//! ```text
//! questions  LOCAL/rpc:o     -> REMOTE/rpc:i
//! orders     LOCAL/command:o -> REMOTE/command:i
//! poses      LOCAL/state:i   <- REMOTE/state:o
//! events     LOCAL/events:i  <- REMOTE/events:o
//! ```

use std::sync::Arc;

use yarp_devices::DeviceError;
use yarp_ports::{Network, PortOptions};
use yarp_wire::Bottle;

use super::latest_pose::LatestPose;
use super::remote_cartesian_options::RemoteCartesianOptions;
use crate::OpenError;
use crate::cartesian::CartesianVersion;
use crate::cartesian::messages::cartesian_reply::{self, Values};
use crate::cartesian::messages::{Query, Request};
use crate::device_ports::{Link, RemotePorts, RpcPort, stream_port};
use crate::reconnect::to_text;

const RPC: RpcPort = RpcPort::USUAL;
/// Index of the port for commands.
const COMMAND: usize = 0;
/// Index of the port for poses.
const STATE: usize = 2;
/// Index of the port for events.
const EVENTS: usize = 3;

/// Ports connected to a server.
#[derive(Debug)]
pub(super) struct ToolLink {
    pub(super) ports: RemotePorts,
    pub(super) latest: Arc<LatestPose>,
}

impl Link for ToolLink {
    fn close(self) -> impl Future<Output = ()> + Send {
        self.ports.close()
    }
}

impl ToolLink {
    /// Opens and connects the ports in the order of stock; on an error nothing stays open.
    pub(super) async fn open(
        network: &Network,
        options: &RemoteCartesianOptions,
    ) -> Result<Self, OpenError> {
        let options = &options.common;
        let needed = [RPC.remote, "command:i", "state:o", "events:o"];
        options.check_remote(network, &needed).await?;
        let latest = Arc::new(LatestPose::new(options.max_state_age));
        let (poses, events) = (latest.clone(), latest.clone());
        let wanted = vec![
            ("command:o", PortOptions::new()),
            (RPC.local, PortOptions::new().rpc_client()),
            ("state:i", stream_port(move |received| poses.take(received))),
            (
                "events:i",
                stream_port(move |received| events.take_event(received)),
            ),
        ];
        let mut link = Self {
            ports: RemotePorts::open(network, options, "server", RPC, wanted).await?,
            latest,
        };
        let greeted = link.greet().await;
        link.unless_failed(greeted).await.map(|(link, ())| link)
    }

    async fn greet(&mut self) -> Result<(), OpenError> {
        self.ports.connect_rpc().await?;
        let info = self
            .question(Query::Info, "its version", Values::info)
            .await?;
        let version = info.server_version.as_str();
        let is_known = CartesianVersion::from_text(version).is_some();
        self.ports
            .check_version(version, is_known, "2.0, or 1.1 of older ones")?;
        self.ports.connect(COMMAND, "command:i").await?;
        let newest = &self.latest.newest;
        self.ports
            .subscribe_with_events(("state:o", STATE), ("events:o", EVENTS), newest)
            .await?;
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

    async fn question<T>(
        &self,
        question: Query,
        what: &'static str,
        read: impl Fn(&Values) -> Option<T>,
    ) -> Result<T, OpenError> {
        let request = Request::Get(question);
        let asked = self.ask(&request).await;
        let read = asked.and_then(|values| self.read(&request, &values, read));
        read.map_err(|source| OpenError::Query {
            question: what,
            source,
        })
    }

    /// Sends a request, and waits for the reply.
    pub(super) async fn ask(&self, request: &Request) -> Result<Values, DeviceError> {
        let message = request.to_bottle();
        match cartesian_reply::read(self.ports.call(&message).await?) {
            Some(Some(values)) => Ok(values),
            Some(None) => Err(self.refused(&message)),
            None => Err(self.unreadable(request)),
        }
    }

    /// Returns what `read` makes of the reply to `request`.
    pub(super) fn read<T>(
        &self,
        request: &Request,
        values: &Values,
        read: impl Fn(&Values) -> Option<T>,
    ) -> Result<T, DeviceError> {
        read(values).ok_or_else(|| self.unreadable(request))
    }

    fn unreadable(&self, request: &Request) -> DeviceError {
        let asked = to_text(&request.to_bottle());
        self.ports.unreadable(
            format!("understanding the answer to `{asked}`"),
            "whether it is a cartesian controller",
        )
    }

    fn refused(&self, message: &Bottle) -> DeviceError {
        self.ports
            .refused(to_text(message), "the log of the server")
    }

    /// Sends a command without a reply.
    pub(super) async fn order(&self, request: &Request) -> Result<(), DeviceError> {
        let message = request.to_bottle();
        self.ports.write(COMMAND, "command:i", &message, "").await
    }
}
