//! Connections that this port makes to read from: the writer is asked for its pictures.

use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;

use bytes::{Bytes, BytesMut};
use yarp_wire::Limits;
use yarp_wire::carrier::{Carrier, CarrierSpec};
use yarp_wire::mjpeg::{self, MjpegError, PartReader};

use super::core::{Core, Entry, InputEntry};
use super::counters::Meter;
use super::expanding::{Expanded, Expanding};
use super::monitor::{Chain, MonitorSide};
use super::own_thread::Steering;
use super::qos::SocketHandle;
use super::received::Received;
use crate::error::PortError;
use crate::network::Place;
use crate::stream::{self, Inflow, Socket};

/// A connection whose head has been read.
struct Pull {
    core: Arc<Core>,
    from: String,
    address: IpAddr,
    stream: Arc<Socket>,
    input: Inflow,
    parts: PartReader,
    meter: Arc<Meter>,
    monitors: Option<Arc<Chain>>,
    connection: u64,
}

impl Core {
    /// Connects to a writer and reads from it until it ends, or either side is told to end it.
    pub(super) async fn pull(
        self: &Arc<Self>,
        place: &Place,
        spec: &CarrierSpec,
        carrier: &'static Carrier,
    ) -> Result<(), PortError> {
        let ends = (place.name.as_str(), self.name.as_str());
        let monitors = self.monitors(&spec.modifiers, MonitorSide::Receive, ends)?;
        let deadline = self.network.deadline();
        let opening = open(self, place, spec);
        let mut pull =
            stream::within(deadline, &place.name, "head of the response", opening).await?;
        let (steering, mut displaced) = Steering::new();
        let id = self.next_number();
        self.add_input(InputEntry {
            id,
            from: place.name.clone(),
            carrier_text: spec.to_string(),
            carrier,
            socket: SocketHandle::of(&pull.stream),
            meter: pull.meter.clone(),
            monitors: monitors.clone(),
            steering,
        });
        pull.monitors = monitors;
        pull.connection = id;
        let core = self.clone();
        let entry = Entry {
            id,
            core: core.clone(),
        };
        self.own(async move {
            let _entry = entry;
            let mut closing = core.cancelled.clone();
            let from = pull.from.clone();
            let end = tokio::select! {
                end = pull.run() => end,
                () = displaced.ended() => Ok(()),
                () = closing.cancelled() => Ok(()),
            };
            if let Err(error) = end {
                tracing::warn!(port = %core.name, from, "dropping a connection: {error}");
            }
        });
        Ok(())
    }
}

/// Connects, asks, and waits for the head of the response.
async fn open(core: &Arc<Core>, place: &Place, spec: &CarrierSpec) -> Result<Pull, PortError> {
    let Place {
        name, host, port, ..
    } = place;
    let lost = |error: io::Error| {
        let address = format!("{host}:{port}");
        PortError::connect(name, address, "head of the response", error)
    };
    let stream = Arc::new(stream::connect(name, host, *port, &core.network).await?);
    let address = stream.tcp().and_then(|tcp| tcp.peer_addr().ok());
    let request = mjpeg::request(spec.modifier("path"), &format!("{host}:{port}"));
    let mut output = BytesMut::from(request.as_str());
    stream::write_all(&stream, &mut output)
        .await
        .map_err(lost)?;
    let mut pull = Pull {
        core: core.clone(),
        from: name.clone(),
        address: address.map_or(Ipv4Addr::UNSPECIFIED.into(), |address| address.ip()),
        stream,
        input: Inflow::default(),
        parts: PartReader::new(Limits::DEFAULT),
        meter: Arc::default(),
        monitors: None,
        connection: 0,
    };
    // Lines are only taken off the buffer here: the first part waits for `run`.
    while !pull
        .parts
        .open(&mut pull.input.bytes)
        .map_err(|source| PortError::Pictures {
            peer: name.clone(),
            source,
        })?
    {
        if pull.input.read(&pull.stream, 0).await.map_err(lost)? == 0 {
            return Err(lost(io::ErrorKind::UnexpectedEof.into()));
        }
    }
    Ok(pull)
}

impl Pull {
    /// Reads and delivers until the writer ends the connection.
    async fn run(mut self) -> Result<(), MjpegError> {
        let mut expanding = Expanding::default();
        let mut end = None;
        loop {
            while end.is_none() && expanding.has_room() {
                match self.parts.read(&mut self.input.bytes) {
                    Ok(Some(part)) => expanding.push(part),
                    Ok(None) => break,
                    Err(MjpegError::Ended) => end = Some(Ok(())),
                    Err(error) => end = Some(Err(error)),
                }
            }
            let missing = self.parts.missing(&self.input.bytes);
            let reads = end.is_none() && expanding.has_room();
            tokio::select! {
                biased;
                Some((image, envelope)) = expanding.next() => {
                    self.deliver(image, envelope).await;
                }
                read = self.input.read(&self.stream, missing), if reads => match read {
                    Ok(0) => end = Some(Ok(())),
                    Ok(_) => {}
                    Err(error) => {
                        let from = &self.from;
                        tracing::debug!(port = %self.core.name, from, "a connection failed: {error}");
                        end = Some(Ok(()));
                    }
                },
                else => return end.unwrap_or(Ok(())),
            }
        }
    }

    /// Hands an image to the owner; a picture that is none is passed over.
    async fn deliver(&self, image: Expanded, envelope: Option<Bytes>) {
        let payload = match image {
            Some(Ok(payload)) => payload,
            Some(Err(error)) => {
                let from = &self.from;
                tracing::debug!(port = %self.core.name, from, "a picture is dropped: {error}");
                return;
            }
            None => return,
        };
        self.meter.count(payload.len(), envelope.as_deref());
        let received = Received {
            payload,
            envelope,
            from: self.from.as_str().into(),
            address: self.address,
            connection: self.connection,
            wants_reply: false,
            responder: None,
        };
        // Nothing can be said back.
        let monitors = self.monitors.as_ref();
        self.core.take(monitors, received, false).await;
    }
}
