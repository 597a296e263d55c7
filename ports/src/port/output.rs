//! One outgoing connection.

mod datagrams;
mod stream;

use std::io;
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use bytes::BytesMut;
use tokio::net::UdpSocket;
use tokio::task::JoinHandle;
use yarp_wire::carrier::{Carrier, CarrierSpec, Sender, Transport};
use yarp_wire::connection::{Initiator, Progress, put_group};
use yarp_wire::message::{Command, Pieces};
use yarp_wire::{Dialect, Limits};

use super::encoded::Form;
use super::group::Group;
use super::outbox::Outbox;
use super::qos::SocketHandle;
use crate::cancel::Cancelled;
use crate::datagram;
use crate::dialogue::Dialogue;
use crate::error::PortError;
use crate::network::Place;
use crate::stream::{Inflow, Socket, connect, within, write_all};
use crate::unix;

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
    /// What it sends on.
    pub(crate) socket: SocketHandle,
    /// Whether the owner has been told that it began.
    pub(crate) reported: AtomicBool,
    task: JoinHandle<()>,
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
    pub(crate) deadline: Duration,
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
}

impl Output {
    /// Connects to a reader and waits until it has answered the header.
    pub(crate) async fn connect(
        target: &Target<'_>,
        cancelled: Cancelled,
    ) -> Result<Self, PortError> {
        let name = &target.to.name;
        let opening = async {
            let (stream, initiator, input) = open(target).await?;
            let way = match (target.group, local_ip(&stream)) {
                (Some(group), Some(IpAddr::V4(local))) => {
                    let socket = datagram::group_sender(group.address, local).await;
                    Way::Datagrams(Arc::new(socket.map_err(|error| target.lost(error))?))
                }
                _ if target.carrier.transport == Transport::Datagrams => {
                    let number = datagram_port(&initiator).map_err(|error| target.lost(error))?;
                    let socket = datagram::sender(&target.to.host, number).await;
                    Way::Datagrams(Arc::new(socket.map_err(|error| target.lost(error))?))
                }
                _ => match (target.carrier.transport, stream.tcp()) {
                    (Transport::UnixSocket, Some(header)) => {
                        let socket = unix::connect(header).await;
                        let socket = socket.map_err(|error| target.lost(error))?;
                        Way::Stream(Arc::new(Socket::Unix(socket)), Inflow::default())
                    }
                    _ => Way::Stream(Arc::new(stream), input),
                },
            };
            Ok((way, initiator))
        };
        let (way, initiator) = within(target.deadline, name, "connection header", opening).await?;
        let mut output = Self::start(name, target.spec.to_string(), way, initiator, cancelled);
        output.group = target.group.cloned();
        output.farewell = target.carrier.connectionless.then(|| Farewell {
            from: target.from.to_owned(),
            to: target.to.clone(),
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
            let reason = match way {
                Way::Stream(stream, input) => stream::run(&stream, &shared, input, cancelled).await,
                Way::Datagrams(socket) => datagrams::run(&socket, &shared, cancelled).await,
            };
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
            task,
        }
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
                }
            }
        };
        // A reader that does not answer in time is left.
        let _ = tokio::time::timeout(deadline, goodbye).await;
        self.outbox.close("closed here");
        self.task.abort();
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        self.outbox.close("closed here");
        self.task.abort();
    }
}

impl Target<'_> {
    fn lost(&self, error: io::Error) -> PortError {
        let address = format!("{}:{}", self.to.host, self.to.port);
        PortError::connect(&self.to.name, address, "connection header", error)
    }
}

/// Connects and goes through the header.
async fn open(target: &Target<'_>) -> Result<(Socket, Initiator, Inflow), PortError> {
    let Place {
        name, host, port, ..
    } = target.to;
    let stream = connect(name, host, *port, target.deadline).await?;
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
        let progress = initiator.poll(&mut input.bytes);
        let progress = progress.map_err(|source| PortError::Protocol {
            peer: name.clone(),
            source,
        })?;
        if progress == Some(Progress::Ready) {
            return Ok((stream, initiator, input));
        }
        if input.read(&stream, 0).await.map_err(lost)? == 0 {
            return Err(lost(io::ErrorKind::UnexpectedEof.into()));
        }
    }
}

fn local_ip(stream: &Socket) -> Option<IpAddr> {
    Some(stream.tcp()?.local_addr().ok()?.ip())
}

/// Where the reader wants its datagrams.
fn datagram_port(initiator: &Initiator) -> io::Result<u16> {
    let number = initiator.header_number();
    u16::try_from(number)
        .ok()
        .filter(|number| *number != 0)
        .ok_or_else(|| io::Error::other(format!("the reader has no datagram port ({number})")))
}

impl Farewell {
    /// Tells the reader to forget the connection: `~/WRITER`, as stock does.
    async fn say(&self, deadline: Duration) {
        let carrier = Carrier::by_name("text_ack").expect("text_ack is in the table");
        let address = (self.to.host.as_str(), self.to.port);
        let dialogue = Dialogue::open(&self.to.name, address, carrier, "admin", deadline).await;
        // A reader that is gone has forgotten already.
        if let Ok(mut dialogue) = dialogue {
            let _ = dialogue
                .command(&Command::RemoveInput(self.from.clone()))
                .await;
        }
    }
}
