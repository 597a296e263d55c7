//! Sending in datagrams.

use std::io::IoSlice;

use socket2::SockRef;
use tokio::io::Interest;
use tokio::net::UdpSocket;
use yarp_wire::datagram;

use crate::cancel::Cancelled;
use crate::latency::DatagramBatch;
use crate::port::output::StopReason;
use crate::port::send_queue::SendQueue;

/// Sends each queued message, split into datagrams, until the connection closes or moves; returns
/// the reason.
pub(super) async fn run(
    socket: &UdpSocket,
    send_queue: &SendQueue,
    cancelled: &mut Cancelled,
) -> StopReason {
    let mut messages = DatagramBatch::default();
    loop {
        let moves = send_queue.take_datagrams(&mut messages);
        for message in messages.iter() {
            for (header, data) in datagram::cut(message, datagram::MAX_DATAGRAM_LEN) {
                let parts = [IoSlice::new(&header), IoSlice::new(data)];
                let send = || SockRef::from(socket).send_vectored(&parts);
                match socket.async_io(Interest::WRITABLE, send).await {
                    Ok(_) => {}
                    // There is no listener now, or the system has no buffers: this datagram is
                    // lost.
                    Err(error) => {
                        tracing::trace!("a datagram was not sent: {error}");
                        send_queue.count_dropped();
                        break;
                    }
                }
            }
            send_queue.sent(message.len());
        }
        messages.clear();
        if moves {
            return StopReason::Move;
        }
        tokio::select! {
            () = send_queue.filled.notified() => {
                if send_queue.is_closed() {
                    return StopReason::End("closed here".to_owned());
                }
            }
            () = cancelled.cancelled() => return StopReason::End("the port closed".to_owned()),
        }
    }
}
