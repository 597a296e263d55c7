//! Sending in datagrams.

use std::collections::VecDeque;
use std::io;

use bytes::Bytes;
use tokio::net::UdpSocket;
use yarp_wire::datagram;

use crate::cancel::Cancelled;
use crate::port::outbox::Outbox;

/// Room for what the system has not sent yet, in bytes; it may grant less.
const SEND_BUFFER: usize = 4 << 20;

/// A socket that sends to the port a reader has named.
pub(super) async fn socket(host: &str, number: i32) -> io::Result<UdpSocket> {
    let number = u16::try_from(number)
        .ok()
        .filter(|number| *number != 0)
        .ok_or_else(|| io::Error::other(format!("the reader has no datagram port ({number})")))?;
    let socket = UdpSocket::bind((std::net::Ipv4Addr::UNSPECIFIED, 0)).await?;
    // A smaller buffer only makes losses likelier.
    let _ = socket2::SockRef::from(&socket).set_send_buffer_size(SEND_BUFFER);
    socket.connect((host, number)).await?;
    Ok(socket)
}

/// Sends each message of the outbox, cut into datagrams, until it ends; tells why.
pub(super) async fn run(socket: &UdpSocket, outbox: &Outbox, mut cancelled: Cancelled) -> String {
    let mut messages: VecDeque<Bytes> = VecDeque::new();
    loop {
        outbox.take(&mut messages);
        for message in messages.drain(..) {
            for bytes in datagram::split(&message, datagram::LARGEST) {
                match socket.send(&bytes).await {
                    Ok(_) => {}
                    // Nobody listens there now, or the system has no room: this one is lost.
                    Err(error) => {
                        tracing::trace!("a datagram was not sent: {error}");
                        break;
                    }
                }
            }
            outbox.sent(message.len());
        }
        tokio::select! {
            () = outbox.filled.notified() => {
                if outbox.is_closed() {
                    return "closed here".to_owned();
                }
            }
            () = cancelled.cancelled() => return "the port closed".to_owned(),
        }
    }
}
