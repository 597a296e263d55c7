//! One outgoing connection.

mod datagram_output;
mod refusal_reason;
mod stream_output;

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use bytes::BytesMut;
use tokio::net::UdpSocket;
use tokio::task::JoinHandle;
use yarp_wire::admin::{self, Direction};
use yarp_wire::carrier::put_group;
use yarp_wire::carrier::{Carrier, CarrierSpec, Sender, Transport};
use yarp_wire::connection::{Initiator, Progress};
use yarp_wire::message::{Command, Pieces};
use yarp_wire::{Limits, WireVersion};

use super::connection_slots;
use super::monitor::{self, Chain, MonitorSide};
use super::multicast_group::Group;
use super::send_queue::SendQueue;
use super::socket_handle::SocketHandle;
use crate::admin_client::AdminClient;
use crate::cancel::Cancelled;
use crate::connect::connect_over;
use crate::error::PortError;
use crate::latency::Form;
use crate::log_text::printable;
use crate::network::{Endpoint, Network};
use crate::remote_admin;
use crate::socket::{ReadBuffer, Socket, within, write_all};
use crate::transport_switch::{next_port, refusal, refuses, switch_transport};
use crate::udp_socket;

/// Time for a reader to close a refused connection, before it is asked.
const REFUSAL_TIMEOUT: Duration = Duration::from_millis(50);

/// A connection that the port writes to.
#[derive(Debug)]
pub(crate) struct Output {
    /// The name of the reader.
    pub(crate) to: String,
    /// Carrier string as the connection was asked for.
    pub(crate) carrier_text: String,
    pub(crate) carrier: &'static Carrier,
    /// The wire version of the reader.
    pub(crate) wire_version: WireVersion,
    pub(crate) send_queue: Arc<SendQueue>,
    /// `true` if it carries copies of received messages instead of the owner's messages.
    pub(crate) logs: bool,
    /// The group that it shares with others: one of them transmits for all.
    pub(crate) group: Option<Group>,
    /// Notifies the reader of the end, if the connection itself cannot.
    remove_input_request: Option<RemoveInputRequest>,
    /// The socket that it sends on, until it moves to a dedicated thread.
    socket: SocketHandle,
    /// `true` if the owner has been notified of its beginning.
    pub(crate) reported: AtomicBool,
    /// The monitors of its messages, if any.
    pub(super) monitors: Option<Arc<Chain>>,
    task: JoinHandle<()>,
    /// Passes messages through the monitors.
    stage: Option<JoinHandle<()>>,
}

/// A connection to be made.
#[derive(Debug)]
pub(crate) struct Target<'a> {
    /// The writer.
    pub(crate) from: &'a str,
    /// The reader, and where it is.
    pub(crate) to: &'a Endpoint,
    /// The carrier string, and the carrier that it names.
    pub(crate) spec: &'a CarrierSpec,
    pub(crate) carrier: &'static Carrier,
    /// The wire version of the reader.
    pub(crate) wire_version: WireVersion,
    /// The group, on a carrier of groups.
    pub(crate) group: Option<&'a Group>,
    /// Whose key is shown, and whose deadline holds.
    pub(crate) network: &'a Network,
}

/// The transport of outgoing messages.
pub(crate) enum OutputTransport {
    Stream(Arc<Socket>, ReadBuffer),
    Datagrams(Arc<UdpSocket>),
}

/// The end of a connection that cannot carry it itself.
#[derive(Debug)]
struct RemoveInputRequest {
    from: String,
    to: Endpoint,
    network: Network,
}

impl Output {
    /// Connects to a reader and waits until it has answered the header.
    pub(crate) async fn connect(
        target: &Target<'_>,
        cancelled: Cancelled,
    ) -> Result<Self, PortError> {
        let name = &target.to.name;
        let opening = async {
            let (stream, mut initiator, mut input) = open(target).await?;
            let transport = match target.group {
                Some(group) => {
                    if asks_reader(target) {
                        confirm_elsewhere(target, &stream, &mut input).await?;
                    }
                    let socket = udp_socket::group_sender(group.address, group.local).await;
                    OutputTransport::Datagrams(Arc::new(
                        socket.map_err(|error| target.lost(error))?,
                    ))
                }
                None if target.carrier.transport == Transport::Datagrams => {
                    let number = next_port(&initiator).map_err(|error| target.lost(error))?;
                    let socket = udp_socket::sender(&target.to.host, number).await;
                    OutputTransport::Datagrams(Arc::new(
                        socket.map_err(|error| target.lost(error))?,
                    ))
                }
                None => {
                    let moved = switch_transport(stream, input, &initiator).await;
                    let (stream, mut input) = moved.map_err(|error| {
                        let missing = error.kind() == io::ErrorKind::NotFound;
                        match missing && asks_reader(target) {
                            true => target.declined(),
                            false => target.lost(error),
                        }
                    })?;
                    if asks_reader(target) {
                        confirm(target, &stream, &mut initiator, &mut input).await?;
                    }
                    OutputTransport::Stream(Arc::new(stream), input)
                }
            };
            Ok((transport, initiator))
        };
        let deadline = target.network.timeout();
        let opened = within(deadline, name, "connection header", opening).await;
        let (transport, initiator) = match opened {
            Err(PortError::Declined { peer, carrier, .. }) => {
                return Err(PortError::Declined {
                    reason: refusal_reason::refusal_reason(target).await,
                    peer,
                    carrier,
                });
            }
            opened => opened?,
        };
        let carrier = target.spec.to_string();
        let mut output = Self::start(name, carrier, transport, initiator, cancelled, None);
        output.group = target.group.cloned();
        output.remove_input_request = target.carrier.connectionless.then(|| RemoveInputRequest {
            from: target.from.to_owned(),
            to: target.to.clone(),
            network: target.network.clone(),
        });
        Ok(output)
    }

    /// Takes over a connection whose header is done with; one that came to the port keeps its place.
    pub(crate) fn start(
        to: &str,
        carrier_text: String,
        transport: OutputTransport,
        initiator: Initiator,
        cancelled: Cancelled,
        slot: Option<connection_slots::ConnectionSlot>,
    ) -> Self {
        let carrier = initiator.carrier();
        let wire_version = initiator.wire_version();
        let send_queue = Arc::new(SendQueue::new(Some(initiator)));
        let peer = to.to_owned();
        let shared = send_queue.clone();
        let slot = slot.map(|mut slot| {
            slot.reads(&send_queue, to);
            slot
        });
        let socket = match &transport {
            OutputTransport::Stream(stream, _) => SocketHandle::of(stream),
            OutputTransport::Datagrams(socket) => SocketHandle::of(socket),
        };
        let task = tokio::spawn(async move {
            let reason = send(transport, &shared, cancelled).await;
            drop(slot);
            tracing::debug!(peer = %printable(&peer), reason, "output connection ended");
            shared.close(&reason);
        });
        Self::over(
            to,
            carrier_text,
            carrier,
            wire_version,
            send_queue,
            socket,
            task,
        )
    }

    /// Creates a connection that `task` sends the messages of.
    pub(crate) fn over(
        to: &str,
        carrier_text: String,
        carrier: &'static Carrier,
        wire_version: WireVersion,
        send_queue: Arc<SendQueue>,
        socket: SocketHandle,
        task: JoinHandle<()>,
    ) -> Self {
        Self {
            to: to.to_owned(),
            carrier_text,
            carrier,
            wire_version,
            send_queue,
            logs: false,
            group: None,
            remove_input_request: None,
            socket,
            reported: AtomicBool::new(false),
            monitors: None,
            task,
            stage: None,
        }
    }

    /// Has messages pass these monitors; before the first message.
    pub(super) fn with_monitors(mut self, monitors: Option<Arc<Chain>>) -> Self {
        if let Some(chain) = monitors {
            self.send_queue.set_monitored();
            let send_queue = self.send_queue.clone();
            let stage = monitor::stage(chain.clone(), send_queue, self.carrier, self.wire_version);
            self.stage = Some(tokio::spawn(stage));
            self.monitors = Some(chain);
        }
        self
    }

    /// Sends the close message and closes the connection; waits for the reader at most until
    /// `deadline`.
    pub(crate) async fn close(&self, deadline: Duration) {
        let goodbye = async {
            match &self.remove_input_request {
                Some(remove_input_request) => remove_input_request.say(deadline).await,
                None => {
                    let nothing = Form {
                        pieces: Pieces::new(),
                        wire_version: self.wire_version,
                    };
                    if let Ok(ticket) = self.send_queue.push(&Command::Quit, &nothing) {
                        let _ = self.send_queue.done(ticket).await;
                    }
                    let _ = self.send_queue.drained().await;
                    self.await_answer().await;
                }
            }
        };
        // A reader that does not answer in time is left.
        let _ = tokio::time::timeout(deadline, goodbye).await;
        self.end();
    }

    /// Waits for the close message of a reader that answers with one: if it arrived after the
    /// connection is closed, it would cause a reset and discard unread bytes.
    async fn await_answer(&self) {
        if self.carrier.protocol.replies_to_close() {
            self.socket().finish();
            let _ = self.send_queue.ended().await;
        }
    }

    /// Returns whether it is one of those that share this group.
    pub(super) fn is_of(&self, group: &Group) -> bool {
        self.group.as_ref() == Some(group)
    }

    /// Returns the socket that it sends on.
    pub(crate) fn socket(&self) -> SocketHandle {
        let thread = self.send_queue.thread();
        let moved = thread.as_ref().and_then(|thread| thread.socket());
        moved.unwrap_or(&self.socket).clone()
    }

    fn end(&self) {
        self.send_queue.close("closed here");
        self.task.abort();
        if let Some(stage) = &self.stage {
            stage.abort();
        }
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        self.end();
    }
}

impl Target<'_> {
    fn declined(&self) -> PortError {
        PortError::Declined {
            peer: self.to.name.clone(),
            carrier: self.spec.to_string(),
            reason: None,
        }
    }

    fn lost(&self, error: io::Error) -> PortError {
        let address = format!("{}:{}", self.to.host, self.to.port);
        PortError::connect(&self.to.name, address, "connection header", error)
    }
}

/// The reason why sending stops.
pub(crate) enum StopReason {
    End(String),
    /// The connection continues on a dedicated thread.
    Move,
}

/// Sends the queued messages until the connection closes; returns the reason.
async fn send(
    transport: OutputTransport,
    send_queue: &Arc<SendQueue>,
    mut cancelled: Cancelled,
) -> String {
    let own = || {
        send_queue
            .thread()
            .expect("who is to move was given a thread")
    };
    let shared = send_queue.clone();
    let moved = match transport {
        OutputTransport::Stream(stream, input) => {
            send_queue.lend(Some(stream.clone()));
            let mut sending = stream_output::Sending::new(stream, input);
            if let StopReason::End(reason) =
                stream_output::run(&mut sending, send_queue, &mut cancelled).await
            {
                return reason;
            }
            // From now on all is sent with the policy of the thread.
            send_queue.lend(None);
            let mut sending = Box::new(sending);
            let begin = move || {
                sending.stream = sending.stream.renewed();
                let socket = SocketHandle::of(&sending.stream);
                let running =
                    async move { stream_output::run(&mut sending, &shared, &mut cancelled).await };
                (socket, running)
            };
            Box::pin(own().run(begin)).await
        }
        OutputTransport::Datagrams(socket) => {
            if let StopReason::End(reason) =
                datagram_output::run(&socket, send_queue, &mut cancelled).await
            {
                return reason;
            }
            let begin = move || {
                let socket = udp_socket::renewed(&socket);
                let handle = SocketHandle::of(&socket);
                let running =
                    async move { datagram_output::run(&socket, &shared, &mut cancelled).await };
                (handle, running)
            };
            Box::pin(own().run(begin)).await
        }
    };
    match moved {
        Some(StopReason::End(reason)) => reason,
        _ => "its thread ended".to_owned(),
    }
}

/// Connects and goes through the header.
async fn open(target: &Target<'_>) -> Result<(Socket, Initiator, ReadBuffer), PortError> {
    let Endpoint {
        name, host, port, ..
    } = target.to;
    let transport = target.carrier.transport;
    let stream = connect_over(name, host, *port, target.network, transport).await?;
    if stream.is_encrypted() && !transport.is_encryptable() {
        let text = format!(
            "{} is not encrypted, and tls.conf requires encryption between hosts; use tls or tcp",
            target.carrier
        );
        return Err(target.lost(io::Error::new(io::ErrorKind::Unsupported, text)));
    }
    let mut output = BytesMut::new();
    let sender = Sender {
        name: target.from.to_owned(),
        modifiers: target.spec.modifiers.clone(),
    };
    let (carrier, wire_version) = (target.carrier, target.wire_version);
    let mut initiator =
        Initiator::new(carrier, &sender, wire_version, Limits::DEFAULT, &mut output);
    if let Some(group) = target.group {
        put_group(group.address, &mut output);
    }
    let lost = |error| target.lost(error);
    write_all(&stream, &mut output).await.map_err(lost)?;
    let mut input = ReadBuffer::default();
    loop {
        if refuses(&input.bytes) {
            return Err(lost(refusal(&initiator)));
        }
        let progress = initiator.poll(&mut input.bytes);
        let progress = progress.map_err(|source| PortError::Protocol {
            peer: name.clone(),
            source,
        })?;
        if progress == Some(Progress::Ready) {
            break;
        }
        let read = match input.read(&stream, 0).await {
            Err(error) if error.kind() == io::ErrorKind::ConnectionReset => 0,
            read => read.map_err(lost)?,
        };
        if read == 0 {
            let text = format!("the peer closed the connection; it may not support {carrier}");
            return Err(match asks_reader(target) {
                true => target.declined(),
                false => lost(io::Error::new(io::ErrorKind::UnexpectedEof, text)),
            });
        }
    }
    Ok((stream, initiator, input))
}

/// Returns whether the reader is to have a modifier.
fn asks_reader(target: &Target<'_>) -> bool {
    let options = target.spec.options();
    options.find_group(MonitorSide::Receive.key()).is_some()
}

/// Asks the reader for its version over the new connection. Stock replies to the header first and
/// then closes the connection if it lacks the modifier: an answer shows that the reader has it.
async fn confirm(
    target: &Target<'_>,
    stream: &Socket,
    initiator: &mut Initiator,
    input: &mut ReadBuffer,
) -> Result<(), PortError> {
    let mut output = BytesMut::new();
    initiator.send_object(&Command::Admin, &admin::version(), &mut output);
    let sending = write_all(stream, &mut output);
    sending.await.map_err(|_| target.declined())?;
    while !initiator.is_idle() {
        let progress = initiator.poll(&mut input.bytes);
        let progress = progress.map_err(|source| PortError::Protocol {
            peer: target.to.name.clone(),
            source,
        })?;
        match progress {
            // A reader of text lines may have sent them to a refused terminal.
            Some(Progress::Reply(reply)) => match reply.to_bottle() {
                Ok(answer) if admin::is_version(&answer) => {}
                _ => return Err(target.declined()),
            },
            Some(_) => {}
            None if matches!(input.read(stream, 0).await, Ok(1..)) => {}
            None => return Err(target.declined()),
        }
    }
    Ok(())
}

/// Asks the reader over a separate connection whether it has this one, which cannot carry replies.
/// Stock lists a connection briefly before it refuses it: so the request is repeated.
async fn confirm_elsewhere(
    target: &Target<'_>,
    stream: &Socket,
    input: &mut ReadBuffer,
) -> Result<(), PortError> {
    let own = admin::list(Direction::In, Some(target.from));
    let mut listed = false;
    loop {
        let reading = tokio::time::timeout(REFUSAL_TIMEOUT, input.read(stream, 0)).await;
        let ended = matches!(reading, Ok(Ok(0) | Err(_)));
        if ended {
            tokio::time::sleep(REFUSAL_TIMEOUT).await;
        }
        input.bytes.clear();
        let answer = remote_admin::administer(target.network, target.to, &own).await?;
        let now = answer.find("from").is_some();
        match (listed, now) {
            (true, true) => return Ok(()),
            (true, false) => return Err(target.declined()),
            (false, false) if ended => return Err(target.declined()),
            _ => listed = now,
        }
    }
}

impl RemoveInputRequest {
    /// Asks the reader to drop the connection: `~/WRITER`, as stock does.
    async fn say(&self, deadline: Duration) {
        let carrier = Carrier::by_name("text_ack").expect("text_ack is in the table");
        let address = (self.to.host.as_str(), self.to.port);
        let network = self.network.with_timeout(deadline);
        let client = AdminClient::open(&self.to.name, address, carrier, "admin", &network).await;
        // A reader that is gone has forgotten already.
        if let Ok(mut client) = client {
            let _ = client
                .command(&Command::RemoveInput(self.from.clone()))
                .await;
        }
    }
}
