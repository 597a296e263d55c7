//! Connections that this port makes in order to read: it requests JPEG images from the writer.
//!
//! Each has a dedicated thread from the beginning: decoding takes milliseconds and must not delay
//! other connections. Meanwhile the system receives the next image.

use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;

use bytes::BytesMut;
use tokio::task::yield_now;
use yarp_wire::Limits;
use yarp_wire::carrier::{Carrier, CarrierSpec};
use yarp_wire::mjpeg::{self, MjpegError, Part, PartReader};

use super::connections::{Entry, InputEntry};
use super::counters::Meter;
use super::dedicated_thread::{ConnectionControl, DedicatedThread};
use super::dispatch::Dispatcher;
use super::jpeg_decoder::PooledJpegDecoder;
use super::monitor::{Chain, MonitorSide};
use super::received_message::{Received, ValuesReservation};
use super::socket_handle::SocketHandle;
use crate::connect::connect;
use crate::error::PortError;
use crate::log_text::printable;
use crate::network::Endpoint;
use crate::socket::{self, ReadBuffer, Socket};

/// A connection whose head has been read.
struct Pull {
    reader: Arc<Dispatcher>,
    from: String,
    address: IpAddr,
    stream: Arc<Socket>,
    input: ReadBuffer,
    parts: PartReader,
    jpeg_decoder: PooledJpegDecoder,
    meter: Arc<Meter>,
    monitors: Option<Arc<Chain>>,
    connection: u64,
}

/// Connects to a writer and reads from it until it closes, or either side is asked to close it.
pub(super) async fn pull(
    reader: &Arc<Dispatcher>,
    endpoint: &Endpoint,
    spec: &CarrierSpec,
    carrier: &'static Carrier,
) -> Result<(), PortError> {
    let ends = (endpoint.name.as_str(), reader.port.name.as_str());
    let monitors = reader
        .monitors()
        .of_carrier(&spec.modifiers, MonitorSide::Receive, ends)?;
    let deadline = reader.port.network.timeout();
    let opening = open(reader, endpoint, spec);
    let mut pull =
        socket::within(deadline, &endpoint.name, "head of the response", opening).await?;
    let thread = DedicatedThread::start(None).await.map_err(|error| {
        let address = format!("{}:{}", endpoint.host, endpoint.port);
        PortError::connect(&endpoint.name, address, "thread for its pictures", error)
    })?;
    let (control, mut displaced) = ConnectionControl::new();
    control.give(thread.clone());
    let id = reader.connections.next_number();
    reader.connections.add_input(InputEntry {
        id,
        from: endpoint.name.clone(),
        carrier_text: spec.to_string(),
        carrier,
        socket: SocketHandle::of(&pull.stream),
        meter: pull.meter.clone(),
        monitors: monitors.clone(),
        control,
    });
    pull.monitors = monitors;
    pull.connection = id;
    let port = reader.port.clone();
    let entry = Entry {
        id,
        connections: reader.connections.clone(),
    };
    let mut closing = port.cancelled.clone();
    let from = pull.from.clone();
    let begin = move || {
        pull.stream = pull.stream.renewed();
        let socket = SocketHandle::of(&pull.stream);
        pull.reader.connections.move_input(id, socket.clone());
        let running = async move {
            tokio::select! {
                end = pull.run() => end,
                () = displaced.ended() => Ok(()),
                () = closing.cancelled() => Ok(()),
            }
        };
        (socket, running)
    };
    reader.connections.own(async move {
        let _entry = entry;
        if let Some(Err(error)) = thread.run(begin).await {
            let from = printable(&from);
            tracing::warn!(port = %port.name, %from, "dropping a connection: {error}");
        }
    });
    Ok(())
}

/// Connects, asks, and waits for the head of the response.
async fn open(
    reader: &Arc<Dispatcher>,
    endpoint: &Endpoint,
    spec: &CarrierSpec,
) -> Result<Pull, PortError> {
    let Endpoint {
        name, host, port, ..
    } = endpoint;
    let lost = |error: io::Error| {
        let address = format!("{host}:{port}");
        PortError::connect(name, address, "head of the response", error)
    };
    let stream = Arc::new(connect(name, host, *port, &reader.port.network).await?);
    let address = stream.tcp().and_then(|tcp| tcp.peer_addr().ok());
    let request = mjpeg::request(spec.modifier("path"), &format!("{host}:{port}"));
    let mut output = BytesMut::from(request.as_str());
    socket::write_all(&stream, &mut output)
        .await
        .map_err(lost)?;
    let mut pull = Pull {
        reader: reader.clone(),
        from: name.clone(),
        address: address.map_or(Ipv4Addr::UNSPECIFIED.into(), |address| address.ip()),
        stream,
        input: ReadBuffer::default(),
        parts: PartReader::new(Limits::DEFAULT),
        jpeg_decoder: PooledJpegDecoder::default(),
        meter: Arc::default(),
        monitors: None,
        connection: 0,
    };
    // Lines are only taken off the buffer here: the first part waits for `run`.
    while pull
        .parts
        .open(&mut pull.input.bytes)
        .map_err(|source| PortError::Mjpeg {
            peer: name.clone(),
            source,
        })?
        .is_none()
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
        while let Some(part) = self.next().await? {
            self.deliver(&part).await;
            // A continuous stream of images must not delay the request to close.
            yield_now().await;
        }
        Ok(())
    }

    /// Waits for the next image; `None` at the end of the connection.
    async fn next(&mut self) -> Result<Option<Part>, MjpegError> {
        loop {
            match self.parts.read(&mut self.input.bytes) {
                Ok(None) => {}
                Err(MjpegError::Ended) => return Ok(None),
                part => return part,
            }
            let missing = self.parts.missing(&self.input.bytes);
            match self.input.read(&self.stream, missing).await {
                Ok(0) => return Ok(None),
                Ok(_) => {}
                Err(error) => {
                    let from = &self.from;
                    tracing::debug!(port = %self.reader.port.name, from, "a connection failed: {error}");
                    return Ok(None);
                }
            }
        }
    }

    /// Passes the decoded image to the owner; an invalid one is skipped.
    async fn deliver(&mut self, part: &Part) {
        let payload = match self.jpeg_decoder.decode(&part.body) {
            Ok(payload) => payload,
            Err(error) => {
                let from = &self.from;
                tracing::debug!(port = %self.reader.port.name, from, "a picture is dropped: {error}");
                return;
            }
        };
        let envelope = mjpeg::comment(&part.body);
        self.meter.count(payload.len(), envelope.as_deref());
        let received = Received {
            payload,
            envelope,
            from: self.from.as_str().into(),
            address: self.address,
            connection: self.connection,
            wants_reply: false,
            responder: None,
            reservation: ValuesReservation::default(),
        };
        // Replies are impossible.
        let monitors = self.monitors.as_ref();
        self.reader.take(monitors, received, false).await;
    }
}
