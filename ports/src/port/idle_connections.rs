//! Who is connected to a port, and for how long they have been silent.
//!
//! Only ports that ask for it ([`PortOptions::connection_limits`](super::PortOptions::connection_limits)) keep such a list.
//! A caller that says nothing for too long is ended; when there are too many, the one that has been
//! silent for longest makes room, those first that have not even said who they are. Nobody is ended
//! while an answer is being made for him.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

/// How much silence, and how many connections, a port puts up with. The default is any.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct ConnectionLimits {
    /// How long a connection may take until it has said who it is (its header).
    pub handshake_timeout: Option<Duration>,
    /// How long one that has said so may be silent: from then, or from its last message or answer.
    pub idle_timeout: Option<Duration>,
    /// Connections at once, each way: a newcomer ends the one that has been silent for longest.
    pub max_connections: Option<usize>,
}

/// How long nothing can be due, if nothing is.
const MAX_CHECK_INTERVAL: Duration = Duration::from_secs(3600);

/// The callers of one port.
#[derive(Debug)]
pub(super) struct ConnectionTable {
    limits: ConnectionLimits,
    list: Mutex<Entries>,
}

#[derive(Debug, Default)]
struct Entries {
    /// Of the same phase, who has been silent for longest comes first.
    entries: BTreeMap<Key, Entry>,
    next: u64,
}

type Key = (Phase, u64);

#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd)]
enum Phase {
    /// Has not said who he is.
    Handshaking,
    Idle,
    /// It is not he who is silent.
    Busy,
}

#[derive(Debug)]
struct Entry {
    since: Instant,
    /// Dropping it ends the connection.
    _end: oneshot::Sender<()>,
}

/// A place among the callers, given back on drop.
#[derive(Debug)]
pub(super) struct ConnectionGuard {
    table: Arc<ConnectionTable>,
    key: Key,
}

/// Tells a connection that it is to end.
pub(super) type CloseSignal = oneshot::Receiver<()>;

impl ConnectionTable {
    pub(super) fn new(limits: ConnectionLimits) -> Arc<Self> {
        let list = Mutex::default();
        Arc::new(Self { limits, list })
    }

    fn list(&self) -> MutexGuard<'_, Entries> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets somebody in. None if there is no room, and nobody who could make room.
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

    /// Ends whoever has been silent for longest; tells whether there is somebody.
    pub(super) fn evict_one(&self) -> bool {
        self.list().evict_longest_idle()
    }

    /// Ends those that have been silent for too long; tells when to look again.
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
            // Who comes later is not due before.
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
    /// He has said who he is, or something else, or got an answer.
    pub(super) fn set_active(&mut self, now: Instant) {
        self.transition_to(Phase::Idle, now);
    }

    /// He waits for an answer from now on.
    pub(super) fn set_busy(&mut self, now: Instant) {
        self.transition_to(Phase::Busy, now);
    }

    fn transition_to(&mut self, phase: Phase, now: Instant) {
        let mut list = self.table.list();
        // Else he has been ended, and will know soon.
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
        // Nothing comes of speaking too late.
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
