//! The lifetime of one incoming connection.

mod accept_handshake;
mod datagram_input;
mod message_handling;
mod turn;

use std::io;
use std::net::{IpAddr, SocketAddrV4};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::{Bytes, BytesMut};
use tokio::net::TcpStream;
use yarp_wire::carrier::Sender;
use yarp_wire::connection::{Acceptor, Event, ProtocolError};

use self::datagram_input::Datagrams;
use self::message_handling::Step;
use self::turn::Turn;
use super::admin_commands::{Asking, Modification};
use super::connection_slots::ConnectionSlot;
use super::connections::Entry;
use super::counters::Meter;
use super::dedicated_thread::{ConnectionControl, ControlReceiver, DedicatedThread};
use super::idle_connections::{CloseSignal, ConnectionGuard};
use super::monitor::{Chain, MonitorError};
use super::output::{Output, OutputTransport};
use super::port_context::CLOSE_TIMEOUT;
use super::port_parts::Parts;
use super::socket_handle::SocketHandle;
use crate::addresses;
use crate::auth_step;
use crate::cancel::Cancelled;
use crate::error::error_chain;
use crate::latency::Tcp;
use crate::latency::{BusyPoll, Expecting, Optimisation};
use crate::log_text::printable;
use crate::port_limits::{INCOMING_BUDGET, Reservation, SMALL_MESSAGE, UNSENT_BUDGET};
use crate::roles::{Peer, Right, Rights};
use crate::socket::{self, ReadBuffer, Socket};
use crate::udp_socket;

/// Serves a connection until it closes, is superseded, times out, or the port closes.
///
/// Connections are numbered in the order in which they were accepted. Returns how it ended.
pub(super) async fn serve(parts: Arc<Parts>, stream: TcpStream, guest: Guest) -> WasValid {
    let Guest {
        address,
        number,
        guard,
        slot,
        control,
        control_receiver,
    } = guest;
    let begun = Instant::now();
    let (guard, mut close_signal) = guard.unzip();
    let mut closing = parts.context.cancelled.clone();
    let stream = Socket::Tcp(Tcp::new(stream));
    parts.context.network.roles().refresh_if_due(Instant::now());
    if let Some(key) = parts.context.network.key() {
        let mut ending = control_receiver.clone();
        let known = tokio::select! {
            known = auth_step::accept(&stream, key) => known,
            () = closing.cancelled() => return WasValid(true),
            () = ending.ended() => return WasValid(true),
        };
        if let Err(error) = known {
            if let Some(more) = parts.connections.bad_connections.pass(Instant::now()) {
                let text = error_chain(&error);
                tracing::warn!(port = %parts.context.name, %address, "Authentication of {address} failed: {text}{more}");
            }
            return WasValid(false);
        }
    }
    let mut ending = control_receiver.clone();
    let secured = tokio::select! {
        biased;
        secured = accept_handshake::secure(stream, &parts.context.network) => secured,
        () = closing.cancelled() => return WasValid(true),
        // The slot is given to another connection.
        () = ending.ended() => return WasValid(true),
    };
    let stream = match secured {
        Ok(Some(stream)) => stream,
        Ok(None) => return WasValid(begun.elapsed() >= MIN_CONNECTION_LIFETIME),
        Err(error) => {
            if let Some(more) = parts.connections.bad_connections.pass(Instant::now()) {
                let text = error_chain(&error);
                tracing::warn!(port = %parts.context.name, %address, "a connection of {address} is refused: {text}{more}");
            }
            return WasValid(false);
        }
    };
    let mut connection = Connection {
        acceptor: Acceptor::new(
            parts.context.number,
            parts.context.options.wire_version,
            parts.context.options.limits,
        )
        .with_gate(parts.context.network.gate().clone()),
        parts: parts.clone(),
        stream: Arc::new(stream),
        input: ReadBuffer::default(),
        output: BytesMut::new(),
        header_reply_len: 0,
        number,
        entry: None,
        control: Some(control),
        control_receiver,
        moved: false,
        datagrams: None,
        sender: Sender::plain(""),
        from: "".into(),
        address,
        busy: BusyPoll::new(parts.dispatcher.receive_queue.is_some()),
        meter: Arc::default(),
        monitors: None,
        closing: parts.context.cancelled.clone(),
        rights: (0, Rights::ALL),
        guard,
        slot,
        incoming: None,
        was_valid: false,
    };
    let end = connection.run_until_closed(&mut close_signal).await;
    let understood = WasValid(match end {
        // A page that is refused is no reason to let others wait.
        End::Broken(ProtocolError::Browser(_)) => true,
        End::Broken(_) | End::Failed(_) => false,
        // The next one of the same name may have superseded it before it was found to be invalid.
        End::Closed => {
            let made_room = connection.slot.has_ended();
            connection.was_valid || made_room || begun.elapsed() >= MIN_CONNECTION_LIFETIME
        }
        _ => true,
    });
    match end {
        End::Moved(thread) => Box::pin(connection.move_to(&thread, close_signal)).await,
        end => connection.end(end),
    }
    understood
}

/// A connection that was accepted.
pub(super) struct Guest {
    /// The address that it comes from.
    pub(super) address: IpAddr,
    /// Connections are numbered in the order in which they were accepted.
    pub(super) number: u64,
    /// Its place among the callers, if the port keeps a list of them.
    pub(super) guard: Option<(ConnectionGuard, CloseSignal)>,
    /// Its place among the connections of the process.
    pub(super) slot: ConnectionSlot,
    pub(super) control: ConnectionControl,
    pub(super) control_receiver: ControlReceiver,
}

/// `true` if a connection was valid: no protocol error, no failure, and not closed at once without
/// data.
pub(super) struct WasValid(pub(super) bool);

/// A connection that stays open for this long counts as valid.
const MIN_CONNECTION_LIFETIME: Duration = Duration::from_secs(1);

/// Time that the header reply waits for the reply to the first message, if both were received
/// together.
const FIRST_REPLY_DELAY: Duration = Duration::from_millis(1);

/// Bytes of answers above which they are sent before the next request is looked at.
const UNSENT: usize = 128 * 1024;
/// Time for which a peer may read nothing of a text that other connections hold, too.
const SHARED_TEXT_TIMEOUT: Duration = Duration::from_secs(5);

/// The reason for the end of a connection.
pub(super) enum End {
    Closed,
    Broken(ProtocolError),
    Failed(io::Error),
    /// Its modifiers cannot be applied.
    Refused(MonitorError),
    /// This build lacks the carrier.
    NoCarrier(&'static str),
    /// It came over HTTP, which the port does not take.
    NoBrowsers,
    /// It is not encrypted, and has to be; or what it asks for cannot be.
    NotEncrypted,
    /// It continues in the other direction.
    Reversed,
    /// The peer lacks a right.
    NotAllowed(Right),
    /// The process has no room for what it wants.
    Full(&'static str),
    /// No datagrams arrive any more, and the peer is gone.
    Gone(String),
    /// It continues on this thread.
    Moved(Arc<DedicatedThread>),
}

impl From<io::Error> for End {
    fn from(error: io::Error) -> Self {
        Self::Failed(error)
    }
}

pub(super) struct Connection {
    pub(super) parts: Arc<Parts>,
    stream: Arc<Socket>,
    acceptor: Acceptor,
    input: ReadBuffer,
    pub(super) output: BytesMut,
    /// Length of the header reply in the output, until it has been sent.
    header_reply_len: usize,
    /// Its number in the port's list.
    pub(super) number: u64,
    /// The place in the port's list, once the header is done with.
    entry: Option<Entry>,
    /// Goes to the port's list with the entry.
    control: Option<ConnectionControl>,
    control_receiver: ControlReceiver,
    /// It is on a thread of its own already.
    moved: bool,
    /// The receiver of its datagrams, on a datagram carrier.
    datagrams: Option<Box<Datagrams>>,
    pub(super) sender: Sender,
    /// The sender's name, as its messages carry it.
    pub(super) from: Arc<str>,
    pub(super) address: IpAddr,
    busy: BusyPoll,
    pub(super) meter: Arc<Meter>,
    /// The monitors of its messages, if any.
    monitors: Option<Arc<Chain>>,
    /// The port closes: nothing more is read.
    closing: Cancelled,
    /// The rights of the peer, with the revision of the roles that they come from.
    rights: (u64, Rights),
    /// Its place among the callers, if the port keeps a list of them.
    guard: Option<ConnectionGuard>,
    /// Its place among the connections of the process.
    slot: ConnectionSlot,
    /// Reservation in the budget of the process for incomplete messages.
    incoming: Option<Reservation>,
    /// Something that came made sense.
    was_valid: bool,
}

/// The next step after a message.
///
/// Not a [`Ready`](yarp_wire::Ready): it selects the transport of the next message.
pub(super) enum Next {
    Go,
    /// Messages come over a socket of the file system.
    UnixSocket,
    /// Messages come through shared memory.
    SharedMemory,
    /// Messages arrive as datagrams, to this group if there is one.
    Datagrams(Option<SocketAddrV4>),
    Stop(End),
}

impl Connection {
    /// Serves until the end, or until the connection must move.
    async fn run_until_closed(&mut self, close_signal: &mut Option<CloseSignal>) -> End {
        let (mut control_receiver, mut closing) =
            (self.control_receiver.clone(), self.closing.clone());
        // A message that is being answered when the port closes gets its answer, if it is not long.
        let out_of_patience = async {
            closing.cancelled().await;
            tokio::time::sleep(CLOSE_TIMEOUT).await;
        };
        tokio::select! {
            end = self.run() => end,
            () = control_receiver.ended() => End::Closed,
            // In any case the entry becomes free.
            _ = async { close_signal.as_mut().expect("it is there").await }, if close_signal.is_some() => {
                End::Closed
            }
            () = out_of_patience => End::Closed,
        }
    }

    /// Goes on on a thread of its own, until the end.
    async fn move_to(mut self, thread: &DedicatedThread, mut close_signal: Option<CloseSignal>) {
        self.moved = true;
        let begin = move || {
            let socket = self.renew();
            let running = async move {
                let end = self.run_until_closed(&mut close_signal).await;
                self.end(end);
            };
            (socket, running)
        };
        let _ = thread.run(begin).await;
    }

    /// Has its sockets waited for by the runtime that this is called in.
    fn renew(&mut self) -> SocketHandle {
        self.stream = self.stream.renewed();
        let socket = match &mut self.datagrams {
            None => SocketHandle::of(&self.stream),
            Some(datagrams) => {
                datagrams.socket = udp_socket::renewed(&datagrams.socket);
                SocketHandle::of(&datagrams.socket)
            }
        };
        self.set_socket(socket.clone());
        socket
    }

    fn end(mut self, end: End) {
        self.entry = None;
        let (port, from) = (&self.parts.context.name, printable(&self.sender.name));
        let text = match end {
            // A connection moves only once.
            End::Closed | End::Moved(_) => return,
            End::Broken(error) => format!("dropping a connection: {error}"),
            End::Refused(error) => format!("refusing a connection: {error}"),
            End::NoCarrier(name) => {
                format!("refusing a connection: this program was built without the carrier {name}")
            }
            End::Full(what) => format!("refusing a connection: {what}"),
            End::NotAllowed(right) => format!("dropping a connection: {}", self.refusal(right)),
            End::Failed(error) => {
                tracing::debug!(%port, %from, "a connection failed: {error}");
                return;
            }
            End::NoBrowsers => {
                let address = self.address;
                format!("refusing a connection of {address} over HTTP: this port takes none")
            }
            End::NotEncrypted => {
                let address = self.address;
                format!(
                    "refusing a connection of {address}: it is not encrypted from end to end; see tls.conf"
                )
            }
            End::Reversed => return self.into_output(),
            End::Gone(reason) => {
                tracing::info!(%port, %from, "closing the connection of an unreachable datagram writer: {reason}");
                return;
            }
        };
        if let Some(more) = self.parts.connections.bad_connections.pass(Instant::now()) {
            tracing::warn!(%port, %from, "{text}{more}");
        }
    }

    /// Rare futures of large size are boxed, so that an idle connection is small.
    async fn run(&mut self) -> End {
        if self.datagrams.is_some() {
            return Box::pin(self.run_watched(None)).await;
        }
        let mut turn = Turn::begin(Instant::now());
        loop {
            loop {
                let unsent = self.output.len();
                let next = match self.acceptor.poll(&mut self.input.bytes, &mut self.output) {
                    // The commonest first: it makes no future.
                    Ok(Some(Event::Message(message)))
                        if !Optimisation::InlineHandling.is_enabled() =>
                    {
                        Box::pin(self.message(message)).await
                    }
                    Ok(Some(Event::Message(message))) => match self.handle_now(message) {
                        Step::Done(next) => next,
                        left => self.handle_rest(left).await,
                    },
                    Ok(Some(Event::Opened {
                        carrier,
                        sender,
                        group,
                    })) => {
                        let next = self.begin(carrier, sender, group);
                        if self.may_want_replies(&next, carrier) {
                            Box::pin(self.probe_caller_version()).await;
                        }
                        next
                    }
                    Ok(Some(Event::HttpRequest(request))) => {
                        self.was_valid = true;
                        self.record_activity();
                        Box::pin(self.browse(request)).await
                    }
                    Ok(None) => break,
                    Err(error) => {
                        self.refuse(&error).await;
                        return End::Broken(error);
                    }
                };
                match next {
                    Next::Go if self.is_turn_over(&mut turn, unsent) => {
                        if let Err(end) = self.end_turn().await {
                            return end;
                        }
                    }
                    Next::Go => {}
                    Next::UnixSocket => match Box::pin(self.switch_to_unix_socket()).await {
                        Ok(()) => {}
                        Err(error) => return error.into(),
                    },
                    Next::SharedMemory => match self.switch_to_shared_memory().await {
                        Ok(()) => {}
                        Err(error) => return error.into(),
                    },
                    Next::Datagrams(group) => return Box::pin(self.run_watched(group)).await,
                    Next::Stop(end) => {
                        // The last words; the peer may be gone.
                        let _ = self.write_output().await;
                        return end;
                    }
                }
            }
            let expecting = match self.output.is_empty() {
                true => Expecting::Anything,
                false => Expecting::Answer,
            };
            if let Err(end) = self.write_output().await {
                return end;
            }
            self.header_reply_len = 0;
            let missing = self.acceptor.missing(&self.input.bytes);
            let held = self.input.bytes.len();
            if (held > SMALL_MESSAGE || self.incoming.is_some()) && !self.holds(held, missing) {
                return End::Full("too many large messages come to this process at a time");
            }
            self.busy.misses(missing);
            if missing == 0
                && let Some(read) = self
                    .busy
                    .read(&self.stream, &mut self.input, expecting)
                    .await
            {
                match read {
                    Ok(0) => return End::Closed,
                    Ok(_) => continue,
                    Err(error) => return error.into(),
                }
            }
            let read = tokio::select! {
                biased;
                () = self.closing.cancelled() => return End::Closed,
                read = self.input.read(&self.stream, missing) => read,
                thread = self.control_receiver.thread(), if !self.moved => return End::Moved(thread),
            };
            match read {
                Ok(0) => return End::Closed,
                Ok(_) => self.busy.received(),
                Err(error) => return error.into(),
            }
        }
    }

    /// Counts a handled message; returns whether its answers must be sent, or other tasks must run, before the next one.
    fn is_turn_over(&self, turn: &mut Turn, unsent: usize) -> bool {
        // A peer that requests much and reads nothing gets no further answers.
        if self.output.len() > UNSENT {
            return true;
        }
        let answer = (!self.output.is_empty()).then(|| self.output.len().saturating_sub(unsent));
        turn.is_over(answer, Instant::now)
    }

    /// Sends the answers if there are many, otherwise lets other tasks run.
    async fn end_turn(&mut self) -> Result<(), End> {
        if self.output.len() > UNSENT {
            return self.write_output().await;
        }
        tokio::task::yield_now().await;
        Ok(())
    }

    /// Sends the output. Much that the peer does not read counts against a budget of the process.
    async fn write_output(&mut self) -> Result<(), End> {
        if self.output.len() > UNSENT {
            return Box::pin(self.write_large_output()).await;
        }
        Ok(socket::write_all(&self.stream, &mut self.output).await?)
    }

    async fn write_large_output(&mut self) -> Result<(), End> {
        socket::write_part(&self.stream, &mut self.output)?;
        let unsent = self.output.len();
        let _reservation = match unsent > UNSENT {
            true => {
                let reservation = UNSENT_BUDGET.reserve_or_alone(unsent);
                let full = "peers leave too many replies of this process unread";
                Some(reservation.ok_or(End::Full(full))?)
            }
            false => None,
        };
        socket::write_all(&self.stream, &mut self.output).await?;
        // The memory of a large reply does not stay with the connection.
        self.output = BytesMut::new();
        Ok(())
    }

    /// Sends the output and then a text that other connections hold, too.
    async fn write_shared(&mut self, mut text: Bytes) -> Result<(), End> {
        self.write_output().await?;
        loop {
            socket::write_in_shares(&self.stream, &mut text).await?;
            if text.is_empty() {
                return Ok(());
            }
            let room = tokio::time::timeout(SHARED_TEXT_TIMEOUT, self.stream.writable()).await;
            let unread = "it reads nothing of a large reply that others wait for";
            room.map_err(|_| End::Full(unread))??;
        }
    }

    /// Takes note of how much of a message has arrived; tells whether the process has room for it.
    fn holds(&mut self, held: usize, missing: usize) -> bool {
        if held <= SMALL_MESSAGE {
            self.incoming = None;
            return true;
        }
        // As much again is offered to the next read, if it is missing.
        let wanted = held.saturating_add(missing.min(held));
        match &mut self.incoming {
            Some(reservation) => reservation.grow_to(wanted),
            incoming => {
                *incoming = INCOMING_BUDGET.reserve(wanted);
                incoming.is_some()
            }
        }
    }

    /// Records the new socket of the connection.
    fn set_socket(&self, socket: SocketHandle) {
        if let Some(entry) = &self.entry {
            self.parts.connections.move_input(entry.id, socket);
        }
    }

    /// Returns whether the roles in force now give the peer this right.
    #[inline]
    pub(super) fn may(&mut self, right: Right) -> bool {
        let roles = self.parts.context.network.roles();
        let generation = roles.generation();
        if self.rights.0 != generation {
            let mut rights = self.parts.context.rights(self.peer());
            if self.parts.context.options.allows_any_writer {
                rights = rights.and(Right::Write.into());
            }
            self.rights = (generation, rights);
        }
        self.rights.1.has(right)
    }

    fn peer(&self) -> Peer<'_> {
        Peer {
            name: &self.sender.name,
            address: self.address,
        }
    }

    /// Returns the reason why the peer may not modify the port or a connection; none if it may.
    pub(super) fn why_not_modify(&self, modification: Modification) -> Option<String> {
        let port = &self.parts.context;
        let asking = Asking {
            is_page: self.comes_from_page(),
            is_local: addresses::is_local(self.address),
            is_named: port.network.roles().name(&port.name),
        };
        asking.why_not(&port.name, modification, port.options.modifiable)
    }

    /// Returns whether it speaks as browsers do.
    fn comes_from_page(&self) -> bool {
        let carrier = self.acceptor.carrier();
        carrier.is_some_and(|carrier| carrier.protocol.service().is_some())
    }

    /// Returns the refusal for a peer without this right.
    pub(super) fn refusal(&self, right: Right) -> String {
        self.parts.context.refusal(self.peer(), right)
    }

    /// Waits for a future that may take long. The output so far is sent first: a peer that
    /// pipelines requests must not wait for one answer because the next is not ready.
    pub(super) async fn wait_for<T>(&mut self, waiting: impl Future<Output = T>) -> T {
        tokio::pin!(waiting);
        tokio::select! {
            biased;
            done = &mut waiting => return done,
            () = std::future::ready(()) => {}
        }
        if let Some(guard) = &mut self.guard {
            guard.set_busy(Instant::now());
        }
        self.slot.waits();
        let done = tokio::select! {
            biased;
            done = &mut waiting => done,
            () = self.send_output() => waiting.await,
        };
        self.record_activity();
        done
    }

    /// Sends the output so far; only a header reply waits briefly for the reply to a message that
    /// was received with it: the peer polls for the latter only.
    async fn send_output(&mut self) {
        if self.header_reply_len > 0
            && self.output.len() == self.header_reply_len
            && Optimisation::FirstReply.is_enabled()
        {
            tokio::time::sleep(FIRST_REPLY_DELAY).await;
        }
        // A peer that is gone is noticed when it is read from.
        let _ = self.write_output().await;
    }

    /// Records that the peer is active.
    fn record_activity(&mut self) {
        if let Some(guard) = &mut self.guard {
            guard.set_active(Instant::now());
        }
        self.slot.spoke();
    }

    /// Goes on as a connection that the port writes to.
    fn into_output(self) {
        let most = self
            .parts
            .context
            .options
            .connection_limits
            .and_then(|limits| limits.max_connections);
        if most.is_some_and(|most| self.parts.connections.outputs().len() >= most) {
            let from = printable(&self.sender.name);
            tracing::warn!(port = %self.parts.context.name, %from, "too many readers: refusing a connection");
            return;
        }
        let Some(initiator) = self.acceptor.into_initiator() else {
            return;
        };
        let output = Output::start(
            &self.sender.name,
            initiator.carrier().name.to_owned(),
            // Perhaps it is on a thread that ends with it.
            OutputTransport::Stream(
                match self.moved {
                    true => self.stream.renewed(),
                    false => self.stream,
                },
                self.input,
            ),
            initiator,
            self.parts.context.cancelled.clone(),
            Some(self.slot),
        );
        if let Some(bytes) = self.parts.context.options.max_unsent
            && let Err(error) = output.socket().set_max_unsent(bytes)
        {
            tracing::debug!(port = %self.parts.context.name, bytes, "unsent bytes are not limited: {error}");
        }
        self.parts.connections.add_output(output);
    }
}
