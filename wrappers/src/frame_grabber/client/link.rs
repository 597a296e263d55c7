//! The two ports of a client, the conversation at opening, and calls.
//!
//! ```text
//! images   LOCAL            <- REMOTE
//! calls    LOCAL/rpc_client -> REMOTE/rpc
//! ```

use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinSet;
use yarp_devices::DeviceError;
use yarp_ports::{
    Network, Port, PortError, PortOptions, Received, ReconnectingConnection, blocking,
};
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::{Bottle, WireVersion};

use super::latest_image::LatestImage;
use super::options::RemoteFrameGrabberOptions;
use crate::OpenError;
use crate::control_board::messages::ProtocolVersion;
use crate::frame_grabber::messages::{Answer, As, Reply, Request};
use crate::open_ports::{close_all, open};
use crate::reconnect::{
    PORT_CLOSE_TIMEOUT, RPC_CARRIER, WATCH_INTERVAL, check_exists, connect_supervised, subscribe,
    to_text, unsupported_request,
};
use crate::thrift::{ReturnCode, ServiceVersion};

/// Ports connected to a server.
#[derive(Debug)]
pub(super) struct Link {
    pub(super) wire_version: WireVersion,
    rpc: Port,
    stream: Option<Port>,
    remote: String,
    rpc_peer: String,
    rpc_timeout: Duration,
    pub(super) latest: Arc<LatestImage>,
    /// The connection for calls, made again whenever it is lost.
    kept: Vec<ReconnectingConnection>,
    /// Asks the server for its images again; ends with the link.
    asking: JoinSet<()>,
}

impl Link {
    /// Opens and connects the ports, and queries the protocol version; on an error nothing stays open.
    pub(super) async fn open(
        network: &Network,
        options: &RemoteFrameGrabberOptions,
    ) -> Result<Self, OpenError> {
        let rpc_peer = format!("{}/rpc", options.remote);
        // Before anything of our own is opened: usually the server is just not running.
        check_exists(network, rpc_peer.clone()).await?;
        if options.streams {
            check_exists(network, options.remote.clone()).await?;
        }
        let latest = Arc::new(LatestImage::new(options.max_state_age));
        let rpc_name = format!("{}/rpc_client", options.local);
        let mut calling = PortOptions::new().rpc_client();
        if let Some(wire_version) = options.wire_version {
            // A server of both wire versions reports 3.x, whose messages it expects from callers.
            calling = calling.peer_version(wire_version);
        }
        let rpc = open(network, rpc_name, calling).await?;
        let mut link = Self {
            wire_version: WireVersion::V3,
            rpc,
            stream: None,
            remote: options.remote.clone(),
            rpc_peer,
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

    /// Connects the ports in the order of stock, and finds out the wire version.
    async fn greet(
        &mut self,
        network: &Network,
        options: &RemoteFrameGrabberOptions,
    ) -> Result<(), OpenError> {
        if options.streams {
            let newest = self.latest.clone();
            let take = move |received: &mut Received| {
                newest.take(received);
                yarp_ports::Answer::Nothing
            };
            let port = PortOptions::new().handler(take).input_only();
            let stream = open(network, options.local.clone(), port).await?;
            let local = stream.name().to_owned();
            self.stream = Some(stream);
            let latest = self.latest.clone();
            // Cameras may be slow on purpose.
            let silence = options.max_state_age.max(2 * WATCH_INTERVAL);
            let are_missing = move || latest.is_older_than(silence);
            let ends = (options.remote.as_str(), local.as_str());
            subscribe(
                network,
                ends,
                &options.carrier,
                &mut self.asking,
                are_missing,
            )
            .await?;
        }
        let kept = connect_supervised(&self.rpc, &self.rpc_peer, RPC_CARRIER, self.rpc_timeout);
        self.kept.push(kept.await?);
        self.wire_version = match options.wire_version {
            Some(wire_version) => wire_version,
            None => self.ask_generation().await?,
        };
        Ok(())
    }

    /// Finds out the wire version: a peer that answers the query for the protocol version is 4.0; 3.x does not
    /// understand it.
    async fn ask_generation(&self) -> Result<WireVersion, OpenError> {
        let question = "which version of the protocol it speaks";
        let call = Request::ProtocolVersion.to_call().unwrap_or_default();
        let expected = ServiceVersion::SERVED.protocol;
        match self.send::<ServiceVersion>(&call).await {
            Ok(version) if version.protocol == expected => Ok(WireVersion::V4),
            Ok(version) => Err(OpenError::ProtocolVersion {
                peer: self.rpc_peer.clone(),
                expected: ProtocolVersion::only(expected),
                found: ProtocolVersion::only(version.protocol),
            }),
            Err(PortError::Unreadable { .. }) => Ok(WireVersion::V3),
            Err(error) => {
                let source = self.lost(&call, error);
                Err(OpenError::Query { question, source })
            }
        }
    }

    pub(super) fn remote(&self) -> &str {
        &self.remote
    }

    pub(super) fn streams(&self) -> bool {
        self.stream.is_some()
    }

    /// Sends a request, and waits for the reply.
    pub(super) fn call(self: &Arc<Self>, request: Request) -> Result<Answer, DeviceError> {
        let link = self.clone();
        blocking::wait(async move {
            let answer = match link.wire_version {
                WireVersion::V3 => link.exchange_words(&request).await,
                WireVersion::V4 => link.exchange_call(&request).await,
            };
            // Before anybody learns of the answer, so that dropping the camera finds itself alone.
            drop(link);
            answer
        })
    }

    async fn exchange_words(&self, request: &Request) -> Result<Answer, DeviceError> {
        let message = request
            .to_bottle()
            .ok_or_else(|| unsupported_request(request))?;
        let reply = self.send::<Bottle>(&message).await;
        let reply = reply.map_err(|error| self.lost(&message, error))?;
        match request.read_reply(&reply) {
            Some(Reply::Done(answer)) => Ok(answer),
            Some(Reply::Refused) => Err(self.refused(&message, "the log of the server".to_owned())),
            None => Err(self.unreadable(&message)),
        }
    }

    async fn exchange_call(&self, request: &Request) -> Result<Answer, DeviceError> {
        let message = request
            .to_call()
            .ok_or_else(|| unsupported_request(request))?;
        let message = As(WireVersion::V4, message);
        let reply = self.send::<Bottle>(&message).await;
        let reply = reply.map_err(|error| self.lost(&message, error))?;
        match ReturnCode::read(reply) {
            Some((ReturnCode::Ok, values)) => {
                let answer = request.read_results(&values);
                answer.ok_or_else(|| self.unreadable(&message))
            }
            Some((code, _)) => {
                let advice = format!("the log of the server; it answered that {code}");
                Err(self.refused(&message, advice))
            }
            None => Err(self.unreadable(&message)),
        }
    }

    async fn send<R: ReadObject>(&self, message: &impl WireObject) -> Result<R, PortError> {
        self.rpc.call_within::<R>(message, self.rpc_timeout).await
    }

    fn refused(&self, message: &impl WireObject, advice: String) -> DeviceError {
        DeviceError::Refused {
            peer: self.rpc_peer.clone(),
            step: format!("`{}`", to_text(message)),
            advice,
        }
    }

    fn lost(&self, message: &impl WireObject, error: PortError) -> DeviceError {
        let peer = &self.rpc_peer;
        DeviceError::Remote {
            peer: peer.clone(),
            step: format!("`{}`", to_text(message)),
            advice: format!("`yarp ping {peer}`; when the camera is back, it is connected again"),
            source: Some(Box::new(error)),
        }
    }

    /// Returns the error for a reply of an unexpected kind. It may be an image, so it is not shown.
    pub(super) fn unreadable(&self, message: &impl WireObject) -> DeviceError {
        DeviceError::Remote {
            peer: self.rpc_peer.clone(),
            step: format!("understanding the answer to `{}`", to_text(message)),
            advice: format!("whether it is a camera of YARP {}", self.wire_version),
            source: None,
        }
    }

    /// Closes the ports; takes a few seconds at the most.
    pub(super) async fn close(mut self) {
        self.asking.shutdown().await;
        let closing = close_all([self.rpc].into_iter().chain(self.stream));
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, closing)
            .await
            .is_err()
        {
            tracing::warn!(remote = %self.remote, "closing took too long; names may be left behind");
        }
    }
}
