//! Which end listens, and how the two connections come about.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use super::backoff::sleep_until;

/// The TCP port for commands, as the ancestor of the protocol had it.
pub const ARM_PORT: u16 = 4321;
/// The TCP port for asynchronous packets.
pub const PACKET_PORT: u16 = 4323;

/// How often a listener looks, as long as nobody is connected.
const LOOK: Duration = Duration::from_millis(5);
/// How long one attempt to connect may take.
const CONNECT: Duration = Duration::from_secs(1);

/// Where the two connections are accepted.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Places {
    /// For commands.
    pub arm: SocketAddr,
    /// For asynchronous packets.
    pub packets: SocketAddr,
}

/// Which end this is.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Meeting {
    /// Waits for the other end; port 0 is any that is free.
    Listen(Places),
    /// Goes to the other end, again and again.
    Connect(Places),
}

impl Meeting {
    /// Listens on free ports of the loopback interface.
    pub fn anywhere() -> Self {
        let place = SocketAddr::new(Ipv4Addr::LOCALHOST.into(), 0);
        Self::Listen(Places {
            arm: place,
            packets: place,
        })
    }
}

/// The two connections of a session.
#[derive(Debug)]
pub(super) struct Pair {
    pub(super) arm: TcpStream,
    pub(super) packets: TcpStream,
}

/// A [`Meeting`] that has begun.
#[derive(Debug)]
pub(super) enum Meeter {
    Listening {
        arm: TcpListener,
        packets: TcpListener,
    },
    Connecting(Places),
}

impl Meeter {
    /// Takes the ports, if it is to listen; answers also where it listens, or connects to.
    pub(super) fn begin(meeting: Meeting) -> io::Result<(Self, Places)> {
        let listen = |place: SocketAddr| {
            let listener = TcpListener::bind(place).map_err(|error| {
                io::Error::new(error.kind(), format!("cannot listen at {place}: {error}"))
            })?;
            listener.set_nonblocking(true)?;
            Ok::<_, io::Error>(listener)
        };
        match meeting {
            Meeting::Listen(places) => {
                let (arm, packets) = (listen(places.arm)?, listen(places.packets)?);
                let places = Places {
                    arm: arm.local_addr()?,
                    packets: packets.local_addr()?,
                };
                Ok((Self::Listening { arm, packets }, places))
            }
            Meeting::Connect(places) => Ok((Self::Connecting(places), places)),
        }
    }

    /// Both connections; `None` when it is to end.
    ///
    /// A listener waits for as long as it takes. Who connects tries once.
    pub(super) fn meet(&self, ending: &AtomicBool) -> io::Result<Option<Pair>> {
        let pair = match self {
            Self::Listening { arm, packets } => accept_both(arm, packets, ending)?,
            Self::Connecting(places) => {
                let connect = |place: SocketAddr| {
                    TcpStream::connect_timeout(&place, CONNECT).map_err(|error| {
                        io::Error::new(error.kind(), format!("cannot connect to {place}: {error}"))
                    })
                };
                Some(Pair {
                    arm: connect(places.arm)?,
                    packets: connect(places.packets)?,
                })
            }
        };
        if let Some(pair) = &pair {
            for stream in [&pair.arm, &pair.packets] {
                stream.set_nodelay(true)?;
            }
        }
        Ok(pair)
    }

    /// Closes connections that came while there is one.
    pub(super) fn turn_away(&self) -> usize {
        let Self::Listening { arm, packets } = self else {
            return 0;
        };
        [arm, packets]
            .into_iter()
            .filter(|listener| matches!(newest(listener), Ok(Some(_))))
            .count()
    }
}

/// Waits for one connection at each. Where several have come the newest counts: the others are of a peer that gave up.
fn accept_both(
    arm: &TcpListener,
    packets: &TcpListener,
    ending: &AtomicBool,
) -> io::Result<Option<Pair>> {
    let (mut one, mut other) = (None, None);
    while !ending.load(Ordering::Acquire) {
        one = newest(arm)?.or(one);
        other = newest(packets)?.or(other);
        match (one.take(), other.take()) {
            (Some(arm), Some(packets)) => return Ok(Some(Pair { arm, packets })),
            (arm, packets) => (one, other) = (arm, packets),
        }
        sleep_until(Instant::now() + LOOK, ending);
    }
    Ok(None)
}

/// The last of the connections that wait, if any does.
fn newest(listener: &TcpListener) -> io::Result<Option<TcpStream>> {
    let mut newest = None;
    // As many as a listener keeps; somebody who connects without end does not hold us up.
    for _ in 0..128 {
        match listener.accept() {
            Ok((stream, _)) => {
                // Some systems hand the listener's setting on.
                stream.set_nonblocking(false)?;
                newest = Some(stream);
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
            // It went away again while it waited.
            Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(newest)
}

/// Wakes a thread and waits until it has ended.
pub(super) fn join(thread: thread::JoinHandle<()>, what: &str) {
    thread.thread().unpark();
    if thread.join().is_err() {
        tracing::error!("{what} had panicked");
    }
}
