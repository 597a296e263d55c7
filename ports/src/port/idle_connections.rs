//! Timeouts of idle incoming connections, and their maximum number.
//!
//! Only ports with [`PortOptions::connection_limits`](super::PortOptions::connection_limits) keep
//! such a table. A connection that is idle for too long is closed; when there are too many, the one
//! idle for longest is closed, those without a complete header first. No connection is closed while
//! its request is being answered.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

/// Limits on idle time and number of incoming connections. The default is none.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct ConnectionLimits {
    /// Timeout of the header, from the beginning of the connection.
    pub handshake_timeout: Option<Duration>,
    /// Timeout after the header, the last message or the last answer.
    pub idle_timeout: Option<Duration>,
    /// Maximum number of connections in each direction: a new one closes the one idle for longest.
    pub max_connections: Option<usize>,
}

/// Time of the next check if nothing is due.
const MAX_CHECK_INTERVAL: Duration = Duration::from_secs(3600);

/// The callers of one port.
#[derive(Debug)]
pub(super) struct ConnectionTable {
    limits: ConnectionLimits,
    list: Mutex<Entries>,
}

#[derive(Debug, Default)]
struct Entries {
    /// Within a phase, the connection idle for longest comes first.
    entries: BTreeMap<Key, Entry>,
    next: u64,
}

type Key = (Phase, u64);

#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd)]
enum Phase {
    /// The header is not complete.
    Handshaking,
    Idle,
    /// A request is being answered.
    Busy,
}

#[derive(Debug)]
struct Entry {
    since: Instant,
    /// Dropping it closes the connection.
    _end: oneshot::Sender<()>,
}

/// An entry in the table, removed on drop.
#[derive(Debug)]
pub(super) struct ConnectionGuard {
    table: Arc<ConnectionTable>,
    key: Key,
}

/// Signals a connection to close.
pub(super) type CloseSignal = oneshot::Receiver<()>;

impl ConnectionTable {
    pub(super) fn new(limits: ConnectionLimits) -> Arc<Self> {
        let list = Mutex::default();
        Arc::new(Self { limits, list })
    }

    fn list(&self) -> MutexGuard<'_, Entries> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a connection. `None` if there is no room and no idle connection to close.
    pub(super) fn admit(self: &Arc<Self>, now: Instant) -> Option<(ConnectionGuard, CloseSignal)> {
        let mut list = self.list();
        let most = self.limits.max_connections.unwrap_or(usize::MAX);
        while list.entries.len() >= most {
            if !list.evict_longest_idle() {
                return None;
            }
        }
        let (end, close_signal) = oneshot::channel();
        let key = list.insert(Phase::Handshaking, now, end);
        let table = self.clone();
        Some((ConnectionGuard { table, key }, close_signal))
    }

    /// Closes the connection idle for longest; returns whether there was one.
    pub(super) fn evict_one(&self) -> bool {
        self.list().evict_longest_idle()
    }

    /// Closes the connections that exceeded their timeouts; returns the time of the next check.
    pub(super) fn close_idle(&self, now: Instant) -> Instant {
        let mut list = self.list();
        let mut next = now + MAX_CHECK_INTERVAL;
        for (phase, longest) in [
            (Phase::Handshaking, self.limits.handshake_timeout),
            (Phase::Idle, self.limits.idle_timeout),
        ] {
            let Some(longest) = longest else {
                continue;
            };
            // Later connections are not due before.
            next = next.min(now + longest);
            let of_phase = (phase, 0)..=(phase, u64::MAX);
            while let Some((key, entry)) = list.entries.range(of_phase.clone()).next() {
                let due = entry.since + longest;
                if due > now {
                    next = next.min(due);
                    break;
                }
                let key = *key;
                list.entries.remove(&key);
                tracing::debug!("closing an idle connection");
            }
        }
        next
    }
}

impl Entries {
    fn insert(&mut self, phase: Phase, since: Instant, end: oneshot::Sender<()>) -> Key {
        let key = (phase, self.next);
        self.next += 1;
        self.entries.insert(key, Entry { since, _end: end });
        key
    }

    fn evict_longest_idle(&mut self) -> bool {
        let first = self.entries.first_entry();
        let Some(first) = first.filter(|first| first.key().0 < Phase::Busy) else {
            return false;
        };
        first.remove();
        tracing::debug!("too many connections: closing the one that has been idle for longest");
        true
    }
}

impl ConnectionGuard {
    /// Restarts the idle timeout after a header, message or answer.
    pub(super) fn set_active(&mut self, now: Instant) {
        self.transition_to(Phase::Idle, now);
    }

    /// He waits for an answer from now on.
    pub(super) fn set_busy(&mut self, now: Instant) {
        self.transition_to(Phase::Busy, now);
    }

    fn transition_to(&mut self, phase: Phase, now: Instant) {
        let mut list = self.table.list();
        // Otherwise it has been closed, and will notice soon.
        if let Some(entry) = list.entries.remove(&self.key) {
            self.key = list.insert(phase, now, entry._end);
        }
    }
}

impl Drop for ConnectionGuard {
    fn drop(&mut self) {
        self.table.list().entries.remove(&self.key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn is_ended(close_signal: &mut CloseSignal) -> bool {
        close_signal.try_recv() == Err(oneshot::error::TryRecvError::Closed)
    }

    #[test]
    fn idle_connections_are_closed_at_their_timeouts() {
        let table = ConnectionTable::new(ConnectionLimits {
            handshake_timeout: Some(2 * SECOND),
            idle_timeout: Some(10 * SECOND),
            max_connections: None,
        });
        let start = Instant::now();
        let (_stranger, mut stranger_ends) = table.admit(start).unwrap();
        let (mut known, mut known_ends) = table.admit(start).unwrap();
        let (mut waiting, mut waiting_ends) = table.admit(start).unwrap();
        known.set_active(start + SECOND);
        waiting.set_active(start + SECOND);
        waiting.set_busy(start + SECOND);
        assert_eq!(table.close_idle(start + SECOND), start + 2 * SECOND);
        assert!(!is_ended(&mut stranger_ends));
        table.close_idle(start + 2 * SECOND);
        assert!(is_ended(&mut stranger_ends) && !is_ended(&mut known_ends));
        assert_eq!(table.close_idle(start + 10 * SECOND), start + 11 * SECOND);
        table.close_idle(start + 11 * SECOND);
        assert!(is_ended(&mut known_ends));
        table.close_idle(start + 1000 * SECOND);
        assert!(!is_ended(&mut waiting_ends));
        waiting.set_active(start + 1000 * SECOND);
        table.close_idle(start + 1010 * SECOND);
        assert!(is_ended(&mut waiting_ends));
        // Activity after the timeout has no effect.
        known.set_active(start + 1010 * SECOND);
        assert!(table.list().entries.is_empty());
    }

    #[test]
    fn a_new_connection_closes_the_longest_idle_first() {
        let table = ConnectionTable::new(ConnectionLimits {
            max_connections: Some(3),
            ..ConnectionLimits::default()
        });
        let now = Instant::now();
        let mut three: Vec<_> = (0..3).map(|_| table.admit(now).unwrap()).collect();
        three[0].0.set_active(now);
        three[1].0.set_active(now);
        three[0].0.set_active(now);
        let mut ended = |who: usize| is_ended(&mut three[who].1);
        let (mut fourth, mut fourth_ends) = table.admit(now).unwrap();
        assert!(ended(2) && !ended(1) && !ended(0));
        fourth.set_active(now);
        let (mut fifth, _fifth_ends) = table.admit(now).unwrap();
        assert!(ended(1) && !ended(0));
        fifth.set_busy(now);
        fourth.set_busy(now);
        let (mut sixth, _sixth_ends) = table.admit(now).unwrap();
        assert!(ended(0) && !is_ended(&mut fourth_ends));
        sixth.set_busy(now);
        assert!(table.admit(now).is_none() && !table.evict_one());
        drop(fourth);
        assert!(table.admit(now).is_some());
    }
}
