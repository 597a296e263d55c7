//! Connections through memory that two processes on one machine share (carrier `shmem`).
//!
//! With a stock peer the segments, locks and handshake are stock's ([`yarp_wire::shmem`]). Between
//! two ports of this implementation the same segments hold a lock-free ring ([`lock_free_ring`]);
//! the two recognise each other by marks that stock ignores, and log the selected layout.
//!
//! No task ever blocks on the other process. A lock that is taken is retried later, and a
//! connection whose lock stays taken for [`LOCK_TIMEOUT`] is closed. Tasks wait on the TCP
//! connection of the handshake, which closes with the other process; with a stock peer, one thread
//! per connection also sleeps on its lock ([`lock_waiter`]), because tasks cannot wait on such a
//! lock.
//!
//! Names of segments and locks are removed as soon as both ends have opened them, so that a killed
//! process leaves nothing behind.

mod lock_free_ring;
mod lock_waiter;
mod process_lock;
mod shared_memory;
mod shmem_handshake;
mod shmem_segment;
#[cfg(test)]
mod shmem_tests;
mod stock_ring;

use std::io::{self, IoSlice};
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bytes::BufMut;
use tokio::net::TcpStream;

use lock_waiter::LockWaiter;
pub(crate) use shmem_handshake::{Offer, connect};

use crate::latency::{Optimisation, Yielder};

/// Maximum time for which the other end may hold a lock.
const LOCK_TIMEOUT: Duration = Duration::from_secs(if cfg!(test) { 1 } else { 5 });
/// Interval of polling for a lock, or for room without notification.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
/// Maximum duration of polling per wait; a wait shorter than [`BUSY_POLL_THRESHOLD`] makes the next
/// one poll.
const MAX_POLL_DURATION: Duration = Duration::from_micros(200);
const BUSY_POLL_THRESHOLD: Duration = Duration::from_micros(400);
/// Room that is worth writing into.
const MIN_WRITE_LEN: usize = 32 * 1024;

/// A stream of bytes in both directions.
#[derive(Debug)]
pub(crate) struct ShmemStream {
    /// Closes with the other process; in the lock-free layout a byte on it wakes the other end.
    tcp: TcpStream,
    layout: Layout,
    /// The TCP connection has closed: no more bytes will be written to the memory.
    ended: AtomicBool,
    /// Since when a lock has been found taken.
    lock_taken_since: Mutex<Option<Instant>>,
    reads_soon: AtomicBool,
    writes_soon: AtomicBool,
}

#[derive(Debug)]
enum Layout {
    Ours {
        reader: Mutex<lock_free_ring::Reader>,
        writer: Mutex<lock_free_ring::Writer>,
    },
    Stock {
        reader: Mutex<stock_ring::Reader>,
        writer: Mutex<stock_ring::Writer>,
        sleeper: LockWaiter,
        /// What the writer knows of its reader, without its lock: the other end has written, and so has opened everything.
        has_reader: AtomicBool,
    },
}

impl Layout {
    fn stock(reader: stock_ring::Reader, writer: stock_ring::Writer) -> io::Result<Self> {
        Ok(Self::Stock {
            sleeper: LockWaiter::new(reader.sleep())?,
            has_reader: AtomicBool::new(writer.has_reader()),
            reader: Mutex::new(reader),
            writer: Mutex::new(writer),
        })
    }
}

fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ShmemStream {
    fn new(tcp: TcpStream, layout: Layout) -> Self {
        Self {
            tcp,
            layout,
            ended: AtomicBool::new(false),
            lock_taken_since: Mutex::new(None),
            reads_soon: AtomicBool::new(false),
            writes_soon: AtomicBool::new(false),
        }
    }

    /// The TCP connection that goes with it.
    pub(crate) fn tcp(&self) -> &TcpStream {
        &self.tcp
    }

    /// Reads available bytes into the spare capacity of `buffer`; `Ok(0)` is the end.
    pub(crate) fn try_read_buf(&self, buffer: &mut impl BufMut) -> io::Result<usize> {
        let room = buffer.chunk_mut().len();
        self.try_read(buffer, room)
    }

    /// Reads up to `most` available bytes; `Ok(0)` is the end.
    pub(crate) fn try_read(&self, out: &mut impl BufMut, most: usize) -> io::Result<usize> {
        // Asked first: all that the other end wrote was there before it ended.
        let ended = self.ended.load(Relaxed);
        let read = match &self.layout {
            Layout::Ours { reader, .. } => held(reader).read(out, most, || self.wake()),
            Layout::Stock {
                reader,
                writer,
                has_reader,
                ..
            } => {
                let read = held(reader).read(out, most);
                if read.is_ok() && !has_reader.load(Relaxed) {
                    has_reader.store(true, Relaxed);
                    held(writer).reader_has_opened();
                }
                self.check_lock_timeout(read)
            }
        };
        match read {
            Err(error) if ended && error.kind() == io::ErrorKind::WouldBlock => Ok(0),
            read => read,
        }
    }

    /// Writes what fits.
    pub(crate) fn try_write_vectored(&self, chunks: &[IoSlice<'_>]) -> io::Result<usize> {
        if self.ended.load(Relaxed) {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        match &self.layout {
            Layout::Ours { writer, .. } => held(writer).write(chunks, || self.wake()),
            Layout::Stock { writer, .. } => self.check_lock_timeout(held(writer).write(chunks)),
        }
    }

    /// Waits until there is something to read, or the end.
    pub(crate) async fn readable(&self) -> io::Result<()> {
        if self
            .poll_for_a_while(&self.reads_soon, || self.can_read(false))
            .await?
        {
            return Ok(());
        }
        let begin = Instant::now();
        while !self.ended.load(Relaxed) && !self.can_read(true)? {
            match &self.layout {
                Layout::Ours { .. } => self.woken().await,
                Layout::Stock { reader, .. } if held(&self.lock_taken_since).is_some() => {
                    self.pause(|| held(reader).is_free()).await;
                }
                Layout::Stock { sleeper, .. } => tokio::select! {
                    () = sleeper.sleep() => {}
                    () = self.woken() => {}
                },
            }
        }
        self.reads_soon
            .store(begin.elapsed() < BUSY_POLL_THRESHOLD, Relaxed);
        Ok(())
    }

    /// Waits until writing may be worth another try.
    pub(crate) async fn writable(&self) -> io::Result<()> {
        let writer = match &self.layout {
            Layout::Ours { writer, .. } => writer,
            Layout::Stock { writer, .. } => {
                // A stock reader does not say that it has read.
                self.pause(|| held(writer).seems_ready()).await;
                return Ok(());
            }
        };
        let room = |sleeps| {
            let writer = held(writer);
            if sleeps {
                writer.will_sleep();
            }
            Ok(writer.free()? >= MIN_WRITE_LEN)
        };
        if self
            .poll_for_a_while(&self.writes_soon, || room(false))
            .await?
        {
            return Ok(());
        }
        let begin = Instant::now();
        while !self.ended.load(Relaxed) && !room(true)? {
            self.woken().await;
        }
        self.writes_soon
            .store(begin.elapsed() < BUSY_POLL_THRESHOLD, Relaxed);
        Ok(())
    }

    /// Polls for a while, yielding between polls; then sleeps briefly.
    async fn pause(&self, ready: impl Fn() -> bool) {
        let begin = Instant::now();
        let mut yielder = Yielder::midway();
        while begin.elapsed() < BUSY_POLL_THRESHOLD {
            if ready() {
                return;
            }
            yielder.once().await;
        }
        tokio::time::sleep(POLL_INTERVAL).await;
    }

    fn can_read(&self, sleeps: bool) -> io::Result<bool> {
        match &self.layout {
            Layout::Ours { reader, .. } => {
                let reader = held(reader);
                if sleeps {
                    reader.will_sleep();
                }
                Ok(reader.waiting()? > 0)
            }
            Layout::Stock { reader, .. } if !sleeps => {
                let reader = held(reader);
                Ok(reader.seems_ready() && reader.is_free())
            }
            Layout::Stock { reader, .. } => {
                match self.check_lock_timeout(held(reader).is_ready()) {
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(false),
                    ready => ready,
                }
            }
        }
    }

    /// Polls for a while if the last wait was short, yielding between polls.
    async fn poll_for_a_while(
        &self,
        soon: &AtomicBool,
        ready: impl Fn() -> io::Result<bool>,
    ) -> io::Result<bool> {
        if ready()? {
            return Ok(true);
        }
        let begin = Instant::now();
        let mut yielder = Yielder::midway();
        while soon.load(Relaxed)
            && Optimisation::ShmemPoll.is_enabled()
            && begin.elapsed() < MAX_POLL_DURATION
        {
            yielder.once().await;
            if ready()? {
                return Ok(true);
            }
        }
        soon.store(false, Relaxed);
        Ok(false)
    }

    /// Converts a taken lock to `WouldBlock`, until the timeout expires.
    fn check_lock_timeout<T>(&self, result: io::Result<T>) -> io::Result<T> {
        let mut lock_taken_since = held(&self.lock_taken_since);
        match result {
            Err(error) if error.kind() == io::ErrorKind::ResourceBusy => {
                let since = lock_taken_since.get_or_insert_with(Instant::now);
                if since.elapsed() < LOCK_TIMEOUT {
                    return Err(io::ErrorKind::WouldBlock.into());
                }
                let text = "the other end of shmem has held the lock of the shared memory for ";
                let text = format!(
                    "{text}{} s; it may have been stopped",
                    LOCK_TIMEOUT.as_secs()
                );
                Err(io::Error::new(io::ErrorKind::TimedOut, text))
            }
            result => {
                *lock_taken_since = None;
                result
            }
        }
    }

    /// Wakes the other end. If the byte finds no room, there are unread ones already.
    fn wake(&self) {
        let _ = self.tcp.try_write(&[0]);
    }

    /// Waits for the other end to wake this one, or to close. May return spuriously: another
    /// waiting task may have consumed the byte, and then the change is already visible.
    async fn woken(&self) {
        let readable = self.tcp.readable().await;
        let read = readable.and_then(|()| self.tcp.try_read(&mut [0; 64]));
        let ended = match read {
            Ok(length) => length == 0,
            Err(error) => error.kind() != io::ErrorKind::WouldBlock,
        };
        if ended {
            self.ended.store(true, Relaxed);
        }
    }
}
