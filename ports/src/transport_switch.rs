//! The switch of an initiator to another transport after the header.

use std::io;

use yarp_wire::carrier::Transport;
use yarp_wire::connection::{Initiator, REFUSAL};

use crate::socket::{ReadBuffer, Socket};
use crate::{shmem, unix_socket};

/// Switches to the transport of this carrier's messages, if that is a stream.
///
/// `input` holds the bytes received after the header reply.
pub(crate) async fn switch_transport(
    header: Socket,
    input: ReadBuffer,
    initiator: &Initiator,
) -> io::Result<(Socket, ReadBuffer)> {
    let moved = match (initiator.carrier().transport, header.tcp()) {
        (Transport::UnixSocket, Some(stream)) => {
            let mut answer = [0; 8];
            let connected = unix_socket::connect(stream, &mut answer).await;
            // There is no header reply that could have refused it.
            if connected.is_err() && refuses(&answer) {
                return Err(refusal(initiator));
            }
            Socket::Unix(connected?)
        }
        (Transport::SharedMemory, Some(stream)) => {
            let number = next_port(initiator)?;
            Socket::Shmem(Box::new(shmem::connect(stream, number).await?))
        }
        _ => return Ok((header, input)),
    };
    Ok((moved, ReadBuffer::default()))
}

/// Returns the port that the acceptor named for the next transport.
pub(crate) fn next_port(initiator: &Initiator) -> io::Result<u16> {
    let number = initiator.header_number();
    u16::try_from(number)
        .ok()
        .filter(|number| *number != 0)
        .ok_or_else(|| {
            let text = format!("the reader names no port to go on with ({number})");
            io::Error::new(io::ErrorKind::InvalidData, text)
        })
}

/// Returns whether these first bytes of an answer mean that the acceptor lacks the carrier.
pub(crate) fn refuses(answer: &[u8]) -> bool {
    answer.len() >= 8 && REFUSAL.as_bytes().starts_with(&answer[..8])
}

/// Returns the error of an acceptor that has no such carrier.
pub(crate) fn refusal(initiator: &Initiator) -> io::Error {
    let carrier = initiator.carrier();
    let text = format!("it has no carrier {carrier}; tcp and fast_tcp are always there");
    io::Error::new(io::ErrorKind::Unsupported, text)
}
