//! UDP sockets.

use std::cell::RefCell;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4};
use std::os::fd::AsFd;
use std::sync::Arc;

use socket2::{Domain, Protocol, SockRef, Socket, Type};
use tokio::net::UdpSocket;

use crate::addresses;

/// Maximum length of a datagram.
const MAX_DATAGRAM_LEN: usize = 65_536;
/// Room for datagrams that wait to be read, in bytes; the system may grant less.
const RECEIVE_BUFFER: usize = 8 << 20;
/// Room for datagrams that wait to be sent, in bytes; the system may grant less.
const SEND_BUFFER: usize = 4 << 20;

/// A socket to read from at `local`, on a port that the system chooses.
pub(crate) fn reader(local: Ipv4Addr) -> io::Result<UdpSocket> {
    bound(SocketAddrV4::new(local, 0), |_| Ok(()))
}

/// Returns the same socket, registered with the current runtime; if that fails, the previous
/// registration remains.
pub(crate) fn renewed(socket: &Arc<UdpSocket>) -> Arc<UdpSocket> {
    let copied = socket.as_fd().try_clone_to_owned();
    let renewed = copied.and_then(|copy| UdpSocket::from_std(copy.into()));
    renewed.map_or_else(|_| socket.clone(), Arc::new)
}

thread_local! {
    /// The receive buffer of a thread: an idle connection needs none of its own.
    static ARRIVING: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Hands the next datagram to `take`, and where it came from; `None` if there is none now.
pub(crate) fn receive<T>(
    socket: &UdpSocket,
    take: impl FnOnce(&[u8], SocketAddr) -> T,
) -> io::Result<Option<T>> {
    ARRIVING.with_borrow_mut(|buffer| {
        buffer.resize(MAX_DATAGRAM_LEN, 0);
        match socket.try_recv_from(buffer) {
            Ok((length, source)) => Ok(Some(take(&buffer[..length], source))),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
            Err(error) => Err(error),
        }
    })
}

/// Accepted senders of the datagrams of a connection.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) enum Sources {
    /// This address, and the port that was the first to send from there, once there is one.
    Peer(IpAddr, Option<u16>),
    /// Any port of these addresses.
    Hosts(Vec<IpAddr>),
}

impl Sources {
    /// Returns those of a writer over `udp` whose header came from `peer`.
    pub(crate) fn of_writer(peer: IpAddr) -> Self {
        Self::Peer(peer.to_canonical(), None)
    }

    /// Returns those of a group whose writer sent its header from `peer`.
    ///
    /// A writer of this machine may send from any of its interfaces. One of another machine sends from the interface that
    /// the header came from. Its port may change: any connection of the group may be the one that transmits.
    pub(crate) fn of_group(peer: IpAddr) -> Self {
        let peer = peer.to_canonical();
        let mut hosts = vec![peer];
        let own = addresses::all();
        if peer.is_loopback() || own.contains(&peer) {
            hosts.extend(own);
        }
        Self::Hosts(hosts)
    }

    /// Returns whether a datagram from there is one of the writer's; the first one of a writer over `udp` settles its port.
    pub(crate) fn admit(&mut self, socket: &UdpSocket, source: SocketAddr) -> bool {
        let address = source.ip().to_canonical();
        match self {
            Self::Hosts(hosts) => hosts.contains(&address),
            Self::Peer(peer, Some(port)) => *peer == address && *port == source.port(),
            Self::Peer(peer, port) => {
                let is_first = *peer == address;
                if is_first {
                    *port = Some(source.port());
                    // From now on the system keeps others out of the buffer, too; those that are in it are found here.
                    let _ = SockRef::from(socket).connect(&source.into());
                }
                is_first
            }
        }
    }
}

/// Creates a socket that receives the datagrams of a group, on the interface with address `local`.
pub(crate) fn group_reader(group: SocketAddrV4, local: Ipv4Addr) -> io::Result<UdpSocket> {
    if !group.ip().is_multicast() {
        return Err(io::Error::other(format!(
            "{group} is not a multicast group"
        )));
    }
    // Bound to the group itself, so that nothing else on its port gets in.
    let socket = bound(group, |socket| socket.set_reuse_address(true))?;
    socket.join_multicast_v4(*group.ip(), local)?;
    Ok(socket)
}

/// Returns a socket that sends to one place.
pub(crate) async fn sender(host: &str, number: u16) -> io::Result<UdpSocket> {
    let socket = bound(SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, 0), |_| Ok(()))?;
    socket.connect((host, number)).await?;
    Ok(socket)
}

/// Returns the address of the interface that leads to a place.
pub(crate) async fn local_address_towards(host: &str, number: u16) -> io::Result<Ipv4Addr> {
    let socket = sender(host, number).await?;
    match socket.local_addr()?.ip() {
        IpAddr::V4(address) => Ok(address),
        IpAddr::V6(_) => Err(io::ErrorKind::Unsupported.into()),
    }
}

/// Returns a socket that sends to a group from the interface with address `local`.
pub(crate) async fn group_sender(group: SocketAddrV4, local: Ipv4Addr) -> io::Result<UdpSocket> {
    let socket = bound(SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, 0), |socket| {
        socket.set_multicast_if_v4(&local)?;
        socket.set_multicast_loop_v4(true)
    })?;
    socket.connect(group).await?;
    Ok(socket)
}

fn bound(
    address: SocketAddrV4,
    prepare: impl Fn(&Socket) -> io::Result<()>,
) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    socket.set_nonblocking(true)?;
    prepare(&socket)?;
    // Smaller buffers only make losses likelier.
    let _ = socket.set_recv_buffer_size(RECEIVE_BUFFER);
    let _ = socket.set_send_buffer_size(SEND_BUFFER);
    socket.bind(&address.into())?;
    UdpSocket::from_std(socket.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_hears_the_host_of_its_writer() {
        let far: IpAddr = "203.0.113.7".parse().unwrap();
        assert_eq!(Sources::of_group(far), Sources::Hosts(vec![far]));
        // A writer of this machine sends from whichever interface the group has.
        let Sources::Hosts(hosts) = Sources::of_group(Ipv4Addr::LOCALHOST.into()) else {
            panic!("the hosts of a group");
        };
        assert!(addresses::all().iter().all(|own| hosts.contains(own)));
        assert!(!hosts.contains(&far) && !hosts.contains(&"127.0.0.66".parse().unwrap()));
    }
}
