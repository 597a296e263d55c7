//! Discovery of the name server by multicast.
//!
//! One datagram with a query goes to the group 224.2.1.1; every reachable name server answers with
//! one datagram to the group. Only `yarp detect` does this: programs get the address of their name
//! server from the configuration.

use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::time::Duration;

use socket2::{Domain, Protocol, Socket, Type};
use tokio::net::UdpSocket;
use tokio::time::{Instant, timeout_at};
use yarp_wire::datagram;
use yarp_wire::name_service::{Command, Registration, Request, Style};

use crate::config::DEFAULT_PORT;

/// The multicast group of name servers.
pub const GROUP: Ipv4Addr = Ipv4Addr::new(224, 2, 1, 1);

/// The parameters of a search for a name server.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Discovery {
    namespace: String,
    group: Ipv4Addr,
    port: u16,
    interfaces: Vec<Ipv4Addr>,
    rounds: u32,
    round: Duration,
}

impl Discovery {
    /// Searches for the server called `namespace` as stock does: on UDP port 10000, with three
    /// queries and a wait of 0.75 s after each.
    pub fn of(namespace: &str) -> Self {
        Self {
            namespace: namespace.to_owned(),
            group: GROUP,
            port: DEFAULT_PORT,
            interfaces: Vec::new(),
            rounds: 3,
            round: Duration::from_millis(750),
        }
    }

    /// The same on another UDP port (`YARP_PORT_RANGE`).
    pub fn port(mut self, port: u16) -> Self {
        self.port = port;
        self
    }

    /// The same on the networks of these own addresses; without any, on the one that the system
    /// prefers.
    pub fn interfaces(mut self, own: impl IntoIterator<Item = IpAddr>) -> Self {
        let ipv4 = |address| match address {
            IpAddr::V4(address) => Some(address),
            IpAddr::V6(_) => None,
        };
        self.interfaces = own.into_iter().filter_map(ipv4).collect();
        self
    }

    /// Sets the number of queries and the wait after each.
    pub fn rounds(mut self, rounds: u32, round: Duration) -> Self {
        (self.rounds, self.round) = (rounds, round);
        self
    }

    /// Returns the first server that answers for the namespace, or none within the time.
    ///
    /// Takes at most the number of rounds times their length; dropping the future ends it at any
    /// time. With several servers of one name it is chance which answers first.
    pub async fn run(&self) -> io::Result<Option<Registration>> {
        let socket = self.open()?;
        let name = self.namespace.clone();
        let query = Request::plain(Command::Query { name }).to_bytes(Style::Line);
        let query = datagram::encode(0, &query);
        let mut buffer = [0; 2048];
        for _ in 0..self.rounds {
            let deadline = Instant::now() + self.round;
            self.ask(&socket, &query).await?;
            while let Ok(received) = timeout_at(deadline, socket.recv_from(&mut buffer)).await {
                let (size, _) = received?;
                if let Some(found) = answer(&self.namespace, &buffer[..size]) {
                    return Ok(Some(found));
                }
            }
        }
        Ok(None)
    }

    /// Sends the query into every network; one that works is enough.
    async fn ask(&self, socket: &UdpSocket, query: &[u8]) -> io::Result<()> {
        let mut result = Err(io::ErrorKind::AddrNotAvailable.into());
        for interface in self.networks() {
            let way = socket2::SockRef::from(socket).set_multicast_if_v4(&interface);
            let sent = match way {
                Ok(()) => socket.send_to(query, (self.group, self.port)).await,
                Err(error) => Err(error),
            };
            match sent {
                Ok(_) => result = Ok(()),
                Err(error) if result.is_err() => result = Err(error),
                Err(_) => {}
            }
        }
        result
    }

    fn open(&self) -> io::Result<UdpSocket> {
        let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
        // Servers on this machine have the same port open.
        socket.set_reuse_address(true)?;
        #[cfg(all(unix, not(any(target_os = "solaris", target_os = "illumos"))))]
        socket
            .set_reuse_port(true)
            .or_else(|error| match error.kind() {
                io::ErrorKind::Unsupported => Ok(()),
                _ => Err(error),
            })?;
        socket.set_nonblocking(true)?;
        let any = std::net::SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, self.port);
        socket.bind(&any.into())?;
        let joined = self
            .networks()
            .map(|own| socket.join_multicast_v4(&self.group, &own));
        // One network that has no multicast does not spoil the others.
        joined.reduce(io::Result::or).unwrap_or(Ok(()))?;
        UdpSocket::from_std(socket.into())
    }

    fn networks(&self) -> impl Iterator<Item = Ipv4Addr> {
        let preferred = self.interfaces.is_empty().then_some(Ipv4Addr::UNSPECIFIED);
        self.interfaces.iter().copied().chain(preferred)
    }
}

/// Returns the server in a datagram, if it is an answer and not a query.
fn answer(namespace: &str, packet: &[u8]) -> Option<Registration> {
    let datagram = datagram::decode(packet).ok()?;
    let text = std::str::from_utf8(datagram.data).ok()?;
    let found: Registration = text.lines().next()?.parse().ok()?;
    (found.name == namespace).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_answers_for_the_namespace_count() {
        let check = |text: &str, expected: Option<u16>| {
            let packet = datagram::encode(0, text.as_bytes());
            assert_eq!(
                answer("/root", &packet).map(|found| found.port),
                expected,
                "{text}"
            );
        };
        check(
            "registration name /root ip 192.0.2.2 port 10000 type tcp\n",
            Some(10000),
        );
        check(
            "registration name /other ip 192.0.2.2 port 10000 type tcp\n",
            None,
        );
        check("NAME_SERVER query /root\n", None);
        check("*** end of message\n", None);
        check("", None);
        assert_eq!(answer("/root", b"noise"), None);
    }

    /// Returns a free UDP port, so that no server of this machine is queried.
    fn free_port() -> u16 {
        let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.local_addr().unwrap().port()
    }

    #[tokio::test]
    async fn discovery_without_answer_times_out() {
        let round = Duration::from_millis(20);
        let discovery = Discovery::of("/root").port(free_port()).rounds(2, round);
        let started = Instant::now();
        // A machine without multicast reports that at once.
        if let Ok(found) = discovery.run().await {
            assert_eq!(found, None);
            assert!(started.elapsed() >= 2 * round);
        }
    }

    /// A server in the group receives the query and answers to the group.
    #[tokio::test]
    async fn an_answering_server_is_found() {
        let discovery = Discovery::of("/root").port(free_port());
        let Ok(server) = discovery.open() else {
            return;
        };
        let serve = async {
            let mut buffer = [0; 2048];
            loop {
                let size = server.recv(&mut buffer).await.unwrap();
                let Ok(query) = datagram::decode(&buffer[..size]) else {
                    continue;
                };
                assert_eq!(query.data, b"NAME_SERVER query /root\n");
                let line = b"registration name /root ip 192.0.2.2 port 10310 type tcp\n";
                let answer = datagram::encode(0, line);
                discovery.ask(&server, &answer).await.unwrap();
                return;
            }
        };
        let (found, ()) = match discovery.open() {
            Ok(_) => tokio::join!(discovery.run(), serve),
            Err(_) => return,
        };
        assert_eq!(found.unwrap().unwrap().port, 10310);
    }
}
