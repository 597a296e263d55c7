//! Sending over the connection itself.

use std::io;
use std::sync::Arc;
use std::time::Instant;

use crate::busy::{self, BusyPoll, Expecting, GivingWay};
use crate::cancel::Cancelled;
use crate::port::batch::Batch;
use crate::port::outbox::Outbox;
use crate::port::output::Pause;
use crate::stream::{Inflow, Socket};

/// What a connection has besides its outbox.
pub(super) struct Sending {
    pub(super) stream: Arc<Socket>,
    input: Inflow,
    batch: Batch,
    busy: BusyPoll,
}

impl Sending {
    pub(super) fn new(stream: Arc<Socket>, input: Inflow) -> Self {
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
    outbox: &Outbox,
    cancelled: &mut Cancelled,
) -> Pause {
    let Sending {
        stream,
        input,
        batch,
        busy,
    } = sending;
    loop {
        if batch.is_empty() && outbox.take(batch) {
            return Pause::Move;
        }
        let written = match **stream {
            Socket::Unix(_) => write_awake(stream, outbox, batch).await,
            Socket::Tcp(_) | Socket::Shmem(_) => write_batch(stream, outbox, batch),
        };
        if let Err(error) = written {
            return Pause::End(format!("writing failed: {error}"));
        }
        let mut read = None;
        if batch.is_empty() && outbox.awaits_answer() {
            read = busy.read(stream, input, Expecting::Turn).await;
        }
        if read.is_none() {
            tokio::select! {
                biased;
                ready = stream.readable() => {
                    read = Some(ready.and_then(|()| input.try_read(stream, 0)));
                }
                ready = stream.writable(), if !batch.is_empty() => {
                    if let Err(error) = ready {
                        return Pause::End(format!("writing failed: {error}"));
                    }
                }
                () = outbox.filled.notified(), if batch.is_empty() => {
                    if outbox.is_closed() {
                        return Pause::End("closed here".to_owned());
                    }
                }
                () = cancelled.cancelled() => return Pause::End("the port closed".to_owned()),
            }
        }
        match read {
            Some(Ok(0)) => return Pause::End("the reader closed it".to_owned()),
            Some(Ok(_)) => {
                busy.received();
                if let Err(error) = outbox.receive(&mut input.bytes) {
                    say_rest(stream, outbox, batch);
                    return Pause::End(format!("protocol: {error}"));
                }
                // Who waited for it may have more to send.
                tokio::task::yield_now().await;
            }
            Some(Err(error)) if error.kind() != io::ErrorKind::WouldBlock => {
                return Pause::End(format!("reading failed: {error}"));
            }
            Some(Err(_)) | None => {}
        }
    }
}

/// Writes the batch as long as no more than [`busy::LIMIT`] passes until the socket takes more of it.
/// Sockets of the file system tell late of room: a writer that sleeps until then keeps its reader
/// waiting.
async fn write_awake(stream: &Socket, outbox: &Outbox, batch: &mut Batch) -> io::Result<()> {
    let mut last = Instant::now();
    let mut giving_way = GivingWay::midway();
    loop {
        let before = batch.len();
        write_batch(stream, outbox, batch)?;
        if batch.len() < before {
            last = Instant::now();
            giving_way = GivingWay::midway();
        }
        if batch.is_empty() || last.elapsed() >= busy::LIMIT {
            return Ok(());
        }
        giving_way.once().await;
    }
}

/// Sends what is left, as far as that goes without waiting: the protocol itself may have answered, and browsers
/// tell pages of an answer to their goodbye.
fn say_rest(stream: &Socket, outbox: &Outbox, batch: &mut Batch) {
    // It may be gone already.
    let begun = write_batch(stream, outbox, batch);
    if begun.is_ok() && batch.is_empty() {
        outbox.take(batch);
        let _ = write_batch(stream, outbox, batch);
    }
}

/// Writes as much of the batch as the socket takes now.
fn write_batch(stream: &Socket, outbox: &Outbox, batch: &mut Batch) -> io::Result<()> {
    batch.write_to(stream, |written| outbox.sent(written))
}
