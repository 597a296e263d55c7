//! Limits on what peers may make a process hold.
//!
//! Every limit of this crate is named here. Those of a whole process are shared by all its ports, and a program may
//! change them with [`ProcessLimits::apply`]; the others are constants.
//!
//! | limit | default | to change it |
//! | --- | --- | --- |
//! | incoming connections | 3/4 of `RLIMIT_NOFILE`, at most 16 384 | `ulimit -n`, [`ProcessLimits::connections`] |
//! | of these, inputs over `udp` and `mcast` | 1/8 of `RLIMIT_NOFILE`, at most 1 024 | `ulimit -n`, [`ProcessLimits::datagram_inputs`] |
//! | outgoing connections of a port that peers may ask for | half of the incoming connections | as those |
//! | time until a connection's header is complete | 30 s | [`ProcessLimits::header_timeout`], [`PortOptions::connection_limits`](crate::PortOptions::connection_limits) |
//! | each step of the handshake of keys | 2 s | - |
//! | bytes of incomplete messages beyond 1 MiB each, all connections together | 1.5 GiB | [`ProcessLimits::incoming_bytes`] |
//! | bytes that compressed messages, until they are dropped, and pictures, while they are decoded, expand to, all together | 48 MiB | [`ProcessLimits::expanded_bytes`] |
//! | bytes of the values of messages above 64 KiB that are read as bottles, until the messages are dropped, all together | 256 MiB; `yarp up` and other servers 16 MiB | [`ProcessLimits::parsed_bytes`] |
//! | bytes of replies that peers have not read, beyond 128 KiB of each connection, all together; a single one may be larger | 256 MiB; `yarp up` and other servers 16 MiB | [`ProcessLimits::unsent_bytes`] |
//! | expansions at a time | half of the processors | - |
//! | monitors of a connection; of these, expansions | 16; 1 | - |
//! | properties of a port | 1024, 64 KiB in all | - |
//! | silence of a writer over `udp` or `mcast` before it is asked | 60 s | [`PortOptions::datagram_timeout`](crate::PortOptions::datagram_timeout) |
//! | silence of one that no name server knows, before its connection ends | 5 times that | as that |
//! | characters of a peer's text in a line of the log | 200 | - |
//! | lines of the log about bad connections | 10 in 10 s per port | - |
//! | lines of the log about connections that cannot be accepted | 1 a minute per port | - |

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use rustix::process::{Resource, getrlimit};

/// Time within which a connection must have sent its header, unless told otherwise.
pub const HEADER_TIMEOUT: Duration = Duration::from_secs(30);
/// Incoming connections of a process, however many descriptors it may have.
pub const MAX_CONNECTIONS: usize = 16_384;
/// Inputs over datagrams of a process, however many descriptors it may have.
pub const MAX_DATAGRAM_INPUTS: usize = 1_024;
/// Bytes of an incomplete message that do not count against [`ProcessLimits::incoming_bytes`].
pub const SMALL_MESSAGE: usize = 1 << 20;
/// Properties that a port keeps for peers.
pub const MAX_PROPERTIES: usize = 1_024;
/// Bytes of the properties that a port keeps for peers, as written on the wire.
pub const MAX_PROPERTY_BYTES: usize = 64 << 10;
/// Characters of a peer's text that are written to the log.
pub const MAX_LOGGED_TEXT: usize = 200;
/// Intervals of [`PortOptions::datagram_timeout`](crate::PortOptions::datagram_timeout) without a datagram, after which the connection of a
/// writer that no name server knows ends.
pub const UNKNOWN_WRITER_INTERVALS: u32 = 5;
/// Lines that a port logs about bad connections in each [`BAD_CONNECTION_LOG_INTERVAL`].
pub const BAD_CONNECTION_LOG_LINES: u32 = 10;
/// See [`BAD_CONNECTION_LOG_LINES`].
pub const BAD_CONNECTION_LOG_INTERVAL: Duration = Duration::from_secs(10);
/// Interval between two lines of a port's log about connections that cannot be accepted.
pub const ACCEPT_LOG_INTERVAL: Duration = Duration::from_secs(60);

/// Bytes of incomplete messages unless told otherwise: one of the largest kind, and half as much.
const INCOMING_BYTES: usize = 3 << 29;
/// Bytes of expanded messages unless told otherwise: a 4K image in float depths, and some.
const EXPANDED_BYTES: usize = 48 << 20;
/// Bytes of the values of messages unless told otherwise: a bottle of as many values as may be, and some.
const PARSED_BYTES: usize = 256 << 20;
/// The same for programs that serve devices or names, which take no such bottles.
pub const PARSED_BYTES_OF_SERVERS: usize = 16 << 20;
/// Bytes of unsent replies unless told otherwise.
const UNSENT_BYTES: usize = 256 << 20;
/// The same for programs that serve devices or names.
pub const UNSENT_BYTES_OF_SERVERS: usize = 16 << 20;

/// Limits that all ports of the process share.
///
/// ```
/// use yarp_ports::port_limits::ProcessLimits;
/// let limits = ProcessLimits::default().with_expanded_bytes(256 << 20);
/// limits.apply();
/// assert_eq!(ProcessLimits::current(), limits);
/// # ProcessLimits::default().apply();
/// ```
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct ProcessLimits {
    /// Incoming connections at a time; none: 3/4 of `RLIMIT_NOFILE`, at most [`MAX_CONNECTIONS`].
    pub connections: Option<usize>,
    /// Inputs over `udp` and `mcast` at a time; none: 1/8 of `RLIMIT_NOFILE`, at most [`MAX_DATAGRAM_INPUTS`].
    pub datagram_inputs: Option<usize>,
    /// Time within which a connection must have sent its header, in milliseconds at the finest, unless its port has
    /// limits of its own.
    pub header_timeout: Duration,
    /// Bytes of incomplete messages beyond [`SMALL_MESSAGE`] each, of all connections together.
    pub incoming_bytes: usize,
    /// Bytes that compressed messages and pictures are expanded to, all together: messages until their readers have
    /// dropped them, pictures while they are decoded. A decoded picture waits in the queue of its reader as any message.
    pub expanded_bytes: usize,
    /// Bytes that the values of messages take that were read as bottles, all together: each until the message is dropped.
    /// Only messages of more than 64 KiB count.
    pub parsed_bytes: usize,
    /// Bytes of replies that peers have not read, beyond 128 KiB of each connection, all together. A connection whose
    /// reply exceeds them is closed, unless it is the only one.
    pub unsent_bytes: usize,
}

impl Default for ProcessLimits {
    fn default() -> Self {
        Self {
            connections: None,
            datagram_inputs: None,
            header_timeout: HEADER_TIMEOUT,
            incoming_bytes: INCOMING_BYTES,
            expanded_bytes: EXPANDED_BYTES,
            parsed_bytes: PARSED_BYTES,
            unsent_bytes: UNSENT_BYTES,
        }
    }
}

/// Stands for "derived from `RLIMIT_NOFILE`".
const DERIVED: usize = usize::MAX;

static CONNECTIONS: AtomicUsize = AtomicUsize::new(DERIVED);
static DATAGRAM_INPUTS: AtomicUsize = AtomicUsize::new(DERIVED);
static HEADER_MILLIS: AtomicU64 = AtomicU64::new(HEADER_TIMEOUT.as_millis() as u64);
static INCOMING: AtomicUsize = AtomicUsize::new(INCOMING_BYTES);
static PARSED: AtomicUsize = AtomicUsize::new(PARSED_BYTES);
static UNSENT: AtomicUsize = AtomicUsize::new(UNSENT_BYTES);
static EXPANDED: AtomicUsize = AtomicUsize::new(EXPANDED_BYTES);

impl ProcessLimits {
    /// Returns the limits in force.
    pub fn current() -> Self {
        let chosen = |limit: &AtomicUsize| {
            Some(limit.load(Ordering::Relaxed)).filter(|limit| *limit != DERIVED)
        };
        Self {
            connections: chosen(&CONNECTIONS),
            datagram_inputs: chosen(&DATAGRAM_INPUTS),
            header_timeout: header_timeout(),
            incoming_bytes: INCOMING.load(Ordering::Relaxed),
            expanded_bytes: EXPANDED.load(Ordering::Relaxed),
            parsed_bytes: PARSED.load(Ordering::Relaxed),
            unsent_bytes: UNSENT.load(Ordering::Relaxed),
        }
    }

    /// Puts these limits in force, for what comes from now on.
    pub fn apply(self) {
        let put = |limit: &AtomicUsize, chosen: Option<usize>| {
            limit.store(chosen.unwrap_or(DERIVED), Ordering::Relaxed)
        };
        put(&CONNECTIONS, self.connections);
        put(&DATAGRAM_INPUTS, self.datagram_inputs);
        let millis = u64::try_from(self.header_timeout.as_millis()).unwrap_or(u64::MAX);
        HEADER_MILLIS.store(millis, Ordering::Relaxed);
        INCOMING.store(self.incoming_bytes, Ordering::Relaxed);
        EXPANDED.store(self.expanded_bytes, Ordering::Relaxed);
        PARSED.store(self.parsed_bytes, Ordering::Relaxed);
        UNSENT.store(self.unsent_bytes, Ordering::Relaxed);
    }

    /// Returns the same limits with another number of incoming connections.
    pub fn with_connections(mut self, connections: usize) -> Self {
        self.connections = Some(connections);
        self
    }

    /// Returns the same limits with another number of inputs over datagrams.
    pub fn with_datagram_inputs(mut self, inputs: usize) -> Self {
        self.datagram_inputs = Some(inputs);
        self
    }

    /// Returns the same limits with another time for headers.
    pub fn with_header_timeout(mut self, timeout: Duration) -> Self {
        self.header_timeout = timeout;
        self
    }

    /// Returns the same limits with other bytes of incomplete messages.
    pub fn with_incoming_bytes(mut self, bytes: usize) -> Self {
        self.incoming_bytes = bytes;
        self
    }

    /// Returns the same limits with other bytes of expanded messages.
    pub fn with_expanded_bytes(mut self, bytes: usize) -> Self {
        self.expanded_bytes = bytes;
        self
    }

    /// Returns the same limits with other bytes of the values of messages.
    pub fn with_parsed_bytes(mut self, bytes: usize) -> Self {
        self.parsed_bytes = bytes;
        self
    }

    /// Returns the same limits with other bytes of unsent replies.
    pub fn with_unsent_bytes(mut self, bytes: usize) -> Self {
        self.unsent_bytes = bytes;
        self
    }
}

/// Returns how many descriptors the process may have.
fn descriptors() -> usize {
    let current = getrlimit(Resource::Nofile).current;
    current.map_or(usize::MAX, |limit| {
        usize::try_from(limit).unwrap_or(usize::MAX)
    })
}

/// Returns how many incoming connections the process may have.
pub(crate) fn connections() -> usize {
    match CONNECTIONS.load(Ordering::Relaxed) {
        DERIVED => (descriptors() / 4)
            .saturating_mul(3)
            .clamp(1, MAX_CONNECTIONS),
        chosen => chosen,
    }
}

/// Returns how many of them may be inputs over datagrams.
pub(crate) fn datagram_inputs() -> usize {
    match DATAGRAM_INPUTS.load(Ordering::Relaxed) {
        DERIVED => (descriptors() / 8).clamp(1, MAX_DATAGRAM_INPUTS),
        chosen => chosen,
    }
}

/// Returns how long a connection may take to send its header.
pub(crate) fn header_timeout() -> Duration {
    Duration::from_millis(HEADER_MILLIS.load(Ordering::Relaxed))
}

/// Returns how many outgoing connections a port may have once peers ask for more.
pub(crate) fn outputs() -> usize {
    (connections() / 2).max(1)
}

/// Bytes that the whole process may hold for one purpose.
#[derive(Debug)]
pub(crate) struct Budget {
    limit: &'static AtomicUsize,
    used: AtomicUsize,
}

/// Budget of messages that have not arrived as a whole.
pub(crate) static INCOMING_BUDGET: Budget = Budget {
    limit: &INCOMING,
    used: AtomicUsize::new(0),
};

/// Budget of the values that large messages are read as.
pub(crate) static PARSED_BUDGET: Budget = Budget {
    limit: &PARSED,
    used: AtomicUsize::new(0),
};

/// Budget of replies that peers have not read.
pub(crate) static UNSENT_BUDGET: Budget = Budget {
    limit: &UNSENT,
    used: AtomicUsize::new(0),
};

/// Budget of expanded messages and pictures.
#[cfg(any(feature = "jpeg", feature = "zlib"))]
pub(crate) static EXPANSION_BUDGET: Budget = Budget {
    limit: &EXPANDED,
    used: AtomicUsize::new(0),
};

impl Budget {
    /// Returns a reservation of so many bytes; none if they are not left.
    pub(crate) fn reserve(&'static self, bytes: usize) -> Option<Reservation> {
        let mut reservation = Reservation {
            budget: self,
            bytes: 0,
        };
        reservation.grow_to(bytes).then_some(reservation)
    }

    /// Returns a reservation of so many bytes, which may exceed the budget if nothing else is reserved.
    pub(crate) fn reserve_or_alone(&'static self, bytes: usize) -> Option<Reservation> {
        let alone = || {
            let used = &self.used;
            let first = used.compare_exchange(0, bytes, Ordering::Relaxed, Ordering::Relaxed);
            first.is_ok().then(|| Reservation {
                budget: self,
                bytes,
            })
        };
        self.reserve(bytes).or_else(alone)
    }

    /// Gives back bytes of a reservation that was forgotten.
    pub(crate) fn give_back(&self, bytes: usize) {
        self.used.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// Bytes of a budget, given back on drop.
#[derive(Debug)]
pub(crate) struct Reservation {
    budget: &'static Budget,
    bytes: usize,
}

impl Reservation {
    /// Returns the number of bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }

    /// Makes it one of at least so many bytes; tells whether they were left.
    pub(crate) fn grow_to(&mut self, bytes: usize) -> bool {
        let more = bytes.saturating_sub(self.bytes);
        let limit = self.budget.limit.load(Ordering::Relaxed);
        let taken = |used: usize| used.checked_add(more).filter(|used| *used <= limit);
        let used = &self.budget.used;
        let grown = more == 0
            || used
                .fetch_update(Ordering::Relaxed, Ordering::Relaxed, taken)
                .is_ok();
        if grown {
            self.bytes += more;
        }
        grown
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.budget.give_back(self.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_given_back() {
        static LIMIT: AtomicUsize = AtomicUsize::new(100);
        static BUDGET: Budget = Budget {
            limit: &LIMIT,
            used: AtomicUsize::new(0),
        };
        let mut first = BUDGET.reserve(60).unwrap();
        assert!(BUDGET.reserve(41).is_none());
        let second = BUDGET.reserve(40).unwrap();
        assert!(!first.grow_to(61) && first.grow_to(60) && first.grow_to(10));
        drop(second);
        assert!(first.grow_to(100) && BUDGET.reserve(1).is_none());
        assert_eq!(first.bytes, 100);
        drop(first);
        assert!(BUDGET.reserve(100).is_some() && BUDGET.reserve(101).is_none());
    }

    #[test]
    fn limits_follow_the_descriptors() {
        let all = descriptors();
        assert_eq!(connections(), (all / 4 * 3).min(MAX_CONNECTIONS));
        assert!(datagram_inputs() <= connections() / 4 && outputs() <= connections() / 2);
    }
}
