//! Sending over the connection itself.

use std::io;
use std::sync::Arc;
use std::time::Instant;

use crate::busy_poll::{self, BusyPoll, Expecting, Yielder};
use crate::cancel::Cancelled;
use crate::port::output::StopReason;
use crate::port::send_queue::SendQueue;
use crate::port::write_batch::Batch;
use crate::socket::{ReadBuffer, Socket};

/// What a connection has besides its outbox.
pub(super) struct Sending {
    pub(super) stream: Arc<Socket>,
    input: ReadBuffer,
    batch: Batch,
    busy: BusyPoll,
}

impl Sending {
    pub(super) fn new(stream: Arc<Socket>, input: ReadBuffer) -> Self {
        Self {
            stream,
            input,
            batch: Batch::default(),
            // Who is woken by an answer is let go where it is read.
            busy: BusyPoll::new(false),
        }
    }
}

/// Moves bytes between socket and outbox until either ends, or the connection shall move; tells why.
pub(super) async fn run(
    sending: &mut Sending,
    send_queue: &SendQueue,
    cancelled: &mut Cancelled,
) -> StopReason {
    let Sending {
        stream,
        input,
        batch,
        busy,
    } = sending;
    loop {
        if batch.is_empty() && send_queue.take(batch) {
            return StopReason::Move;
        }
        let written = match **stream {
            Socket::Unix(_) => write_polling(stream, send_queue, batch).await,
            Socket::Tcp(_) | Socket::Shmem(_) => write_batch(stream, send_queue, batch),
        };
        if let Err(error) = written {
            return StopReason::End(format!("writing failed: {error}"));
        }
        let mut read = None;
        if batch.is_empty() && send_queue.awaits_answer() {
            read = busy.read(stream, input, Expecting::Answer).await;
        }
        if read.is_none() {
            tokio::select! {
                biased;
                ready = stream.readable() => {
                    read = Some(ready.and_then(|()| input.try_read(stream, 0)));
                }
                ready = stream.writable(), if !batch.is_empty() => {
                    if let Err(error) = ready {
                        return StopReason::End(format!("writing failed: {error}"));
                    }
                }
                () = send_queue.filled.notified(), if batch.is_empty() => {
                    if send_queue.is_closed() {
                        return StopReason::End("closed here".to_owned());
                    }
                }
                () = cancelled.cancelled() => return StopReason::End("the port closed".to_owned()),
            }
        }
        match read {
            Some(Ok(0)) => return StopReason::End("the reader closed it".to_owned()),
            Some(Ok(_)) => {
                busy.received();
                if let Err(error) = send_queue.receive(&mut input.bytes) {
                    send_rest(stream, send_queue, batch);
                    return StopReason::End(format!("protocol: {error}"));
                }
                // Who waited for it may have more to send.
                tokio::task::yield_now().await;
            }
            Some(Err(error)) if error.kind() != io::ErrorKind::WouldBlock => {
                return StopReason::End(format!("reading failed: {error}"));
            }
            Some(Err(_)) | None => {}
        }
    }
}

/// Writes the batch as long as no more than [`busy_poll::MAX_POLL_DURATION`] passes until the socket takes more of it.
/// Sockets of the file system tell late of room: a writer that sleeps until then keeps its reader
/// waiting.
async fn write_polling(
    stream: &Socket,
    send_queue: &SendQueue,
    batch: &mut Batch,
) -> io::Result<()> {
    let mut last = Instant::now();
    let mut yielder = Yielder::midway();
    loop {
        let before = batch.len();
        write_batch(stream, send_queue, batch)?;
        if batch.len() < before {
            last = Instant::now();
            yielder = Yielder::midway();
        }
        if batch.is_empty() || last.elapsed() >= busy_poll::MAX_POLL_DURATION {
            return Ok(());
        }
        yielder.once().await;
    }
}

/// Sends what is left, as far as that goes without waiting: the protocol itself may have answered, and browsers
/// tell pages of an answer to their goodbye.
fn send_rest(stream: &Socket, send_queue: &SendQueue, batch: &mut Batch) {
    // It may be gone already.
    let begun = write_batch(stream, send_queue, batch);
    if begun.is_ok() && batch.is_empty() {
        send_queue.take(batch);
        let _ = write_batch(stream, send_queue, batch);
    }
}

/// Writes as much of the batch as the socket takes now.
fn write_batch(stream: &Socket, send_queue: &SendQueue, batch: &mut Batch) -> io::Result<()> {
    batch.write_to(stream, |written| send_queue.sent(written))
}
