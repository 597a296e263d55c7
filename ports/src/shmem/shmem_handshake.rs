//! The handshake by which two ends share memory.

use std::hash::{BuildHasher, RandomState};
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::Mutex;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use yarp_wire::shmem::{PACKET, accept_packet, answers_mark, connect_packet, initiator_mark};

use super::shmem_segment::Channel;
use super::{Layout, ShmemStream, lock_free_ring, stock_ring};

/// Timeout of the initiator's connection, and then of each byte of its packet.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(if cfg!(test) { 2 } else { 5 });
/// Maximum number of TCP ports tried until one is found whose key is unused.
const MAX_TRIES: usize = 16;

/// The prepared resources of an acceptor.
#[derive(Debug)]
pub(crate) struct Offer {
    listener: TcpListener,
    output: Channel,
    number: u16,
    ip: IpAddr,
}

impl Offer {
    /// Prepares the acceptor's side of the connection that `header` began.
    pub(crate) async fn new(header: &TcpStream) -> io::Result<Self> {
        let ip = same_machine(header.peer_addr()?, header.local_addr()?)?;
        let mut tries = 0;
        loop {
            let listener = TcpListener::bind((ip, 0)).await?;
            let number = listener.local_addr()?.port();
            match Channel::create(number, lock_free_ring::LENGTH) {
                Ok(output) => {
                    stock_ring::prepare(&output);
                    return Ok(Self {
                        listener,
                        output,
                        number,
                        ip,
                    });
                }
                Err(error) if error.kind() == io::ErrorKind::AddrInUse && tries < MAX_TRIES => {
                    tries += 1;
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// Returns the TCP port for the initiator.
    pub(crate) fn number(&self) -> u16 {
        self.number
    }

    /// Waits for the initiator, whose short packet may arrive slowly.
    pub(crate) async fn accept(mut self) -> io::Result<ShmemStream> {
        let accepting = async {
            loop {
                let (tcp, from) = self.listener.accept().await?;
                if from.ip() == self.ip {
                    return Ok((tcp, from));
                }
            }
        };
        let (mut tcp, from) = in_time(accepting).await?;
        tcp.set_nodelay(true)?;
        let mut said = [0; PACKET];
        for byte in &mut said {
            *byte = in_time(tcp.read_u8()).await?;
        }
        let mark = initiator_mark(&said).map_err(invalid)?;
        let input = Channel::open(from.port())?;
        let ours = lock_free_ring::has_mark(&input.segment, mark);
        if ours {
            lock_free_ring::put_mark(&self.output.segment, mark);
        }
        let answer = accept_packet(ours.then_some(mark));
        in_time(tcp.write_all(&answer)).await?;
        // Stock attaches itself to a segment before it opens the locks, and makes those that are missing: their names stay
        // until it has written something.
        if ours {
            self.output.segment.unname_if_shared();
        }
        stream(tcp, ours, input, self.output)
    }
}

/// Continues as initiator of the connection that `header` began, with an acceptor that named TCP
/// port `number`.
pub(crate) async fn connect(header: &TcpStream, number: u16) -> io::Result<ShmemStream> {
    let ip = same_machine(header.local_addr()?, header.peer_addr()?)?;
    let (socket, mut output) = output(ip)?;
    let mark = RandomState::new().hash_one(number) as u32;
    stock_ring::prepare(&output);
    lock_free_ring::put_mark(&output.segment, mark);
    let mut tcp = socket.connect(SocketAddr::new(ip, number)).await?;
    tcp.set_nodelay(true)?;
    tcp.write_all(&connect_packet(mark)).await?;
    let answer = packet(&mut tcp).await?;
    // The acceptor has opened it before it answered.
    output.segment.unname();
    let input = Channel::open(number)?;
    let ours = answers_mark(&answer, mark).map_err(invalid)?
        && lock_free_ring::has_mark(&input.segment, mark);
    stream(tcp, ours, input, output)
}

/// Returns a socket with a TCP port, and the channel of that port.
fn output(ip: IpAddr) -> io::Result<(TcpSocket, Channel)> {
    let mut tries = 0;
    loop {
        let socket = match ip {
            IpAddr::V4(_) => TcpSocket::new_v4()?,
            IpAddr::V6(_) => TcpSocket::new_v6()?,
        };
        socket.bind(SocketAddr::new(ip, 0))?;
        match Channel::create(socket.local_addr()?.port(), lock_free_ring::LENGTH) {
            Ok(output) => return Ok((socket, output)),
            Err(error) if error.kind() == io::ErrorKind::AddrInUse && tries < MAX_TRIES => {
                tries += 1
            }
            Err(error) => return Err(error),
        }
    }
}

pub(super) fn stream(
    tcp: TcpStream,
    ours: bool,
    input: Channel,
    output: Channel,
) -> io::Result<ShmemStream> {
    let layout = if ours {
        Layout::Ours {
            // Without the locks, each of which takes a page.
            reader: Mutex::new(lock_free_ring::Reader::new(input.segment)),
            writer: Mutex::new(lock_free_ring::Writer::new(output.segment)),
        }
    } else {
        Layout::stock(
            stock_ring::Reader::new(input),
            stock_ring::Writer::new(output),
        )?
    };
    let layout_is = if ours { "ours" } else { "stock's" };
    let peer = tcp.peer_addr().ok().map(tracing::field::display);
    tracing::info!(
        target: "yarp.carrier.shmem",
        layout = layout_is,
        peer,
        "a connection through shared memory"
    );
    Ok(ShmemStream::new(tcp, layout))
}

/// Returns the address of the initiator, if the acceptor is on the same machine: source and
/// destination of its connection.
fn same_machine(initiator: SocketAddr, acceptor: SocketAddr) -> io::Result<IpAddr> {
    let (ip, other) = (initiator.ip(), acceptor.ip());
    if ip == other || (ip.is_loopback() && other.is_loopback()) {
        return Ok(ip);
    }
    let text = format!("{ip} and {other} are different machines, which share no memory; use tcp");
    Err(io::Error::new(io::ErrorKind::Unsupported, text))
}

async fn in_time<T>(step: impl Future<Output = io::Result<T>>) -> io::Result<T> {
    tokio::time::timeout(HANDSHAKE_TIMEOUT, step)
        .await
        .map_err(|_| {
            let text = format!(
                "no handshake of shmem within {} s",
                HANDSHAKE_TIMEOUT.as_secs()
            );
            io::Error::new(io::ErrorKind::TimedOut, text)
        })?
}

async fn packet(tcp: &mut TcpStream) -> io::Result<[u8; PACKET]> {
    let mut packet = [0; PACKET];
    tcp.read_exact(&mut packet).await?;
    Ok(packet)
}

fn invalid(error: yarp_wire::shmem::ShmemError) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_machines_share_no_memory() {
        let check = |initiator: &str, acceptor: &str| {
            let address = |text: &str| SocketAddr::new(text.parse().unwrap(), 1);
            same_machine(address(initiator), address(acceptor))
        };
        assert!(check("10.0.0.1", "10.0.0.1").is_ok());
        assert!(check("127.0.0.1", "127.0.1.1").is_ok());
        let error = check("10.0.0.1", "10.0.0.2").unwrap_err().to_string();
        assert!(
            error.contains("10.0.0.2") && error.contains("tcp"),
            "{error}"
        );
    }
}
