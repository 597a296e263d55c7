//! One incoming connection: its life, from the first byte to the end.

mod datagrams;
mod messages;
mod opening;

use std::io;
use std::net::{IpAddr, SocketAddrV4};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::BytesMut;
use tokio::net::TcpStream;
use yarp_wire::Limits;
use yarp_wire::carrier::Sender;
use yarp_wire::connection::{Acceptor, Event, ProtocolError};

use self::datagrams::Datagrams;
use self::messages::Step;
use super::callers::{Caller, Farewell};
use super::core::{Core, Entry, GOODBYE};
use super::counters::Meter;
use super::monitor::{Chain, MonitorError};
use super::output::{Output, Way};
use super::own_thread::{OwnThread, Steered, Steering};
use super::qos::SocketHandle;
use crate::auth;
use crate::busy::{BusyPoll, Expecting};
use crate::cancel::Cancelled;
use crate::datagram;
use crate::error::story;
use crate::roles::{self, Peer, Right, Rights};
use crate::stream::{self, Inflow, Socket};
use crate::tcp::Tcp;

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

    /// The connection goes on over another socket.
    fn goes_on_over(&self, socket: SocketHandle) {
        if let Some(entry) = &self.entry {
            self.core.move_input(entry.id, socket);
        }
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
