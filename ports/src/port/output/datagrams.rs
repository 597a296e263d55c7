//! Sending in datagrams.

use std::io::IoSlice;

use socket2::SockRef;
use tokio::io::Interest;
use tokio::net::UdpSocket;
use yarp_wire::datagram;

use crate::cancel::Cancelled;
use crate::port::batch::Messages;
use crate::port::outbox::Outbox;
use crate::port::output::Pause;

/// Sends each message of the outbox, cut into datagrams, until it ends, or the connection shall move;
/// tells why.
pub(super) async fn run(socket: &UdpSocket, outbox: &Outbox, cancelled: &mut Cancelled) -> Pause {
    let mut messages = Messages::default();
    loop {
        let moves = outbox.take_datagrams(&mut messages);
        for message in messages.iter() {
            for (header, data) in datagram::cut(message, datagram::LARGEST) {
                let parts = [IoSlice::new(&header), IoSlice::new(data)];
                let send = || SockRef::from(socket).send_vectored(&parts);
                match socket.async_io(Interest::WRITABLE, send).await {
                    Ok(_) => {}
                    // Nobody listens there now, or the system has no room: this one is lost.
                    Err(error) => {
                        tracing::trace!("a datagram was not sent: {error}");
                        outbox.count_dropped();
                        break;
                    }
                }
            }
            outbox.sent(message.len());
        }
        messages.clear();
        if moves {
            return Pause::Move;
        }
        tokio::select! {
            () = outbox.filled.notified() => {
                if outbox.is_closed() {
                    return Pause::End("closed here".to_owned());
                }
            }
            () = cancelled.cancelled() => return Pause::End("the port closed".to_owned()),
        }
    }
}
