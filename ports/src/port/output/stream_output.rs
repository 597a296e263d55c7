//! Sending over the connection itself.

use std::io;
use std::sync::Arc;
use std::time::Instant;

use crate::cancel::Cancelled;
use crate::latency::{self, Batch, BusyPoll, Expecting, Optimisation, Yielder};
use crate::port::output::StopReason;
use crate::port::send_queue::SendQueue;
use crate::socket::{ReadBuffer, Socket};

/// The state of a sending connection besides its queue.
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
            // A thread woken by an answer is released where the answer is read.
            busy: BusyPoll::new(false),
        }
    }
}

/// Transfers bytes between socket and queue until either ends, or the connection moves; returns the
/// reason.
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
            Socket::Unix(_) if Optimisation::UnixWritePoll.is_enabled() => {
                write_polling(stream, send_queue, batch).await
            }
            Socket::Unix(_)
            | Socket::Tcp(_)
            | Socket::Shmem(_)
            | Socket::Datagrams(_)
            | Socket::Tls(_) => write_batch(stream, send_queue, batch),
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
                // The waiting writer may have more to send.
                tokio::task::yield_now().await;
            }
            Some(Err(error)) if error.kind() != io::ErrorKind::WouldBlock => {
                return StopReason::End(format!("reading failed: {error}"));
            }
            Some(Err(_)) | None => {}
        }
    }
}

/// Writes the batch as long as the socket accepts more of it within
/// [`latency::MAX_POLL_DURATION`]. Unix sockets report room late: a writer that sleeps until then
/// delays its reader.
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
        if batch.is_empty() || last.elapsed() >= latency::MAX_POLL_DURATION {
            return Ok(());
        }
        yielder.once().await;
    }
}

/// Sends the rest without waiting: the protocol may have queued an automatic answer, and browsers
/// report the answer to a close frame to the page.
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
