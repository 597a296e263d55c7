//! One outgoing connection.

mod datagrams;
mod stream;

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
use yarp_wire::{Dialect, Limits};

use super::encoded::Form;
use super::group::Group;
use super::monitor::{self, Chain, MonitorSide};
use super::outbox::Outbox;
use super::qos::SocketHandle;
use crate::cancel::Cancelled;
use crate::datagram;
use crate::dialogue::Dialogue;
use crate::error::PortError;
use crate::network::{Network, Place};
use crate::remote;
use crate::stream::{Inflow, Socket, connect, within, write_all};
use crate::transport::{go_on, next_port, refusal, refuses};

/// How long a reader has to end a connection that it does not take, before it is asked.
const BEFORE_ASKING: Duration = Duration::from_millis(50);

/// A connection that the port writes to.
#[derive(Debug)]
pub(crate) struct Output {
    /// The name of the reader.
    pub(crate) to: String,
    /// Carrier string as the connection was asked for.
    pub(crate) carrier_text: String,
    pub(crate) carrier: &'static Carrier,
    /// The generation of the reader.
    pub(crate) dialect: Dialect,
    pub(crate) outbox: Arc<Outbox>,
    /// Whether it carries copies of what the port receives instead of what its owner writes.
    pub(crate) logs: bool,
    /// The group that it shares with others: one of them transmits for all.
    pub(crate) group: Option<Group>,
    /// Whom to tell of the end, where the connection itself cannot.
    farewell: Option<Farewell>,
    /// What it sends on, as long as it has no thread of its own.
    socket: SocketHandle,
    /// Whether the owner has been told that it began.
    pub(crate) reported: AtomicBool,
    /// What messages pass on their way, if anything.
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
    pub(crate) to: &'a Place,
    /// The carrier string, and the carrier that it names.
    pub(crate) spec: &'a CarrierSpec,
    pub(crate) carrier: &'static Carrier,
    /// The generation of the reader.
    pub(crate) dialect: Dialect,
    /// The group, on a carrier of groups.
    pub(crate) group: Option<&'a Group>,
    /// Whose key is shown, and whose deadline holds.
    pub(crate) network: &'a Network,
}

/// What messages go out on.
pub(crate) enum Way {
    Stream(Arc<Socket>, Inflow),
    Datagrams(Arc<UdpSocket>),
}

/// The end of a connection that cannot carry it itself.
#[derive(Debug)]
struct Farewell {
    from: String,
    to: Place,
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
            let way = match target.group {
                Some(group) => {
                    if asks_reader(target) {
                        confirm_elsewhere(target, &stream, &mut input).await?;
                    }
                    let socket = datagram::group_sender(group.address, group.local).await;
                    Way::Datagrams(Arc::new(socket.map_err(|error| target.lost(error))?))
                }
                None if target.carrier.transport == Transport::Datagrams => {
                    let number = next_port(&initiator).map_err(|error| target.lost(error))?;
                    let socket = datagram::sender(&target.to.host, number).await;
                    Way::Datagrams(Arc::new(socket.map_err(|error| target.lost(error))?))
                }
                None => {
                    let moved = go_on(stream, input, &initiator).await;
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
                    Way::Stream(Arc::new(stream), input)
                }
            };
            Ok((way, initiator))
        };
        let deadline = target.network.deadline();
        let (way, initiator) = within(deadline, name, "connection header", opening).await?;
        let mut output = Self::start(name, target.spec.to_string(), way, initiator, cancelled);
        output.group = target.group.cloned();
        output.farewell = target.carrier.connectionless.then(|| Farewell {
            from: target.from.to_owned(),
            to: target.to.clone(),
            network: target.network.clone(),
        });
        Ok(output)
    }

    /// Takes over a connection whose header is done with.
    pub(crate) fn start(
        to: &str,
        carrier_text: String,
        way: Way,
        initiator: Initiator,
        cancelled: Cancelled,
    ) -> Self {
        let carrier = initiator.carrier();
        let dialect = initiator.dialect();
        let outbox = Arc::new(Outbox::new(Some(initiator)));
        let peer = to.to_owned();
        let shared = outbox.clone();
        let socket = match &way {
            Way::Stream(stream, _) => SocketHandle::of(stream),
            Way::Datagrams(socket) => SocketHandle::of(socket),
        };
        let task = tokio::spawn(async move {
            let reason = send(way, &shared, cancelled).await;
            tracing::debug!(peer, reason, "output connection ended");
            shared.close(&reason);
        });
        Self::over(to, carrier_text, carrier, dialect, outbox, socket, task)
    }

    /// A connection that `task` sends the messages of.
    pub(crate) fn over(
        to: &str,
        carrier_text: String,
        carrier: &'static Carrier,
        dialect: Dialect,
        outbox: Arc<Outbox>,
        socket: SocketHandle,
        task: JoinHandle<()>,
    ) -> Self {
        Self {
            to: to.to_owned(),
            carrier_text,
            carrier,
            dialect,
            outbox,
            logs: false,
            group: None,
            farewell: None,
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
            self.outbox.set_monitored();
            let outbox = self.outbox.clone();
            let stage = monitor::stage(chain.clone(), outbox, self.carrier, self.dialect);
            self.stage = Some(tokio::spawn(stage));
            self.monitors = Some(chain);
        }
        self
    }

    /// Says goodbye and ends the connection; waits for the reader at most until `deadline`.
    pub(crate) async fn close(&self, deadline: Duration) {
        let goodbye = async {
            match &self.farewell {
                Some(farewell) => farewell.say(deadline).await,
                None => {
                    let nothing = Form {
                        pieces: Pieces::new(),
                        dialect: self.dialect,
                    };
                    if let Ok(ticket) = self.outbox.push(&Command::Quit, &nothing) {
                        let _ = self.outbox.done(ticket).await;
                    }
                    let _ = self.outbox.drained().await;
                    self.await_answer().await;
                }
            }
        };
        // A reader that does not answer in time is left.
        let _ = tokio::time::timeout(deadline, goodbye).await;
        self.end();
    }

    /// Waits for the goodbye of a reader that answers ours: one that comes when the connection is gone
    /// would reset it, and with it what the reader has not read yet.
    async fn await_answer(&self) {
        if self.carrier.protocol.answers_goodbye() {
            self.socket().finish();
            let _ = self.outbox.ended().await;
        }
    }

    /// Whether it is one of those that share this group.
    pub(super) fn is_of(&self, group: &Group) -> bool {
        self.group.as_ref() == Some(group)
    }

    /// What it sends on.
    pub(crate) fn socket(&self) -> SocketHandle {
        let thread = self.outbox.thread();
        let moved = thread.as_ref().and_then(|thread| thread.socket());
        moved.unwrap_or(&self.socket).clone()
    }

    fn end(&self) {
        self.outbox.close("closed here");
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
        }
    }

    fn lost(&self, error: io::Error) -> PortError {
        let address = format!("{}:{}", self.to.host, self.to.port);
        PortError::connect(&self.to.name, address, "connection header", error)
    }
}

/// Why nothing is sent any more.
pub(crate) enum Pause {
    End(String),
    /// The connection goes on on a thread of its own.
    Move,
}

/// Sends what is in the outbox until the connection ends; tells why it did.
async fn send(way: Way, outbox: &Arc<Outbox>, mut cancelled: Cancelled) -> String {
    let own = || outbox.thread().expect("who is to move was given a thread");
    let shared = outbox.clone();
    let moved = match way {
        Way::Stream(stream, input) => {
            outbox.lend(Some(stream.clone()));
            let mut sending = stream::Sending::new(stream, input);
            if let Pause::End(reason) = stream::run(&mut sending, outbox, &mut cancelled).await {
                return reason;
            }
            // From now on all is sent with the policy of the thread.
            outbox.lend(None);
            let mut sending = Box::new(sending);
            let begin = move || {
                sending.stream = sending.stream.renewed();
                let socket = SocketHandle::of(&sending.stream);
                let running =
                    async move { stream::run(&mut sending, &shared, &mut cancelled).await };
                (socket, running)
            };
            Box::pin(own().run(begin)).await
        }
        Way::Datagrams(socket) => {
            if let Pause::End(reason) = datagrams::run(&socket, outbox, &mut cancelled).await {
                return reason;
            }
            let begin = move || {
                let socket = datagram::renewed(&socket);
                let handle = SocketHandle::of(&socket);
                let running = async move { datagrams::run(&socket, &shared, &mut cancelled).await };
                (handle, running)
            };
            Box::pin(own().run(begin)).await
        }
    };
    match moved {
        Some(Pause::End(reason)) => reason,
        _ => "its thread ended".to_owned(),
    }
}

/// Connects and goes through the header.
async fn open(target: &Target<'_>) -> Result<(Socket, Initiator, Inflow), PortError> {
    let Place {
        name, host, port, ..
    } = target.to;
    let stream = connect(name, host, *port, target.network).await?;
    let mut output = BytesMut::new();
    let sender = Sender {
        name: target.from.to_owned(),
        modifiers: target.spec.modifiers.clone(),
    };
    let (carrier, dialect) = (target.carrier, target.dialect);
    let mut initiator = Initiator::new(carrier, &sender, dialect, Limits::DEFAULT, &mut output);
    if let Some(group) = target.group {
        put_group(group.address, &mut output);
    }
    let lost = |error| target.lost(error);
    write_all(&stream, &mut output).await.map_err(lost)?;
    let mut input = Inflow::default();
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
            let text = format!("it closed the connection; it may not take {carrier}");
            return Err(match asks_reader(target) {
                true => target.declined(),
                false => lost(io::Error::new(io::ErrorKind::UnexpectedEof, text)),
            });
        }
    }
    Ok((stream, initiator, input))
}

/// Whether the reader is to have a modifier.
fn asks_reader(target: &Target<'_>) -> bool {
    let options = target.spec.options();
    options.find_group(MonitorSide::Receive.key()).is_some()
}

/// Asks the reader for its version over the new connection. Stock answers the header first and
/// then ends the connection if it lacks the modifier: an answer shows that it has it.
async fn confirm(
    target: &Target<'_>,
    stream: &Socket,
    initiator: &mut Initiator,
    input: &mut Inflow,
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
            // Who reads lines may have written them to a person who is refused.
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

/// Asks the reader over a connection of its own whether it has this one, over which nothing can
/// be answered. Stock lists one for a moment before it sees that it cannot have it: so twice.
async fn confirm_elsewhere(
    target: &Target<'_>,
    stream: &Socket,
    input: &mut Inflow,
) -> Result<(), PortError> {
    let own = admin::list(Direction::In, Some(target.from));
    let mut listed = false;
    loop {
        let reading = tokio::time::timeout(BEFORE_ASKING, input.read(stream, 0)).await;
        let ended = matches!(reading, Ok(Ok(0) | Err(_)));
        if ended {
            tokio::time::sleep(BEFORE_ASKING).await;
        }
        input.bytes.clear();
        let answer = remote::administer(target.network, target.to, &own).await?;
        let now = answer.find("from").is_some();
        match (listed, now) {
            (true, true) => return Ok(()),
            (true, false) => return Err(target.declined()),
            (false, false) if ended => return Err(target.declined()),
            _ => listed = now,
        }
    }
}

impl Farewell {
    /// Tells the reader to forget the connection: `~/WRITER`, as stock does.
    async fn say(&self, deadline: Duration) {
        let carrier = Carrier::by_name("text_ack").expect("text_ack is in the table");
        let address = (self.to.host.as_str(), self.to.port);
        let network = self.network.with_deadline(deadline);
        let dialogue = Dialogue::open(&self.to.name, address, carrier, "admin", &network).await;
        // A reader that is gone has forgotten already.
        if let Ok(mut dialogue) = dialogue {
            let _ = dialogue
                .command(&Command::RemoveInput(self.from.clone()))
                .await;
        }
    }
}
