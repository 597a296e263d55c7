//! One incoming connection.

use std::io;
use std::net::{IpAddr, SocketAddrV4};
use std::pin::pin;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::BytesMut;
use tokio::net::{TcpStream, UdpSocket};
use tokio::sync::oneshot;
use yarp_wire::carrier::{Carrier, Sender, Transport};
use yarp_wire::connection::{Acceptor, DatagramReader, Event, Message, ProtocolError, REFUSAL};
use yarp_wire::message::{Command, Payload};
use yarp_wire::protocol::header_reply;
use yarp_wire::{Bottle, Limits};

use super::admin;
use super::callers::{Caller, Farewell};
use super::core::{Core, Entry, GOODBYE, InputEntry, is_port};
use super::counters::Meter;
use super::describe::{HELP, NOT_UNDERSTOOD};
use super::inbox::Inbox;
use super::log::{self, Copied};
use super::monitor::{Chain, MonitorError, MonitorSide};
use super::options::{Input, Serving};
use super::output::{Output, Way};
use super::own_thread::{OwnThread, Steered, Steering};
use super::qos::SocketHandle;
use super::received::{Answer, Received, Reply, Responder};
use super::silent;
use crate::auth;
use crate::busy::{BusyPoll, Expecting};
use crate::cancel::Cancelled;
use crate::datagram;
use crate::error::story;
use crate::probe;
use crate::roles::{self, Peer, Right, Rights};
use crate::stream::{self, Inflow, Socket};
use crate::tcp::Tcp;
use crate::{shmem, unix};

/// Serves a connection until it ends, is displaced, has been silent for too long, or the port closes.
///
/// Connections are numbered in the order in which they were accepted. Tells how it ended.
pub(super) async fn serve(
    core: Arc<Core>,
    stream: TcpStream,
    address: IpAddr,
    number: u64,
    caller: Option<(Caller, Farewell)>,
) -> Understood {
    let begun = Instant::now();
    let (caller, mut farewell) = caller.unzip();
    let mut closing = core.cancelled.clone();
    let stream = Socket::Tcp(Tcp::new(stream));
    core.network.roles().refresh_if_due(Instant::now());
    if let Some(key) = core.network.key() {
        let known = tokio::select! {
            known = auth::accept(&stream, key) => known,
            () = closing.cancelled() => return Understood(true),
        };
        if let Err(error) = known {
            let text = story(&error);
            tracing::warn!(port = %core.name, %address, "Authentication of {address} failed: {text}");
            return Understood(false);
        }
    }
    let (steering, steered) = Steering::new();
    let mut connection = Connection {
        acceptor: Acceptor::new(core.number, core.options.dialect, Limits::DEFAULT),
        core: core.clone(),
        stream: Arc::new(stream),
        input: Inflow::default(),
        output: BytesMut::new(),
        greeting: 0,
        number,
        entry: None,
        steering: Some(steering),
        steered,
        moved: false,
        datagrams: None,
        sender: Sender::plain(""),
        from: "".into(),
        address,
        busy: BusyPoll::new(core.inbox.is_some()),
        meter: Arc::default(),
        monitors: None,
        closing: core.cancelled.clone(),
        rights: (0, Rights::ALL),
        caller,
        is_understood: false,
    };
    let end = connection.attend(&mut farewell).await;
    let understood = Understood(match end {
        End::Broken(_) | End::Failed(_) => false,
        // The next one of the same name may have taken its place before it was found to be garbage.
        End::Closed => connection.is_understood || begun.elapsed() >= IN_PASSING,
        _ => true,
    });
    match end {
        End::Moved(thread) => Box::pin(connection.move_to(&thread, farewell)).await,
        end => connection.end(end),
    }
    understood
}

/// Whether a connection was of use: it was not garbage that came, it did not break, and it did not go again at once
/// without a word.
pub(super) struct Understood(pub(super) bool);

/// Whoever stays for so long means something by it.
const IN_PASSING: Duration = Duration::from_secs(1);

/// How long the answer to a header waits for that to the first message, if both have come.
const GREETING: Duration = Duration::from_millis(1);

/// How a connection ended.
pub(super) enum End {
    Closed,
    Broken(ProtocolError),
    Failed(io::Error),
    /// What it asks for cannot be had.
    Refused(MonitorError),
    /// It goes on in the other direction.
    Reversed,
    /// The peer may not do what it wants.
    NotAllowed(Right),
    /// Nothing came any more, and the peer is not there.
    Gone(String),
    /// It goes on on this thread.
    Moved(Arc<OwnThread>),
}

impl From<io::Error> for End {
    fn from(error: io::Error) -> Self {
        Self::Failed(error)
    }
}

pub(super) struct Connection {
    pub(super) core: Arc<Core>,
    stream: Arc<Socket>,
    acceptor: Acceptor,
    input: Inflow,
    pub(super) output: BytesMut,
    /// How much of the output answers the header, as long as it has not been sent.
    greeting: usize,
    /// Its number in the port's list.
    pub(super) number: u64,
    /// The place in the port's list, once the header is done with.
    entry: Option<Entry>,
    /// Goes to the port's list with the entry.
    steering: Option<Steering>,
    steered: Steered,
    /// It is on a thread of its own already.
    moved: bool,
    /// What its messages come on, if they come as datagrams.
    datagrams: Option<Box<Datagrams>>,
    pub(super) sender: Sender,
    /// The sender's name, as its messages carry it.
    pub(super) from: Arc<str>,
    pub(super) address: IpAddr,
    busy: BusyPoll,
    pub(super) meter: Arc<Meter>,
    /// What its messages pass, if anything.
    monitors: Option<Arc<Chain>>,
    /// The port closes: nothing more is read.
    closing: Cancelled,
    /// What the peer may do, by the roles of this generation.
    rights: (u64, Rights),
    /// Its place among the callers, if the port keeps a list of them.
    caller: Option<Caller>,
    /// Something that came made sense.
    is_understood: bool,
}

/// What is to happen after a message.
pub(super) enum Next {
    Go,
    /// Messages come over a socket of the file system.
    UnixSocket,
    /// Messages come through shared memory.
    SharedMemory,
    /// Messages come as datagrams, to this group if there is one.
    Datagrams(Option<SocketAddrV4>),
    Stop(End),
}

/// How far a message has come.
enum Step {
    Done(Next),
    /// It is on its way to the owner; tells whether the sender wants a reply.
    Handing(Handing, bool),
    /// It is not for the owner, or not from who may write.
    Command(Command, Payload),
}

/// Where datagrams arrive and become messages.
struct Datagrams {
    socket: Arc<UdpSocket>,
    reader: DatagramReader,
}

impl Connection {
    /// Serves until the end, or until the connection shall move.
    async fn attend(&mut self, farewell: &mut Option<Farewell>) -> End {
        let (mut steered, mut closing) = (self.steered.clone(), self.closing.clone());
        // A message that is being answered when the port closes gets its answer, if it is not long.
        let out_of_patience = async {
            closing.cancelled().await;
            tokio::time::sleep(GOODBYE).await;
        };
        tokio::select! {
            end = self.run() => end,
            () = steered.ended() => End::Closed,
            // Whatever comes of it: the place is given to somebody else.
            _ = async { farewell.as_mut().expect("it is there").await }, if farewell.is_some() => {
                End::Closed
            }
            () = out_of_patience => End::Closed,
        }
    }

    /// Goes on on a thread of its own, until the end.
    async fn move_to(mut self, thread: &OwnThread, mut farewell: Option<Farewell>) {
        self.moved = true;
        let begin = move || {
            let socket = self.renew();
            let running = async move {
                let end = self.attend(&mut farewell).await;
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
                datagrams.socket = datagram::renewed(&datagrams.socket);
                SocketHandle::of(&datagrams.socket)
            }
        };
        self.goes_on_over(socket.clone());
        socket
    }

    fn end(mut self, end: End) {
        self.entry = None;
        let (port, from) = (&self.core.name, &self.sender.name);
        match end {
            // Nobody moves twice.
            End::Closed | End::Moved(_) => {}
            End::Broken(error) => {
                tracing::warn!(%port, from, "dropping a connection: {error}");
            }
            End::Refused(error) => {
                tracing::warn!(%port, from, "refusing a connection: {error}");
            }
            End::Failed(error) => {
                tracing::debug!(%port, from, "a connection failed: {error}");
            }
            End::NotAllowed(right) => {
                let text = self.refusal(right);
                tracing::warn!(%port, from, "dropping a connection: {text}");
            }
            End::Reversed => self.into_output(),
            End::Gone(reason) => {
                tracing::info!(%port, from, "a silent writer is gone: {reason}");
            }
        }
    }

    /// What comes seldom and takes much room while it runs stands in boxes here, so that a
    /// connection at rest is small.
    async fn run(&mut self) -> End {
        if self.datagrams.is_some() {
            return Box::pin(self.run_watched(None)).await;
        }
        loop {
            loop {
                let next = match self.acceptor.poll(&mut self.input.bytes, &mut self.output) {
                    // The commonest first: it makes no future.
                    Ok(Some(Event::Message(message))) => match self.message_at_once(message) {
                        Step::Done(next) => next,
                        left => self.rest_of(left).await,
                    },
                    Ok(Some(Event::Opened {
                        carrier,
                        sender,
                        group,
                    })) => {
                        let next = self.begin(carrier, sender, group);
                        if self.may_want_replies(&next, carrier) {
                            Box::pin(self.ask_generation()).await;
                        }
                        next
                    }
                    Ok(Some(Event::Browser(request))) => {
                        self.is_understood = true;
                        Box::pin(self.browse(request)).await
                    }
                    Ok(None) => break,
                    Err(error) => {
                        self.refuse(&error).await;
                        return End::Broken(error);
                    }
                };
                match next {
                    Next::Go => {}
                    Next::UnixSocket => match Box::pin(self.go_unix()).await {
                        Ok(()) => {}
                        Err(error) => return error.into(),
                    },
                    Next::SharedMemory => match self.go_shared().await {
                        Ok(()) => {}
                        Err(error) => return error.into(),
                    },
                    Next::Datagrams(group) => return Box::pin(self.run_watched(group)).await,
                    Next::Stop(end) => {
                        // The last words; the peer may be gone.
                        let _ = stream::write_all(&self.stream, &mut self.output).await;
                        return end;
                    }
                }
            }
            let expecting = match self.output.is_empty() {
                true => Expecting::Anything,
                false => Expecting::Turn,
            };
            if let Err(error) = stream::write_all(&self.stream, &mut self.output).await {
                return error.into();
            }
            self.greeting = 0;
            let missing = self.acceptor.missing(&self.input.bytes);
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
                thread = self.steered.thread(), if !self.moved => return End::Moved(thread),
            };
            match read {
                Ok(0) => return End::Closed,
                Ok(_) => self.busy.received(),
                Err(error) => return error.into(),
            }
        }
    }

    /// Goes on over a socket of the file system.
    async fn go_unix(&mut self) -> io::Result<()> {
        if let Some(header) = self.stream.tcp() {
            let socket = unix::accept(header).await?;
            self.go_over(Socket::Unix(socket));
        }
        Ok(())
    }

    /// Goes on through shared memory.
    async fn go_shared(&mut self) -> io::Result<()> {
        if let Some(header) = self.stream.tcp() {
            let offer = shmem::Offer::new(header).await?;
            header_reply(offer.number(), &mut self.output);
            stream::write_all(&self.stream, &mut self.output).await?;
            let socket = offer.accept().await?;
            self.go_over(Socket::Shmem(Box::new(socket)));
        }
        Ok(())
    }

    fn go_over(&mut self, socket: Socket) {
        self.stream = Arc::new(socket);
        self.goes_on_over(SocketHandle::of(&self.stream));
        self.input = Inflow::default();
    }

    /// The connection goes on over another socket.
    fn goes_on_over(&self, socket: SocketHandle) {
        if let Some(entry) = &self.entry {
            self.core.move_input(entry.id, socket);
        }
    }

    /// Serves what comes as datagrams until the writer ends it, or is found to be gone.
    async fn run_watched(&mut self, group: Option<SocketAddrV4>) -> End {
        let (core, from, meter) = (self.core.clone(), self.from.clone(), self.meter.clone());
        tokio::select! {
            // What has arrived is served first.
            biased;
            end = self.run_datagrams(group) => end,
            reason = silent::gone(&core, &from, &meter) => End::Gone(reason),
        }
    }

    /// Serves what comes as datagrams: to the group, or to a socket that the peer is told of.
    /// The peer ends it by a message to the port, or by another connection of the same name.
    async fn run_datagrams(&mut self, group: Option<SocketAddrV4>) -> End {
        let mut datagrams = match self.datagrams.take() {
            Some(datagrams) => datagrams,
            None => match self.open_datagrams(group).await {
                Ok(datagrams) => datagrams,
                Err(error) => return error.into(),
            },
        };
        loop {
            let Datagrams { socket, reader } = &mut *datagrams;
            let ready = tokio::select! {
                biased;
                () = self.closing.cancelled() => return End::Closed,
                ready = socket.readable() => ready,
                thread = self.steered.thread(), if !self.moved => {
                    self.datagrams = Some(datagrams);
                    return End::Moved(thread);
                }
            };
            let dropped = reader.dropped();
            let received =
                ready.and_then(|()| datagram::receive(socket, |datagram| reader.receive(datagram)));
            let message = match received {
                Ok(message) => message.unwrap_or(Ok(None)),
                Err(error) => return error.into(),
            };
            for _ in dropped..reader.dropped() {
                self.meter.drop_one();
            }
            match message {
                Ok(None) => {}
                Ok(Some(message)) => {
                    if let Next::Stop(end) = self.message(message).await {
                        return end;
                    }
                    // Nothing can be said back.
                    self.output.clear();
                }
                Err(error) => {
                    let from = &self.sender.name;
                    tracing::debug!(port = %self.core.name, from, "a message is dropped: {error}");
                }
            }
        }
    }

    async fn open_datagrams(&mut self, group: Option<SocketAddrV4>) -> io::Result<Box<Datagrams>> {
        let local = self
            .stream
            .tcp()
            .and_then(|stream| stream.local_addr().ok());
        let socket = match (group, local.map(|address| address.ip())) {
            (Some(group), Some(IpAddr::V4(local))) => datagram::group_reader(group, local),
            _ => datagram::reader(),
        };
        let socket = Arc::new(socket?);
        self.goes_on_over(SocketHandle::of(&socket));
        if group.is_none() {
            let number = socket.local_addr().map_or(0, |address| address.port());
            header_reply(number, &mut self.output);
        }
        stream::write_all(&self.stream, &mut self.output).await?;
        let reader = DatagramReader::new(self.acceptor.dialect(), Limits::DEFAULT);
        Ok(Box::new(Datagrams { socket, reader }))
    }

    /// Tells a peer that speaks no carrier of ours what it may try.
    async fn refuse(&mut self, error: &ProtocolError) {
        if matches!(error, ProtocolError::UnknownCarrier { .. }) {
            self.output.extend_from_slice(REFUSAL.as_bytes());
        }
        let _ = stream::write_all(&self.stream, &mut self.output).await;
    }

    /// Goes on once the header is complete: may this peer come, and can it have what it asks for?
    fn begin(
        &mut self,
        carrier: &'static Carrier,
        sender: Sender,
        group: Option<SocketAddrV4>,
    ) -> Next {
        self.sender = sender;
        // A port that comes over a carrier that pushes comes to write.
        let wants = match carrier.push {
            true => is_port(&self.sender.name).then_some(Right::Write),
            false => Some(Right::Read),
        };
        if let Some(right) = wants.filter(|right| !self.may(*right)) {
            // Without an answer to its header the peer knows that it is not connected.
            self.output.clear();
            return Next::Stop(End::NotAllowed(right));
        }
        if !carrier.push {
            return Next::Stop(End::Reversed);
        }
        let opened = self.opened(carrier);
        self.greeting = self.output.len();
        if !matches!(opened, Ok(true)) {
            // Without the header reply the peer knows that there is no connection.
            self.output.clear();
        }
        match (opened, carrier.transport) {
            (Ok(false), _) => Next::Stop(End::Closed),
            (Err(error), _) => {
                carrier
                    .protocol
                    .put_refusal(carrier, &error, &mut self.output);
                Next::Stop(End::Refused(error))
            }
            (Ok(true), Transport::Stream) => Next::Go,
            (Ok(true), Transport::UnixSocket) => Next::UnixSocket,
            (Ok(true), Transport::SharedMemory) => Next::SharedMemory,
            (Ok(true), _) => Next::Datagrams(group),
        }
    }

    /// Whether a peer that has just come may be replied to in a form that its generation has to be known for.
    fn may_want_replies(&self, next: &Next, carrier: &Carrier) -> bool {
        let replies = match &self.core.options.input {
            Input::Discard => false,
            Input::Queue(_, serving) => *serving == Serving::Replies,
            Input::Handler(_) => true,
        };
        let goes_on = !matches!(next, Next::Stop(_) | Next::Datagrams(_));
        // Who has said more already does not wait.
        let waits = self.input.bytes.is_empty();
        replies
            && goes_on
            && waits
            && carrier.protocol.payloads().are_binary()
            && is_port(&self.sender.name)
    }

    /// Asks a port that comes which generation it is of, while it waits for the answer to its header.
    /// Later is too late: a port of stock's takes no connection while it waits for a reply.
    async fn ask_generation(&mut self) {
        let core = self.core.clone();
        if let Some(dialect) = probe::caller(&self.sender.name, &core.network).await {
            self.acceptor.assume(dialect);
        }
    }

    /// Takes note of the connection; `false` if there is a younger one of the same name.
    fn opened(&mut self, carrier: &'static Carrier) -> Result<bool, MonitorError> {
        self.spoke();
        let sender = &self.sender;
        let ends = (sender.name.as_str(), self.core.name.as_str());
        let monitors = self
            .core
            .monitors(&sender.modifiers, MonitorSide::Receive, ends)?;
        let mut text = carrier.name.to_owned();
        for (key, value) in &sender.modifiers {
            // As in stock, also those without a value have the dot.
            text.push('+');
            text.push_str(key);
            text.push('.');
            text.push_str(value.as_deref().unwrap_or_default());
        }
        let id = self.number;
        let noted = self.core.add_input(InputEntry {
            id,
            from: sender.name.clone(),
            carrier_text: text,
            carrier,
            socket: SocketHandle::of(&self.stream),
            meter: self.meter.clone(),
            monitors: monitors.clone(),
            steering: self.steering.take().expect("a header comes once"),
        });
        if !noted {
            return Ok(false);
        }
        let core = self.core.clone();
        self.entry = Some(Entry { id, core });
        self.from = self.sender.name.as_str().into();
        self.monitors = monitors;
        Ok(true)
    }

    /// Whether the roles in force now give the peer this right.
    pub(super) fn may(&mut self, right: Right) -> bool {
        let roles = self.core.network.roles();
        let generation = roles.generation();
        if self.rights.0 != generation {
            let mut rights = roles.rights(&self.core.name, self.peer());
            if self.core.options.judges_itself {
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

    /// What a peer is told that may not.
    pub(super) fn refusal(&self, right: Right) -> String {
        roles::refusal(&self.core.name, self.peer(), right)
    }

    async fn message(&mut self, message: Message) -> Next {
        match self.message_at_once(message) {
            Step::Done(next) => next,
            left => self.rest_of(left).await,
        }
    }

    /// Does with a message what needs no waiting: for most that is all.
    fn message_at_once(&mut self, message: Message) -> Step {
        self.is_understood = true;
        self.spoke();
        let Message { command, payload } = message;
        let Command::Data { reply, envelope } = command else {
            return Step::Command(command, payload);
        };
        if !self.may(Right::Write) {
            return Step::Command(Command::Data { reply, envelope }, payload);
        }
        self.meter.count(payload.len(), envelope.as_deref());
        let received = Received {
            payload,
            envelope,
            from: self.from.clone(),
            address: self.address,
            wants_reply: reply,
            responder: None,
            connection: self.number,
        };
        let answer = match self.hand(received) {
            Handing::Now(Handed::Answered(Answer::Nothing)) => (None, false),
            Handing::Now(Handed::Answered(Answer::Reply(reply))) => (Some(reply), false),
            handing => return Step::Handing(handing, reply),
        };
        let next = self.answer(answer, reply);
        self.acceptor.acknowledge(&mut self.output);
        Step::Done(next)
    }

    /// Does what is left to do with a message.
    async fn rest_of(&mut self, left: Step) -> Next {
        let next = match left {
            Step::Done(next) => return next,
            Step::Handing(handing, reply) => {
                let answer = self.finish(handing).await;
                self.answer(answer, reply)
            }
            // Who may not write.
            Step::Command(Command::Data { reply, .. }, _) => {
                if !reply {
                    return Next::Stop(End::NotAllowed(Right::Write));
                }
                let answer = admin::fail(&self.refusal(Right::Write));
                self.acceptor.reply(&answer, &mut self.output);
                Next::Go
            }
            Step::Command(Command::Admin, payload) => {
                let request = payload.to_bottle().unwrap_or_default();
                let answer = self.administer(&request).await;
                self.acceptor.reply(&answer, &mut self.output);
                match self.core.ends_with(&request) {
                    true => Next::Stop(End::Closed),
                    false => Next::Go,
                }
            }
            Step::Command(command, _) => self.command(command).await,
        };
        self.acceptor.acknowledge(&mut self.output);
        next
    }

    /// The answer to an admin request, or to who may not make it.
    pub(super) async fn administer(&mut self, request: &Bottle) -> Bottle {
        if let Some(right) = admin::needed(request).filter(|right| !self.may(*right)) {
            return admin::fail(&self.refusal(right));
        }
        let core = self.core.clone();
        self.wait_for(Box::pin(core.administer(request))).await
    }

    /// Hands a message to the owner and waits for the reply, if there is to be one; tells whether
    /// the connection shall end with it.
    pub(super) async fn deliver(&mut self, received: Received) -> (Option<Reply>, bool) {
        let handing = self.hand(received);
        self.finish(handing).await
    }

    /// Hands a message to the owner, unless there is more for it to pass.
    fn hand(&self, received: Received) -> Handing {
        match self.monitors.is_some() || self.core.is_watched() {
            true => Handing::Watched(received),
            false => Handing::Now(self.core.hand(received)),
        }
    }

    /// Waits for what is left to wait for, which is pinned here: by value it would be in each connection twice.
    async fn finish(&mut self, handing: Handing) -> (Option<Reply>, bool) {
        let core = self.core.clone();
        match handing {
            Handing::Now(handed) => self.wait_for(pin!(core.finish(handed))).await,
            Handing::Watched(received) => {
                let copies = log::are_brought_by(&self.sender);
                let monitors = self.monitors.clone();
                self.wait_for(pin!(core.take(monitors.as_ref(), received, copies)))
                    .await
            }
        }
    }

    /// Waits for what may take long. What was said so far goes out first: a peer that sends ahead
    /// must not wait for one answer because the next is not there yet.
    pub(super) async fn wait_for<T>(&mut self, waiting: impl Future<Output = T>) -> T {
        tokio::pin!(waiting);
        tokio::select! {
            biased;
            done = &mut waiting => return done,
            () = std::future::ready(()) => {}
        }
        if let Some(caller) = &mut self.caller {
            caller.waits(Instant::now());
        }
        let done = tokio::select! {
            biased;
            done = &mut waiting => done,
            () = self.say_so_far() => waiting.await,
        };
        self.spoke();
        done
    }

    /// Sends what was said so far; only the answer to a header waits a moment for that to the message
    /// which came along with it: who has sent both looks for nothing but the latter.
    async fn say_so_far(&mut self) {
        if self.greeting > 0 && self.output.len() == self.greeting {
            tokio::time::sleep(GREETING).await;
        }
        // A peer that is gone is noticed when it is read from.
        let _ = stream::write_all(&self.stream, &mut self.output).await;
    }

    /// The peer is not silent.
    fn spoke(&mut self) {
        if let Some(caller) = &mut self.caller {
            caller.spoke(Instant::now());
        }
    }

    fn answer(&mut self, (reply, last): (Option<Reply>, bool), wants_reply: bool) -> Next {
        match reply {
            Some(reply) => self.reply(&reply, wants_reply),
            None => self.reply_nothing(wants_reply),
        }
        if last {
            Next::Stop(End::Closed)
        } else {
            Next::Go
        }
    }

    fn reply(&mut self, reply: &Reply, wanted: bool) {
        if wanted {
            self.acceptor.reply(reply.as_ref(), &mut self.output);
        }
    }

    /// On a binary connection a sender that asked for a reply must get one: without it a stock
    /// sender takes the acknowledgement for the reply and hangs. People at a terminal get none.
    fn reply_nothing(&mut self, wanted: bool) {
        let binary = self
            .acceptor
            .carrier()
            .is_some_and(|carrier| carrier.protocol.payloads().are_binary());
        if wanted && binary {
            self.acceptor.reply(&Bottle::new(), &mut self.output);
        }
    }

    async fn command(&mut self, command: Command) -> Next {
        match self.obey(command).await {
            Ok(lines) => {
                self.acceptor.answer_lines(&lines, &mut self.output);
                Next::Go
            }
            Err(end) => Next::Stop(end),
        }
    }

    /// What a person is told who gives this command, or how the connection ends with it.
    pub(super) async fn obey(&mut self, command: Command) -> Result<String, End> {
        let core = self.core.clone();
        let needed = match command {
            Command::AddOutput(_) | Command::RemoveOutput(_) | Command::RemoveInput(_) => {
                Some(Right::Connect)
            }
            Command::Reverse => Some(Right::Read),
            _ => None,
        };
        if let Some(right) = needed.filter(|right| !self.may(*right)) {
            return Ok(self.refusal(right) + "\r\n");
        }
        Ok(match command {
            Command::Quit => return Err(End::Closed),
            Command::Reverse => return Err(End::Reversed),
            Command::AddOutput(destination) => either(
                self.wait_for(Box::pin(core.add_output_in_words(&destination)))
                    .await,
            ),
            Command::RemoveOutput(name) => either(
                self.wait_for(Box::pin(core.remove_output_in_words(&name)))
                    .await,
            ),
            Command::RemoveInput(name) => either(self.core.remove_input_in_words(&name)),
            Command::Describe => self.core.describe(),
            Command::Help => HELP.to_owned(),
            _ => NOT_UNDERSTOOD.to_owned(),
        })
    }

    /// Goes on as a connection that the port writes to.
    fn into_output(self) {
        let most = self
            .core
            .options
            .callers
            .and_then(|limits| limits.connections);
        if most.is_some_and(|most| self.core.outputs().len() >= most) {
            tracing::warn!(port = %self.core.name, from = self.sender.name, "too many read from here");
            return;
        }
        let Some(initiator) = self.acceptor.reversed() else {
            return;
        };
        let output = Output::start(
            &self.sender.name,
            initiator.carrier().name.to_owned(),
            // Perhaps it is on a thread that ends with it.
            Way::Stream(
                match self.moved {
                    true => self.stream.renewed(),
                    false => self.stream,
                },
                self.input,
            ),
            initiator,
            self.core.cancelled.clone(),
        );
        self.core.add_output(output);
    }
}

/// A message on its way to the owner.
enum Handing {
    Now(Handed),
    /// There is more to pass than the owner's queue.
    Watched(Received),
}

/// How far a message got without waiting.
enum Handed {
    Answered(Answer),
    /// The owner has it, and will answer.
    Asked(oneshot::Receiver<Answer>),
    /// There is no room for it yet, and perhaps somebody waits for the answer.
    NoRoom(Received, Option<oneshot::Receiver<Answer>>),
}

impl Core {
    /// What the monitors of a connection and of the port make of a message; `None` if one stops it.
    async fn monitored(
        &self,
        monitors: Option<&Arc<Chain>>,
        mut received: Received,
    ) -> Option<Received> {
        let attached = self.attached_in.chain();
        for chain in monitors.into_iter().chain(&attached) {
            let passing = chain.update(received.payload).await?;
            if !passing.delay.is_zero() {
                tokio::time::sleep(passing.delay).await;
            }
            received.payload = passing.payload;
        }
        Some(received)
    }

    /// Whether messages that arrive have more to pass than the owner's queue.
    fn is_watched(&self) -> bool {
        self.is_logged() || self.attached_in.is_there()
    }

    /// Hands a message to the owner through the monitors, and what came of it to those who look
    /// on, unless the message is a copy already. Waits for the reply, if there is to be one; tells whether the connection
    /// shall end with it.
    pub(super) async fn take(
        &self,
        monitors: Option<&Arc<Chain>>,
        received: Received,
        copies: bool,
    ) -> (Option<Reply>, bool) {
        let Some(received) = self.monitored(monitors, received).await else {
            return (None, false);
        };
        let copy = (self.is_logged() && !copies).then(|| Copied::of(&received));
        let (reply, last) = self.finish(self.hand(received)).await;
        if let Some(copy) = copy {
            self.forward(&copy, reply.as_ref());
        }
        (reply, last)
    }

    /// Hands a message to the owner.
    ///
    /// Messages that the queue drops are counted where they came from.
    fn hand(&self, mut received: Received) -> Handed {
        match &self.options.input {
            Input::Discard => Handed::Answered(Answer::Nothing),
            Input::Handler(handler) => Handed::Answered(handler(&mut received)),
            Input::Queue(_, serving) => {
                let mut answer = None;
                if received.wants_reply && *serving == Serving::Replies {
                    let (sender, receiver) = oneshot::channel();
                    received.responder = Some(Responder(sender));
                    answer = Some(receiver);
                }
                match self.queue().try_push(received) {
                    Ok(dropped) => {
                        dropped.into_iter().for_each(|id| self.count_dropped(id));
                        answer.map_or(Handed::Answered(Answer::Nothing), Handed::Asked)
                    }
                    Err(received) => Handed::NoRoom(received, answer),
                }
            }
        }
    }

    fn queue(&self) -> &Inbox {
        let inbox = self.inbox.as_ref();
        inbox.expect("a port that queues has an inbox")
    }

    /// Waits for what is left to wait for.
    async fn finish(&self, handed: Handed) -> (Option<Reply>, bool) {
        let asked = match handed {
            Handed::Answered(answer) => Err(answer),
            Handed::Asked(asked) => Ok(asked),
            Handed::NoRoom(received, asked) => {
                if let Some(id) = self.queue().push(received).await {
                    self.count_dropped(id);
                }
                asked.ok_or(Answer::Nothing)
            }
        };
        let mut answer = match asked {
            Ok(asked) => asked.await.unwrap_or(Answer::Nothing),
            Err(answer) => answer,
        };
        loop {
            match answer {
                Answer::Later(later) => answer = later.await,
                Answer::Nothing => return (None, false),
                Answer::Reply(reply) => return (Some(reply), false),
                Answer::ReplyAndClose(reply) => return (Some(reply), true),
            }
        }
    }
}

fn either(result: Result<String, String>) -> String {
    match result {
        Ok(text) | Err(text) => text,
    }
}
