//! One outgoing connection.

use std::collections::VecDeque;
use std::io::{self, IoSlice};
use std::sync::Arc;
use std::time::Duration;

use bytes::{Buf, Bytes, BytesMut};
use tokio::net::TcpStream;
use tokio::task::JoinHandle;
use yarp_wire::carrier::{Carrier, CarrierSpec, Framing, Sender};
use yarp_wire::connection::{Initiator, Progress};
use yarp_wire::message::Command;
use yarp_wire::{Dialect, Limits};

use super::outbox::Outbox;
use crate::busy::BusyPoll;
use crate::cancel::Cancelled;
use crate::error::PortError;
use crate::stream::{self, Inflow};

/// A connection that the port writes to.
#[derive(Debug)]
pub(crate) struct Output {
    /// The name of the reader.
    pub(crate) to: String,
    /// Carrier string as the connection was asked for.
    pub(crate) carrier_text: String,
    pub(crate) carrier: &'static Carrier,
    /// The generation of the reader.
    pub(crate) dialect: Dialect,
    pub(crate) outbox: Arc<Outbox>,
    task: JoinHandle<()>,
}

/// Buffers handed to one system call.
const VECTORS: usize = 16;

impl Output {
    /// Connects as `from` to a reader at `host:port` and waits until it has answered the header.
    pub(crate) async fn connect(
        from: &str,
        to: &str,
        (host, port): (&str, u16),
        spec: &CarrierSpec,
        carrier: &'static Carrier,
        dialect: Dialect,
        deadline: Duration,
        cancelled: Cancelled,
    ) -> Result<Self, PortError> {
        let opening = async {
            let stream = stream::connect(to, host, port, deadline).await?;
            let mut output = BytesMut::new();
            let sender = Sender {
                name: from.to_owned(),
                modifiers: spec.modifiers.clone(),
            };
            let mut initiator =
                Initiator::new(carrier, &sender, dialect, Limits::DEFAULT, &mut output);
            let lost = |error: io::Error| {
                PortError::connect(to, format!("{host}:{port}"), "connection header", error)
            };
            stream::write_all(&stream, &mut output)
                .await
                .map_err(lost)?;
            let mut input = Inflow::default();
            loop {
                let progress =
                    initiator
                        .poll(&mut input.bytes)
                        .map_err(|source| PortError::Protocol {
                            peer: to.to_owned(),
                            source,
                        })?;
                if progress == Some(Progress::Ready) {
                    return Ok((stream, initiator, input));
                }
                let count = input.read(&stream, 0).await.map_err(lost)?;
                if count == 0 {
                    return Err(lost(io::ErrorKind::UnexpectedEof.into()));
                }
            }
        };
        let (stream, initiator, input) =
            stream::within(deadline, to, "connection header", opening).await?;
        Ok(Self::start(
            to,
            spec.to_string(),
            stream,
            initiator,
            input,
            cancelled,
        ))
    }

    /// Takes over a connection whose header is done with.
    pub(crate) fn start(
        to: &str,
        carrier_text: String,
        stream: TcpStream,
        initiator: Initiator,
        input: Inflow,
        cancelled: Cancelled,
    ) -> Self {
        let carrier = initiator.carrier();
        let dialect = initiator.dialect();
        let outbox = Arc::new(Outbox::new(initiator));
        let peer = to.to_owned();
        let shared = outbox.clone();
        let task = tokio::spawn(async move {
            let reason = run(&stream, &shared, input, cancelled).await;
            tracing::debug!(peer, reason, "output connection ended");
            shared.close(&reason);
        });
        Self {
            to: to.to_owned(),
            carrier_text,
            carrier,
            dialect,
            outbox,
            task,
        }
    }

    /// Whether payloads go out in text.
    pub(crate) fn is_text(&self) -> bool {
        self.carrier.framing != Framing::Indexed
    }

    /// Says goodbye and ends the connection; waits for the reader at most until `deadline`.
    pub(crate) async fn close(&self, deadline: Duration) {
        let goodbye = async {
            if let Ok(Some(done)) = self.outbox.push(&Command::Quit, &Bytes::new(), true) {
                let _ = done.await;
            }
            let _ = self.outbox.drained().await;
        };
        // A reader that does not answer in time is left.
        let _ = tokio::time::timeout(deadline, goodbye).await;
        self.outbox.close("closed here");
        self.task.abort();
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        self.outbox.close("closed here");
        self.task.abort();
    }
}

/// Moves bytes between socket and outbox until either ends; tells why.
async fn run(
    stream: &TcpStream,
    outbox: &Outbox,
    mut input: Inflow,
    mut cancelled: Cancelled,
) -> String {
    let mut batch: VecDeque<Bytes> = VecDeque::new();
    let mut busy = BusyPoll::new();
    loop {
        if batch.is_empty() {
            outbox.take(&mut batch);
        }
        match write_batch(stream, outbox, &mut batch) {
            Ok(()) => {}
            Err(error) => return format!("writing failed: {error}"),
        }
        let mut read = None;
        if batch.is_empty() && outbox.awaits_answer() {
            read = busy.read(stream, &mut input.bytes).await;
        }
        if read.is_none() {
            tokio::select! {
            biased;
            ready = stream.readable() => {
                read = Some(ready.and_then(|()| input.try_read(stream, 0)));
            }
            ready = stream.writable(), if !batch.is_empty() => {
                if let Err(error) = ready {
                    return format!("writing failed: {error}");
                }
            }
            () = outbox.filled.notified(), if batch.is_empty() => {
                if outbox.is_closed() {
                    return "closed here".to_owned();
                }
            }
            () = cancelled.cancelled() => return "the port closed".to_owned(),
            }
        }
        match read {
            Some(Ok(0)) => return "the reader closed it".to_owned(),
            Some(Ok(_)) => {
                busy.received();
                if let Err(error) = outbox.receive(&mut input.bytes) {
                    return format!("protocol: {error}");
                }
            }
            Some(Err(error)) if error.kind() != io::ErrorKind::WouldBlock => {
                return format!("reading failed: {error}");
            }
            Some(Err(_)) | None => {}
        }
    }
}

/// Writes as much of the batch as the socket takes now.
fn write_batch(stream: &TcpStream, outbox: &Outbox, batch: &mut VecDeque<Bytes>) -> io::Result<()> {
    while !batch.is_empty() {
        let mut vectors = [IoSlice::new(&[]); VECTORS];
        let used = batch.len().min(VECTORS);
        for (vector, chunk) in vectors.iter_mut().zip(batch.iter()) {
            *vector = IoSlice::new(chunk);
        }
        let mut written = match stream.try_write_vectored(&vectors[..used]) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(written) => written,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
            Err(error) => return Err(error),
        };
        outbox.sent(written);
        while let Some(front) = batch.front_mut() {
            let taken = front.len().min(written);
            front.advance(taken);
            written -= taken;
            if !front.is_empty() {
                break;
            }
            batch.pop_front();
        }
    }
    Ok(())
}
