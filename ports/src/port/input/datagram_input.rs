//! An incoming connection whose messages come as datagrams.
//!
//! A datagram from another host than the header, or over `udp` from another port than the first one, is dropped.
//! The stream of the header is closed once the socket is there, as the writer closes it, too.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddrV4};
use std::sync::Arc;

use tokio::net::UdpSocket;
use yarp_wire::Limits;
use yarp_wire::connection::DatagramReassembler;
use yarp_wire::protocol::header_reply;

use super::{Connection, End, Next};
use crate::port::datagram_liveness;
use crate::port::socket_handle::SocketHandle;
use crate::socket::{self, Socket};
use crate::udp_socket::{self, Sources};

/// Receives datagrams and reassembles messages.
pub(super) struct Datagrams {
    pub(super) socket: Arc<UdpSocket>,
    sources: Sources,
    reader: DatagramReassembler,
}

impl Connection {
    /// Serves a datagram connection until the writer closes it, or is found to be gone.
    pub(super) async fn run_watched(&mut self, group: Option<SocketAddrV4>) -> End {
        if self.datagrams.is_none() && !self.slot.sends_datagrams() {
            return End::Full("too many send datagrams to this process");
        }
        let (port, from, meter) = (
            self.parts.context.clone(),
            self.from.clone(),
            self.meter.clone(),
        );
        let known = self.slot.known_writer();
        tokio::select! {
            // Received messages are served first.
            biased;
            end = self.run_datagrams(group) => end,
            reason = datagram_liveness::wait_until_gone(&port, &from, &meter, &known) => End::Gone(reason),
        }
    }

    /// Serves datagrams to the group, or to a socket whose port is sent to the peer. The peer
    /// closes the connection by a message to the port, or by another connection of the same name.
    async fn run_datagrams(&mut self, group: Option<SocketAddrV4>) -> End {
        let mut datagrams = match self.datagrams.take() {
            Some(datagrams) => datagrams,
            None => match self.open_datagrams(group).await {
                Ok(datagrams) => datagrams,
                Err(error) => return error.into(),
            },
        };
        loop {
            let Datagrams {
                socket,
                sources,
                reader,
            } = &mut *datagrams;
            let ready = tokio::select! {
                biased;
                () = self.closing.cancelled() => return End::Closed,
                ready = socket.readable() => ready,
                thread = self.control_receiver.thread(), if !self.moved => {
                    self.datagrams = Some(datagrams);
                    return End::Moved(thread);
                }
            };
            let dropped = reader.dropped();
            let mut foreign = false;
            let received = ready.and_then(|()| {
                udp_socket::receive(socket, |datagram, source| {
                    foreign = !sources.admit(socket, source);
                    match foreign {
                        true => Ok(None),
                        false => reader.receive(datagram),
                    }
                })
            });
            if foreign {
                self.meter.drop_one();
                continue;
            }
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
                    // Replies are impossible.
                    self.output.clear();
                }
                Err(error) => {
                    let from = &self.sender.name;
                    tracing::debug!(port = %self.parts.context.name, from, "a message is dropped: {error}");
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
            (Some(group), Some(IpAddr::V4(local))) => udp_socket::group_reader(group, local),
            (None, Some(IpAddr::V4(local))) => udp_socket::reader(local),
            _ => udp_socket::reader(Ipv4Addr::UNSPECIFIED),
        };
        let socket = Arc::new(socket?);
        self.set_socket(SocketHandle::of(&socket));
        if group.is_none() {
            let number = socket.local_addr().map_or(0, |address| address.port());
            header_reply(number, &mut self.output);
        }
        socket::write_all(&self.stream, &mut self.output).await?;
        // Not before the answer is sent: that is its end.
        self.stream = Arc::new(Socket::Datagrams(socket.clone()));
        let sources = match group {
            Some(_) => Sources::of_group(self.address),
            None => Sources::of_writer(self.address),
        };
        let reader = DatagramReassembler::new(self.acceptor.wire_version(), Limits::DEFAULT);
        Ok(Box::new(Datagrams {
            socket,
            sources,
            reader,
        }))
    }
}
