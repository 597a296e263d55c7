//! The two ports of a client, the conversation at opening, and calls.
//!
//! ```text
//! images   LOCAL            <- REMOTE
//! calls    LOCAL/rpc_client -> REMOTE/rpc
//! ```

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use yarp_devices::DeviceError;
use yarp_ports::{Network, PortError, PortOptions, Received, error_chain};
use yarp_wire::WireVersion;
use yarp_wire::message::WireObject;

use super::latest_image::LatestImage;
use super::remote_camera_options::RemoteFrameGrabberOptions;
use crate::OpenError;
use crate::control_board::messages::ProtocolVersion;
use crate::device_ports::{LatestValue, Link, RemotePorts, RpcPort, stream_port};
use crate::frame_grabber::messages::{Answer, As, Reply, Request};
use crate::reconnect::{Turn, WATCH_INTERVAL, to_text, unsupported_request};
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
    pause: Arc<Pause>,
}

/// A pause of the stream of images.
#[derive(Debug, Default)]
struct Pause {
    is_paused: AtomicBool,
    /// True if the server could not be reached when the stream was last resumed.
    resume_failed: AtomicBool,
    turn: Turn,
}

impl Pause {
    /// Returns whether the server has to be asked for images again.
    fn are_missing(&self, latest: &LatestImage, age: Duration) -> bool {
        if self.is_paused.load(Ordering::Acquire) {
            return false;
        }
        let failed = self.resume_failed.load(Ordering::Acquire);
        latest.is_older_than(age) || (failed && latest.arrived().is_none())
    }
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
        let pause = Arc::<Pause>::default();
        let mut calling = PortOptions::new().rpc_client();
        if let Some(wire_version) = options.wire_version {
            // A server of both wire versions reports 3.x, whose messages it expects from callers.
            calling = calling.peer_version(wire_version);
        }
        let mut wanted = vec![(RPC.local, calling)];
        if options.streams {
            let (newest, paused) = (latest.clone(), pause.clone());
            let take = move |received: &Received| {
                if !paused.is_paused.load(Ordering::Acquire) {
                    newest.take(received);
                }
            };
            wanted.push(("", stream_port(take)));
        }
        let mut link = Self {
            wire_version: WireVersion::V3,
            ports: RemotePorts::open(network, common, "camera", RPC, wanted).await?,
            latest,
            pause,
        };
        let greeted = link.greet(options).await;
        link.unless_failed(greeted).await.map(|(link, ())| link)
    }

    /// Connects the ports in the order of stock, and finds out the wire version.
    async fn greet(&mut self, options: &RemoteFrameGrabberOptions) -> Result<(), OpenError> {
        if options.streams {
            // Cameras may be slow on purpose.
            let age = options.common.max_state_age.max(2 * WATCH_INTERVAL);
            let (pause, latest) = (self.pause.clone(), self.latest.clone());
            let turn = pause.turn.clone();
            let are_missing = Box::new(move || pause.are_missing(&latest, age));
            self.ports
                .subscribe_while(("", STREAM), turn, are_missing)
                .await?;
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

    /// Ends the stream of images, or begins it anew without any image of before.
    pub(super) async fn set_paused(&self, paused: bool) {
        if !self.streams() {
            return;
        }
        let pause = &self.pause;
        let _turn = pause.turn.lock().await;
        self.latest.clear();
        pause.is_paused.store(paused, Ordering::Release);
        let done = self.ports.set_connected(("", STREAM), !paused).await;
        if paused {
            // One that was being taken when the pause began.
            self.latest.clear();
        }
        let failed = done.is_err() && !paused;
        pause.resume_failed.store(failed, Ordering::Release);
        if let Err(error) = done {
            let (remote, error) = (self.ports.remote(), error_chain(&error));
            match paused {
                // The server goes on sending; nobody else is worse off.
                true => tracing::warn!(remote, error, "the images cannot be paused"),
                // It is tried again as long as none arrives.
                false => tracing::debug!(remote, error, "the images cannot be resumed yet"),
            }
        }
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
