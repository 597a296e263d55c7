//! Waiting awake for bytes that are about to come.
//!
//! Waking a sleeping thread costs more than all else in a round trip of small messages. So a
//! connection whose last bytes came within [`SOON`] looks for the next ones itself for up to
//! [`LIMIT`] before it goes to sleep, giving way to others between looks ([`GivingWay`]); what comes meanwhile
//! wakes nobody else ([`Socket::quieten`]). A connection at rest, or with a slow peer, sleeps at once.
//!
//! Small messages that come by themselves, one behind the other, are left a moment to become several: each look
//! disturbs their writer. Where much comes nevertheless, from a writer that sends several at once, the moment is spent awake
//! ([`GATHERING`]); where little comes, from one that hands over each by itself, asleep ([`NAP`]), for even somebody who merely
//! stays awake makes that dearer. Only one connection of the process does so at a time.

use std::io;
use std::mem;
use std::sync::LazyLock;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicU64, AtomicUsize};
use std::thread;
use std::time::{Duration, Instant};

use crate::stream::{Inflow, Socket};

/// Longest time awake per wait, also of a writer for room.
pub(crate) const LIMIT: Duration = Duration::from_micros(60);
/// A wait this short makes the next one be spent awake.
const SOON: Duration = Duration::from_micros(120);
/// How long messages that were not asked for are left alone.
const GATHERING: Duration = Duration::from_micros(20);
/// The same, asleep: the system makes 50 to 70 µs of it.
const NAP: Duration = Duration::from_micros(1);
/// Bytes per microsecond that are little.
const LITTLE: u128 = 100;
/// Who gave way for longer has met a program that calculates.
const LONG: Duration = Duration::from_millis(1);
/// For how long nobody gives way to programs then.
const CROWDED: Duration = Duration::from_millis(20);
/// How long other tasks wait for one that is awake, while no more than [`FEW`] are.
const TASKS: Duration = Duration::from_micros(10);
/// Connections, one in each direction.
const FEW: usize = 2;
/// Bytes read in one look, at first and at most.
const CHUNK: usize = 4 * 1024;
const LARGEST_CHUNK: usize = 64 * 1024;

/// Connections of this process that wait awake.
static AWAKE: AtomicUsize = AtomicUsize::new(0);

/// Whether a connection waits awake.
#[derive(Debug)]
pub(crate) struct BusyPoll {
    /// Whether what comes wakes tasks.
    wakes: bool,
    hot: Option<Awake>,
    /// Bytes to read in the next look; grows while looks are filled.
    chunk: usize,
    asleep_since: Option<Instant>,
    /// Whether the last message was a large one: the next is worth beginning with at once.
    large: bool,
    /// Whether little came until the last look.
    trickles: bool,
}

/// One of those that wait awake.
#[derive(Debug)]
struct Awake;

/// Why the peer will send something.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Expecting {
    /// It is its turn: it was answered, or is to answer.
    Turn,
    /// It sends when it likes.
    Anything,
}

impl BusyPoll {
    /// A connection that has seen nothing yet. Where what comes on it `wakes` tasks, they are let go first.
    pub(crate) fn new(wakes: bool) -> Self {
        Self {
            wakes,
            hot: None,
            chunk: CHUNK,
            asleep_since: None,
            large: false,
            trickles: false,
        }
    }

    /// Looks for bytes while it is worth it; `None` says to go to sleep.
    pub(crate) async fn read(
        &mut self,
        stream: &Socket,
        input: &mut Inflow,
        expecting: Expecting,
    ) -> Option<io::Result<usize>> {
        let begin = Instant::now();
        if self.hot.is_some() {
            let large = mem::take(&mut self.large);
            if !large {
                stream.quieten();
            }
            input.reserve(self.chunk);
            let buffer = &mut input.bytes;
            let length = buffer.len();
            buffer.resize(length + self.chunk, 0);
            let alone = AWAKE.load(Relaxed) == 1;
            if expecting == Expecting::Anything && !large && alone {
                tokio::task::yield_now().await;
                if self.trickles {
                    thread::sleep(NAP);
                }
                while begin.elapsed() < GATHERING {
                    std::hint::spin_loop();
                }
            }
            let awake = Instant::now();
            let mut giving_way = match self.wakes {
                true => GivingWay::after_waking(),
                false => GivingWay::midway(),
            };
            while awake.elapsed() < LIMIT {
                match stream.look(&mut buffer[length..]) {
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                        giving_way.once().await;
                    }
                    read => {
                        let count = *read.as_ref().unwrap_or(&0);
                        self.trickles = (count as u128) < LITTLE * begin.elapsed().as_micros();
                        buffer.truncate(length + count);
                        self.chunk = match count == self.chunk {
                            true => (4 * self.chunk).min(LARGEST_CHUNK),
                            false => (self.chunk / 2).max(CHUNK),
                        };
                        return Some(read);
                    }
                }
            }
            buffer.truncate(length);
            self.hot = None;
        }
        self.asleep_since = Some(begin);
        None
    }

    /// Takes note that so much of a message is missing.
    pub(crate) fn misses(&mut self, bytes: usize) {
        self.large |= bytes > LARGEST_CHUNK;
    }

    /// Takes note that bytes came.
    pub(crate) fn received(&mut self) {
        if let Some(since) = self.asleep_since.take() {
            self.hot = (since.elapsed() < SOON).then(Awake::new);
        }
    }
}

/// Lets others have this processor between two looks: programs each time, other tasks at first and then every
/// [`TASKS`], or each time where many wait awake.
///
/// The system likes to wake the peer on the processor of who woke it, where it would wait for as long as somebody is awake
/// there. Beside programs that calculate all the time, giving way to programs takes milliseconds: then nobody gives way to
/// them for a while. A task that gives way is taken over by another thread of the runtime, which wakes the next: too dear for
/// every look.
#[derive(Debug)]
pub(crate) struct GivingWay {
    /// When tasks last had their turn; `None` if they never had.
    tasks: Option<Instant>,
}

impl GivingWay {
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
        static CROWDED_UNTIL: AtomicU64 = AtomicU64::new(0);
        let since_begin = |time: Instant| u64::try_from((time - *BEGIN).as_micros()).unwrap_or(0);
        let before = Instant::now();
        if since_begin(before) >= CROWDED_UNTIL.load(Relaxed) {
            thread::yield_now();
            let after = Instant::now();
            if after - before > LONG {
                CROWDED_UNTIL.store(since_begin(after + CROWDED), Relaxed);
            }
        }
        let many = AWAKE.load(Relaxed) > FEW;
        if many || self.tasks.is_none_or(|last| before - last >= TASKS) {
            tokio::task::yield_now().await;
            self.tasks = Some(Instant::now());
        }
    }
}

impl Awake {
    fn new() -> Self {
        AWAKE.fetch_add(1, Relaxed);
        Self
    }
}

impl Drop for Awake {
    fn drop(&mut self) {
        AWAKE.fetch_sub(1, Relaxed);
    }
}
