//! A client: its ports, connections, calls, closing.

use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinSet;
use yarp_devices::DeviceError;
use yarp_ports::{Answer, Network, Port, PortOptions, Received, ReconnectingConnection, blocking};
use yarp_wire::Bottle;
use yarp_wire::message::WireObject;

use super::{LatestValue, RemoteOptions};
use crate::OpenError;
use crate::open_ports::{close_all, open};
use crate::reconnect::{
    PORT_CLOSE_TIMEOUT, RPC_CARRIER, WATCH_INTERVAL, check_exists, connect_supervised, subscribe,
    to_text,
};

/// Queries on `LOCAL/rpc:o`, a stream on an input port, and their connections, which are made again when they are
/// lost. Dropping it closes the ports; that takes a few seconds at most.
#[derive(Debug)]
pub(crate) struct RemotePorts {
    /// Taken only on drop.
    link: Option<Arc<Link>>,
}

#[derive(Debug)]
struct Link {
    rpc: Port,
    stream: Port,
    remote: String,
    rpc_timeout: Duration,
    kept: Vec<ReconnectingConnection>,
    /// Asks the server for its stream again; ends with the link.
    asking: JoinSet<()>,
}

impl RemotePorts {
    /// Opens two ports and connects them to `REMOTE/rpc:i` and from `REMOTE/STREAM`; on an error nothing stays open.
    ///
    /// * `stream`: suffixes of the port of the server and of the client; `take` stores a message in `latest`.
    /// * Blocks for a few deadlines at the most.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`].
    pub(crate) fn open<T: Send + 'static>(
        network: &Network,
        options: RemoteOptions,
        stream: (&'static str, &'static str),
        latest: Arc<LatestValue<T>>,
        take: impl Fn(&Received) -> Option<T> + Send + Sync + 'static,
    ) -> Result<Self, OpenError> {
        let network = network.with_timeout(options.rpc_timeout);
        let opening = async move { Link::open(&network, &options, stream, latest, take).await };
        let link = blocking::wait(opening)?;
        Ok(Self {
            link: Some(Arc::new(link)),
        })
    }

    fn link(&self) -> &Arc<Link> {
        self.link.as_ref().expect("taken only on drop")
    }

    /// Returns the name of the server, as it was given.
    pub(crate) fn remote(&self) -> &str {
        &self.link().remote
    }

    /// Sends a request and returns what `read` makes of the reply.
    ///
    /// Errors: [`DeviceError::Remote`]; also if `read` returns `None`.
    pub(crate) fn call<T>(
        &self,
        request: impl WireObject + Send + Sync + 'static,
        read: impl FnOnce(Bottle) -> Option<T>,
    ) -> Result<T, DeviceError> {
        let link = self.link().clone();
        let peer = format!("{}/rpc:i", link.remote);
        let asked = to_text(&request);
        let failed =
            |step: String, source: Option<Box<dyn Error + Send + Sync>>| DeviceError::Remote {
                advice: format!(
                    "`yarp ping {peer}`; when the server is back, it is connected again"
                ),
                peer: peer.clone(),
                step,
                source,
            };
        let calling = async move {
            let timeout = link.rpc_timeout;
            link.rpc.call_within::<Bottle>(&request, timeout).await
        };
        let reply = blocking::wait(calling)
            .map_err(|error| failed(format!("`{asked}`"), Some(Box::new(error))))?;
        let text = reply.to_string();
        read(reply).ok_or_else(|| {
            failed(
                format!("understanding the reply `{text}` to `{asked}`"),
                None,
            )
        })
    }
}

impl Drop for RemotePorts {
    fn drop(&mut self) {
        // Calls borrow the device, so none is in progress.
        if let Some(link) = self.link.take().and_then(Arc::into_inner) {
            blocking::wait(link.close());
        }
    }
}

impl Link {
    async fn open<T: Send + 'static>(
        network: &Network,
        options: &RemoteOptions,
        (from, to): (&str, &str),
        latest: Arc<LatestValue<T>>,
        take: impl Fn(&Received) -> Option<T> + Send + Sync + 'static,
    ) -> Result<Self, OpenError> {
        let remote = |suffix: &str| format!("{}/{suffix}", options.remote);
        let local = |suffix: &str| format!("{}/{suffix}", options.local);
        for suffix in [from, "rpc:i"] {
            check_exists(network, remote(suffix)).await?;
        }
        let stored = latest.clone();
        let store = move |received: &mut Received| {
            match take(received) {
                Some(value) => stored.store(value),
                None => tracing::warn!(from = %received.from, "not a message of this device"),
            }
            Answer::Nothing
        };
        let input = PortOptions::new().handler(store).input_only();
        let stream = open(network, local(to), input).await?;
        let rpc = match open(network, local("rpc:o"), PortOptions::new().rpc_client()).await {
            Ok(rpc) => rpc,
            Err(error) => {
                close_all([stream]).await;
                return Err(error);
            }
        };
        let mut link = Self {
            rpc,
            stream,
            remote: options.remote.clone(),
            rpc_timeout: options.rpc_timeout,
            kept: Vec::new(),
            asking: JoinSet::new(),
        };
        let ends = (remote(from), remote("rpc:i"));
        match link.connect(network, &options.carrier, ends, latest).await {
            Ok(()) => Ok(link),
            Err(error) => {
                link.close().await;
                Err(error)
            }
        }
    }

    async fn connect<T: Send + 'static>(
        &mut self,
        network: &Network,
        carrier: &str,
        (stream, rpc): (String, String),
        latest: Arc<LatestValue<T>>,
    ) -> Result<(), OpenError> {
        let kept = connect_supervised(&self.rpc, &rpc, RPC_CARRIER, self.rpc_timeout).await?;
        self.kept.push(kept);
        let are_missing = move || latest.is_older_than(2 * WATCH_INTERVAL);
        let ends = (stream.as_str(), self.stream.name());
        subscribe(network, ends, carrier, &mut self.asking, are_missing).await
    }

    /// Closes the ports; takes a few seconds at the most.
    async fn close(mut self) {
        self.asking.shutdown().await;
        let closing = close_all([self.rpc, self.stream]);
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, closing)
            .await
            .is_err()
        {
            tracing::warn!(remote = %self.remote, "closing took too long; names may be left behind");
        }
    }
}
