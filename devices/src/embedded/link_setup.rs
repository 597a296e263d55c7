//! Setup of the two connections: which end listens, accepting and connecting.

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

/// Interval between checks for new connections while nobody is connected.
const ACCEPT_POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Maximum number of further connections that are rejected in a round, at each port: a peer that keeps connecting does not delay replies.
const MAX_REJECTED: usize = 4;
/// Timeout of one attempt to connect.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(1);

/// Addresses of the two connections.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct LinkAddresses {
    /// For commands.
    pub arm: SocketAddr,
    /// For asynchronous packets.
    pub packets: SocketAddr,
}

/// Role of this end: listening or connecting.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum LinkMode {
    /// Waits for the other end; port 0 is any that is free.
    Listen(LinkAddresses),
    /// Goes to the other end, again and again.
    Connect(LinkAddresses),
}

impl LinkMode {
    /// Listens on free ports of the loopback interface.
    pub fn listen_on_loopback() -> Self {
        let place = SocketAddr::new(Ipv4Addr::LOCALHOST.into(), 0);
        Self::Listen(LinkAddresses {
            arm: place,
            packets: place,
        })
    }
}

/// The two connections of a session.
#[derive(Debug)]
pub(super) struct SocketPair {
    pub(super) arm: TcpStream,
    pub(super) packets: TcpStream,
}

/// A [`LinkMode`] that has begun.
#[derive(Debug)]
pub(super) enum LinkConnector {
    Listening {
        arm: TcpListener,
        packets: TcpListener,
    },
    Connecting(LinkAddresses),
}

impl LinkConnector {
    /// Binds the ports, if it listens; also returns the addresses at which it listens, or to which it connects.
    pub(super) fn start(link_mode: LinkMode) -> io::Result<(Self, LinkAddresses)> {
        let listen = |place: SocketAddr| {
            let listener = TcpListener::bind(place).map_err(|error| {
                io::Error::new(error.kind(), format!("cannot listen at {place}: {error}"))
            })?;
            listener.set_nonblocking(true)?;
            Ok::<_, io::Error>(listener)
        };
        match link_mode {
            LinkMode::Listen(addresses) => {
                let (arm, packets) = (listen(addresses.arm)?, listen(addresses.packets)?);
                let addresses = LinkAddresses {
                    arm: arm.local_addr()?,
                    packets: packets.local_addr()?,
                };
                Ok((Self::Listening { arm, packets }, addresses))
            }
            LinkMode::Connect(addresses) => Ok((Self::Connecting(addresses), addresses)),
        }
    }

    /// Both connections; `None` when it is to end.
    ///
    /// A listener waits for as long as it takes. The connecting end tries once.
    pub(super) fn connect(&self, ending: &AtomicBool) -> io::Result<Option<SocketPair>> {
        let pair = match self {
            Self::Listening { arm, packets } => accept_both(arm, packets, ending)?,
            Self::Connecting(addresses) => {
                let connect = |place: SocketAddr| {
                    TcpStream::connect_timeout(&place, CONNECT_TIMEOUT).map_err(|error| {
                        io::Error::new(error.kind(), format!("cannot connect to {place}: {error}"))
                    })
                };
                Some(SocketPair {
                    arm: connect(addresses.arm)?,
                    packets: connect(addresses.packets)?,
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

    /// Closes connections that came while there is one; returns their number. The rest of a flood waits for the next call.
    pub(super) fn reject_pending(&self) -> usize {
        let Self::Listening { arm, packets } = self else {
            return 0;
        };
        [arm, packets]
            .into_iter()
            .map(|listener| {
                (0..MAX_REJECTED)
                    .take_while(|_| listener.accept().is_ok())
                    .count()
            })
            .sum()
    }
}

/// Waits for one connection at each. Of several connections the newest counts: the others are of a peer that gave up.
fn accept_both(
    arm: &TcpListener,
    packets: &TcpListener,
    ending: &AtomicBool,
) -> io::Result<Option<SocketPair>> {
    let (mut one, mut other) = (None, None);
    while !ending.load(Ordering::Acquire) {
        one = accept_newest(arm)?.or(one);
        other = accept_newest(packets)?.or(other);
        match (one.take(), other.take()) {
            (Some(arm), Some(packets)) => return Ok(Some(SocketPair { arm, packets })),
            (arm, packets) => (one, other) = (arm, packets),
        }
        sleep_until(Instant::now() + ACCEPT_POLL_INTERVAL, ending);
    }
    Ok(None)
}

/// The last of the connections that wait, if any does.
fn accept_newest(listener: &TcpListener) -> io::Result<Option<TcpStream>> {
    let mut newest = None;
    // The length of the listen queue; a peer that keeps connecting does not block the driver.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_connections_is_rejected_a_few_at_a_time() {
        let listening = LinkConnector::start(LinkMode::listen_on_loopback());
        let (connector, addresses) = listening.expect("it listens");
        let flood: Vec<_> = (0..10)
            .map(|_| TcpStream::connect(addresses.arm).expect("it is accepted"))
            .collect();
        let _other = TcpStream::connect(addresses.packets).expect("it is accepted");
        let rejected = [(); 4].map(|()| connector.reject_pending());
        assert_eq!(rejected, [5, 4, 2, 0]);
        drop(flood);
    }
}
