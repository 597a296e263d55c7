//! The two ports of a client, the conversation at opening, and calls.
//!
//! ```text
//! images   LOCAL            <- REMOTE
//! calls    LOCAL/rpc_client -> REMOTE/rpc
//! ```

use std::sync::Arc;

use yarp_devices::DeviceError;
use yarp_ports::{Network, PortError, PortOptions};
use yarp_wire::WireVersion;
use yarp_wire::message::WireObject;

use super::latest_image::LatestImage;
use super::remote_camera_options::RemoteFrameGrabberOptions;
use crate::OpenError;
use crate::control_board::messages::ProtocolVersion;
use crate::device_ports::{LatestValue, Link, RemotePorts, RpcPort, stream_port};
use crate::frame_grabber::messages::{Answer, As, Reply, Request};
use crate::reconnect::{to_text, unsupported_request};
use crate::thrift::{ReturnCode, ServiceVersion};

const RPC: RpcPort = RpcPort {
    local: "rpc_client",
    remote: "rpc",
};
/// Index of the port for images, if they are streamed.
const STREAM: usize = 1;

/// Ports connected to a server.
#[derive(Debug)]
pub(super) struct CameraLink {
    pub(super) wire_version: WireVersion,
    pub(super) ports: RemotePorts,
    pub(super) latest: Arc<LatestImage>,
}

impl Link for CameraLink {
    fn close(self) -> impl Future<Output = ()> + Send {
        self.ports.close()
    }
}

impl CameraLink {
    /// Opens and connects the ports, and queries the protocol version; on an error nothing stays open.
    pub(super) async fn open(
        network: &Network,
        options: &RemoteFrameGrabberOptions,
    ) -> Result<Self, OpenError> {
        let common = &options.common;
        common.check_remote(network, &[RPC.remote]).await?;
        if options.streams {
            common.check_remote(network, &[""]).await?;
        }
        let latest = Arc::new(LatestValue::new("image", common.max_state_age));
        let mut calling = PortOptions::new().rpc_client();
        if let Some(wire_version) = options.wire_version {
            // A server of both wire versions reports 3.x, whose messages it expects from callers.
            calling = calling.peer_version(wire_version);
        }
        let mut wanted = vec![(RPC.local, calling)];
        if options.streams {
            let newest = latest.clone();
            wanted.push(("", stream_port(move |received| newest.take(received))));
        }
        let mut link = Self {
            wire_version: WireVersion::V3,
            ports: RemotePorts::open(network, common, "camera", RPC, wanted).await?,
            latest,
        };
        let greeted = link.greet(options).await;
        link.unless_failed(greeted).await.map(|(link, ())| link)
    }

    /// Connects the ports in the order of stock, and finds out the wire version.
    async fn greet(&mut self, options: &RemoteFrameGrabberOptions) -> Result<(), OpenError> {
        if options.streams {
            // Cameras may be slow on purpose.
            let age = options.common.max_state_age;
            self.ports.subscribe("", STREAM, &self.latest, age).await?;
        }
        self.ports.connect_rpc().await?;
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
        match self.ports.send::<ServiceVersion>(&call).await {
            Ok(version) if version.protocol == expected => Ok(WireVersion::V4),
            Ok(version) => Err(OpenError::ProtocolVersion {
                peer: self.ports.rpc_peer().to_owned(),
                expected: ProtocolVersion::only(expected),
                found: ProtocolVersion::only(version.protocol),
            }),
            Err(PortError::Unreadable { .. }) => Ok(WireVersion::V3),
            Err(error) => {
                let source = self.ports.lost(&call, error);
                Err(OpenError::Query { question, source })
            }
        }
    }

    /// Returns whether images are streamed.
    pub(super) fn streams(&self) -> bool {
        self.ports.count() > STREAM
    }

    /// Sends a request, and waits for the reply.
    pub(super) async fn exchange(&self, request: &Request) -> Result<Answer, DeviceError> {
        match self.wire_version {
            WireVersion::V3 => self.exchange_words(request).await,
            WireVersion::V4 => self.exchange_call(request).await,
        }
    }

    async fn exchange_words(&self, request: &Request) -> Result<Answer, DeviceError> {
        let message = request
            .to_bottle()
            .ok_or_else(|| unsupported_request(request))?;
        let reply = self.ports.call(&message).await?;
        match request.read_reply(&reply) {
            Some(Reply::Done(answer)) => Ok(answer),
            Some(Reply::Refused) => Err(self
                .ports
                .refused(to_text(&message), "the log of the server")),
            None => Err(self.unreadable(&message)),
        }
    }

    async fn exchange_call(&self, request: &Request) -> Result<Answer, DeviceError> {
        let message = request
            .to_call()
            .ok_or_else(|| unsupported_request(request))?;
        let message = As(WireVersion::V4, message);
        let reply = self.ports.call(&message).await?;
        match ReturnCode::read(reply) {
            Some((ReturnCode::Ok, values)) => {
                let answer = request.read_results(&values);
                answer.ok_or_else(|| self.unreadable(&message))
            }
            Some((code, _)) => {
                let advice = format!("the log of the server; it answered that {code}");
                Err(self.ports.refused(to_text(&message), advice))
            }
            None => Err(self.unreadable(&message)),
        }
    }

    /// Returns the error for a reply of an unexpected kind. It may be an image, so it is not shown.
    pub(super) fn unreadable(&self, message: &impl WireObject) -> DeviceError {
        self.ports.unreadable(
            format!("understanding the answer to `{}`", to_text(message)),
            format!("whether it is a camera of YARP {}", self.wire_version),
        )
    }
}
