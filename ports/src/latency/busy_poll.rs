//! Busy polling for bytes that are expected soon.
//!
//! Waking a sleeping thread costs more than all other work in a round trip of small messages. So a
//! connection whose last bytes arrived within [`BUSY_POLL_THRESHOLD`] polls for the next ones for
//! up to [`MAX_POLL_DURATION`] before it sleeps, yielding between polls ([`Yielder`]); meanwhile,
//! arriving bytes wake no other thread ([`Socket::suppress_wakeups`]). An idle connection, or one
//! with a slow peer, sleeps at once.
//!
//! Small unrequested messages that follow each other are left in the socket briefly, so that
//! several are read together: each poll disturbs their writer. If many bytes arrive nevertheless,
//! from a writer that sends several messages at once, the interval is spent polling
//! ([`GATHER_INTERVAL`]); if few arrive, from a writer that sends each message by itself, the
//! thread sleeps ([`GATHER_SLEEP`]), because even a polling thread slows that writer. Only one
//! connection of the process does so at a time.

use std::io;
use std::mem;
use std::sync::LazyLock;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicU64, AtomicUsize};
use std::thread;
use std::time::{Duration, Instant};

use super::Optimisation;
use crate::socket::{ReadBuffer, Socket};

/// Maximum duration of polling per wait, also for a writer that waits for room.
pub(crate) const MAX_POLL_DURATION: Duration = Duration::from_micros(60);
/// A wait shorter than this makes the next one poll.
const BUSY_POLL_THRESHOLD: Duration = Duration::from_micros(120);
/// Duration for which unrequested messages are left in the socket.
const GATHER_INTERVAL: Duration = Duration::from_micros(20);
/// The same for a sleeping thread: the system makes 50 to 70 µs of it.
const GATHER_SLEEP: Duration = Duration::from_micros(1);
/// Rate below which a connection counts as slow, in bytes per microsecond.
const TRICKLE_BYTES_PER_MICROSECOND: u128 = 100;
/// A longer yield indicates that a compute-bound program shares the processor.
const CONTENDED_YIELD: Duration = Duration::from_millis(1);
/// Time without yielding to other programs after that.
const YIELD_HOLDOFF: Duration = Duration::from_millis(20);
/// Interval between yields to other tasks, while at most [`MAX_EXCLUSIVE_POLLERS`] connections
/// poll.
const TASK_YIELD_INTERVAL: Duration = Duration::from_micros(10);
/// Two connections, one in each direction.
const MAX_EXCLUSIVE_POLLERS: usize = 2;
/// Minimum and maximum length of one read.
const MIN_READ_LEN: usize = 4 * 1024;
const MAX_READ_LEN: usize = 64 * 1024;

/// Number of polling connections of this process.
static POLLING: AtomicUsize = AtomicUsize::new(0);

/// The polling state of a connection.
#[derive(Debug)]
pub(crate) struct BusyPoll {
    /// `true` if received messages wake other tasks.
    wakes: bool,
    polling: Option<PollingGuard>,
    /// Length of the next read; grows while reads are filled.
    chunk: usize,
    sleeping_since: Option<Instant>,
    /// `true` if the last message was large: the next is worth reading at once.
    large: bool,
    /// `true` if few bytes arrived until the last poll.
    is_slow: bool,
}

/// One of those that wait awake.
#[derive(Debug)]
struct PollingGuard;

/// The reason to expect bytes from the peer.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Expecting {
    /// It is its turn: it was answered, or is to answer.
    Answer,
    /// It sends when it likes.
    Anything,
}

impl BusyPoll {
    /// Creates the state of a new connection. If its messages wake tasks (`wakes`), it yields to
    /// them first.
    pub(crate) fn new(wakes: bool) -> Self {
        Self {
            wakes,
            polling: None,
            chunk: MIN_READ_LEN,
            sleeping_since: None,
            large: false,
            is_slow: false,
        }
    }

    /// Polls for bytes while it is worth it; `None` means to sleep.
    pub(crate) async fn read(
        &mut self,
        stream: &Socket,
        input: &mut ReadBuffer,
        expecting: Expecting,
    ) -> Option<io::Result<usize>> {
        let begin = Instant::now();
        if self.polling.is_some() {
            let large = mem::take(&mut self.large);
            if !large {
                stream.suppress_wakeups();
            }
            input.reserve(self.chunk);
            let buffer = &mut input.bytes;
            let length = buffer.len();
            buffer.resize(length + self.chunk, 0);
            let alone = POLLING.load(Relaxed) == 1;
            let gathers = expecting == Expecting::Anything && !large && alone;
            if gathers && Optimisation::Gather.is_enabled() {
                tokio::task::yield_now().await;
                if self.is_slow {
                    thread::sleep(GATHER_SLEEP);
                }
                while begin.elapsed() < GATHER_INTERVAL {
                    std::hint::spin_loop();
                }
            }
            let awake = Instant::now();
            let mut yielder = match self.wakes {
                true => Yielder::after_waking(),
                false => Yielder::midway(),
            };
            while awake.elapsed() < MAX_POLL_DURATION {
                match stream.peek_now(&mut buffer[length..]) {
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                        yielder.once().await;
                    }
                    read => {
                        let count = *read.as_ref().unwrap_or(&0);
                        self.is_slow = (count as u128)
                            < TRICKLE_BYTES_PER_MICROSECOND * begin.elapsed().as_micros();
                        buffer.truncate(length + count);
                        self.chunk = match count == self.chunk {
                            true => (4 * self.chunk).min(MAX_READ_LEN),
                            false => (self.chunk / 2).max(MIN_READ_LEN),
                        };
                        return Some(read);
                    }
                }
            }
            buffer.truncate(length);
            self.polling = None;
        }
        self.sleeping_since = Some(begin);
        None
    }

    /// Takes note that so much of a message is missing.
    pub(crate) fn misses(&mut self, bytes: usize) {
        self.large |= bytes > MAX_READ_LEN;
    }

    /// Takes note that bytes came.
    pub(crate) fn received(&mut self) {
        if let Some(since) = self.sleeping_since.take() {
            let polls =
                since.elapsed() < BUSY_POLL_THRESHOLD && Optimisation::BusyPoll.is_enabled();
            self.polling = polls.then(PollingGuard::new);
        }
    }
}

/// Yields the processor between two polls: to other programs each time, to other tasks at first and
/// then every [`TASK_YIELD_INTERVAL`], or each time if many connections poll.
///
/// The system tends to wake the peer on the processor of the thread that woke it, where it would
/// wait for the polling thread. Beside compute-bound programs, yielding takes milliseconds: then no
/// thread yields to programs for a while. Another thread of the runtime takes over a task that
/// yields and wakes the next: too expensive for every poll.
#[derive(Debug)]
pub(crate) struct Yielder {
    /// Time of the last yield to tasks; `None` before the first.
    tasks: Option<Instant>,
}

impl Yielder {
    /// Creates a yielder that yields to tasks first, which may have been woken.
    pub(crate) fn after_waking() -> Self {
        Self { tasks: None }
    }

    /// Creates a yielder for a thread in the middle of its work.
    pub(crate) fn midway() -> Self {
        Self {
            tasks: Some(Instant::now()),
        }
    }

    /// Gives way for a moment.
    pub(crate) async fn once(&mut self) {
        static BEGIN: LazyLock<Instant> = LazyLock::new(Instant::now);
        /// Microseconds since `BEGIN`.
        static HOLDOFF_UNTIL: AtomicU64 = AtomicU64::new(0);
        let since_begin = |time: Instant| u64::try_from((time - *BEGIN).as_micros()).unwrap_or(0);
        let before = Instant::now();
        if Optimisation::Yield.is_enabled() && since_begin(before) >= HOLDOFF_UNTIL.load(Relaxed) {
            thread::yield_now();
            let after = Instant::now();
            if after - before > CONTENDED_YIELD {
                HOLDOFF_UNTIL.store(since_begin(after + YIELD_HOLDOFF), Relaxed);
            }
        }
        let many = POLLING.load(Relaxed) > MAX_EXCLUSIVE_POLLERS;
        if many
            || self
                .tasks
                .is_none_or(|last| before - last >= TASK_YIELD_INTERVAL)
        {
            tokio::task::yield_now().await;
            self.tasks = Some(Instant::now());
        }
    }
}

impl PollingGuard {
    fn new() -> Self {
        POLLING.fetch_add(1, Relaxed);
        Self
    }
}

impl Drop for PollingGuard {
    fn drop(&mut self) {
        POLLING.fetch_sub(1, Relaxed);
    }
}
