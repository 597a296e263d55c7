//! Waiting awake for bytes that are about to come.
//!
//! Waking a sleeping thread costs more than all else in a round trip of small messages. So a
//! connection whose last bytes came within [`BUSY_POLL_THRESHOLD`] looks for the next ones itself for up to
//! [`MAX_POLL_DURATION`] before it goes to sleep, giving way to others between looks ([`Yielder`]); what comes meanwhile
//! wakes nobody else ([`Socket::suppress_wakeups`]). A connection at rest, or with a slow peer, sleeps at once.
//!
//! Small messages that come by themselves, one behind the other, are left a moment to become several: each look
//! disturbs their writer. Where much comes nevertheless, from a writer that sends several at once, the moment is spent awake
//! ([`GATHER_INTERVAL`]); where little comes, from one that hands over each by itself, asleep ([`GATHER_SLEEP`]), for even somebody who merely
//! stays awake makes that dearer. Only one connection of the process does so at a time.

use std::io;
use std::mem;
use std::sync::LazyLock;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicU64, AtomicUsize};
use std::thread;
use std::time::{Duration, Instant};

use crate::socket::{ReadBuffer, Socket};

/// Longest time awake per wait, also of a writer for room.
pub(crate) const MAX_POLL_DURATION: Duration = Duration::from_micros(60);
/// A wait this short makes the next one be spent awake.
const BUSY_POLL_THRESHOLD: Duration = Duration::from_micros(120);
/// How long messages that were not asked for are left alone.
const GATHER_INTERVAL: Duration = Duration::from_micros(20);
/// The same, asleep: the system makes 50 to 70 µs of it.
const GATHER_SLEEP: Duration = Duration::from_micros(1);
/// Bytes per microsecond that are little.
const TRICKLE_BYTES_PER_MICROSECOND: u128 = 100;
/// Who gave way for longer has met a program that calculates.
const CONTENDED_YIELD: Duration = Duration::from_millis(1);
/// For how long nobody gives way to programs then.
const YIELD_HOLDOFF: Duration = Duration::from_millis(20);
/// How long other tasks wait for one that is awake, while no more than [`MAX_EXCLUSIVE_POLLERS`] are.
const TASK_YIELD_INTERVAL: Duration = Duration::from_micros(10);
/// Connections, one in each direction.
const MAX_EXCLUSIVE_POLLERS: usize = 2;
/// Bytes read in one look, at first and at most.
const MIN_READ_LEN: usize = 4 * 1024;
const MAX_READ_LEN: usize = 64 * 1024;

/// Connections of this process that wait awake.
static POLLING: AtomicUsize = AtomicUsize::new(0);

/// Whether a connection waits awake.
#[derive(Debug)]
pub(crate) struct BusyPoll {
    /// Whether what comes wakes tasks.
    wakes: bool,
    polling: Option<PollingGuard>,
    /// Bytes to read in the next look; grows while looks are filled.
    chunk: usize,
    sleeping_since: Option<Instant>,
    /// Whether the last message was a large one: the next is worth beginning with at once.
    large: bool,
    /// Whether little came until the last look.
    is_slow: bool,
}

/// One of those that wait awake.
#[derive(Debug)]
struct PollingGuard;

/// Why the peer will send something.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Expecting {
    /// It is its turn: it was answered, or is to answer.
    Answer,
    /// It sends when it likes.
    Anything,
}

impl BusyPoll {
    /// A connection that has seen nothing yet. Where what comes on it `wakes` tasks, they are let go first.
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

    /// Looks for bytes while it is worth it; `None` says to go to sleep.
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
            if expecting == Expecting::Anything && !large && alone {
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
            self.polling = (since.elapsed() < BUSY_POLL_THRESHOLD).then(PollingGuard::new);
        }
    }
}

/// Lets others have this processor between two looks: programs each time, other tasks at first and then every
/// [`TASK_YIELD_INTERVAL`], or each time where many wait awake.
///
/// The system likes to wake the peer on the processor of who woke it, where it would wait for as long as somebody is awake
/// there. Beside programs that calculate all the time, giving way to programs takes milliseconds: then nobody gives way to
/// them for a while. A task that gives way is taken over by another thread of the runtime, which wakes the next: too dear for
/// every look.
#[derive(Debug)]
pub(crate) struct Yielder {
    /// When tasks last had their turn; `None` if they never had.
    tasks: Option<Instant>,
}

impl Yielder {
    /// For who may have woken other tasks: they are let go first.
    pub(crate) fn after_waking() -> Self {
        Self { tasks: None }
    }

    /// For who is in the midst of something.
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
        if since_begin(before) >= HOLDOFF_UNTIL.load(Relaxed) {
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
