//! Who is connected to a port, and for how long they have been silent.
//!
//! Only ports that ask for it ([`PortOptions::callers`](super::PortOptions::callers)) keep such a list.
//! A caller that says nothing for too long is ended; when there are too many, the one that has been
//! silent for longest makes room, those first that have not even said who they are. Nobody is ended
//! while an answer is being made for him.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

/// How much silence, and how many connections, a port puts up with. The default is any.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct CallerLimits {
    /// How long a connection may take until it has said who it is (its header).
    pub header: Option<Duration>,
    /// How long one that has said so may be silent: from then, or from its last message or answer.
    pub message: Option<Duration>,
    /// Connections at once, each way: a newcomer ends the one that has been silent for longest.
    pub connections: Option<usize>,
}

/// How long nothing can be due, if nothing is.
const LONG: Duration = Duration::from_secs(3600);

/// The callers of one port.
#[derive(Debug)]
pub(super) struct Callers {
    limits: CallerLimits,
    list: Mutex<List>,
}

#[derive(Debug, Default)]
struct List {
    /// Of the same standing, who has been silent for longest comes first.
    callers: BTreeMap<Key, Entry>,
    next: u64,
}

type Key = (Standing, u64);

#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd)]
enum Standing {
    /// Has not said who he is.
    Stranger,
    Known,
    /// It is not he who is silent.
    Waits,
}

#[derive(Debug)]
struct Entry {
    since: Instant,
    /// Dropping it ends the connection.
    _end: oneshot::Sender<()>,
}

/// A place among the callers, given back on drop.
#[derive(Debug)]
pub(super) struct Caller {
    callers: Arc<Callers>,
    key: Key,
}

/// Tells a connection that it is to end.
pub(super) type Farewell = oneshot::Receiver<()>;

impl Callers {
    pub(super) fn new(limits: CallerLimits) -> Arc<Self> {
        let list = Mutex::default();
        Arc::new(Self { limits, list })
    }

    fn list(&self) -> MutexGuard<'_, List> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets somebody in. None if there is no room, and nobody who could make room.
    pub(super) fn admit(self: &Arc<Self>, now: Instant) -> Option<(Caller, Farewell)> {
        let mut list = self.list();
        let most = self.limits.connections.unwrap_or(usize::MAX);
        while list.callers.len() >= most {
            if !list.end_longest_silent() {
                return None;
            }
        }
        let (end, farewell) = oneshot::channel();
        let key = list.insert(Standing::Stranger, now, end);
        let callers = self.clone();
        Some((Caller { callers, key }, farewell))
    }

    /// Ends whoever has been silent for longest; tells whether there is somebody.
    pub(super) fn make_room(&self) -> bool {
        self.list().end_longest_silent()
    }

    /// Ends those that have been silent for too long; tells when to look again.
    pub(super) fn end_silent(&self, now: Instant) -> Instant {
        let mut list = self.list();
        let mut next = now + LONG;
        for (standing, longest) in [
            (Standing::Stranger, self.limits.header),
            (Standing::Known, self.limits.message),
        ] {
            let Some(longest) = longest else {
                continue;
            };
            // Who comes later is not due before.
            next = next.min(now + longest);
            let of_standing = (standing, 0)..=(standing, u64::MAX);
            while let Some((key, entry)) = list.callers.range(of_standing.clone()).next() {
                let due = entry.since + longest;
                if due > now {
                    next = next.min(due);
                    break;
                }
                let key = *key;
                list.callers.remove(&key);
                tracing::debug!("ending a connection that says nothing");
            }
        }
        next
    }
}

impl List {
    fn insert(&mut self, standing: Standing, since: Instant, end: oneshot::Sender<()>) -> Key {
        let key = (standing, self.next);
        self.next += 1;
        self.callers.insert(key, Entry { since, _end: end });
        key
    }

    fn end_longest_silent(&mut self) -> bool {
        let first = self.callers.first_entry();
        let Some(first) = first.filter(|first| first.key().0 < Standing::Waits) else {
            return false;
        };
        first.remove();
        tracing::debug!("too many connections: ending the one that has been silent for longest");
        true
    }
}

impl Caller {
    /// He has said who he is, or something else, or got an answer.
    pub(super) fn spoke(&mut self, now: Instant) {
        self.become_(Standing::Known, now);
    }

    /// He waits for an answer from now on.
    pub(super) fn waits(&mut self, now: Instant) {
        self.become_(Standing::Waits, now);
    }

    fn become_(&mut self, standing: Standing, now: Instant) {
        let mut list = self.callers.list();
        // Else he has been ended, and will know soon.
        if let Some(entry) = list.callers.remove(&self.key) {
            self.key = list.insert(standing, now, entry._end);
        }
    }
}

impl Drop for Caller {
    fn drop(&mut self) {
        self.callers.list().callers.remove(&self.key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn is_ended(farewell: &mut Farewell) -> bool {
        farewell.try_recv() == Err(oneshot::error::TryRecvError::Closed)
    }

    #[test]
    fn strangers_and_the_silent_are_ended_at_their_times() {
        let callers = Callers::new(CallerLimits {
            header: Some(2 * SECOND),
            message: Some(10 * SECOND),
            connections: None,
        });
        let start = Instant::now();
        let (_stranger, mut stranger_ends) = callers.admit(start).unwrap();
        let (mut known, mut known_ends) = callers.admit(start).unwrap();
        let (mut waiting, mut waiting_ends) = callers.admit(start).unwrap();
        known.spoke(start + SECOND);
        waiting.spoke(start + SECOND);
        waiting.waits(start + SECOND);
        assert_eq!(callers.end_silent(start + SECOND), start + 2 * SECOND);
        assert!(!is_ended(&mut stranger_ends));
        callers.end_silent(start + 2 * SECOND);
        assert!(is_ended(&mut stranger_ends) && !is_ended(&mut known_ends));
        assert_eq!(callers.end_silent(start + 10 * SECOND), start + 11 * SECOND);
        callers.end_silent(start + 11 * SECOND);
        assert!(is_ended(&mut known_ends));
        callers.end_silent(start + 1000 * SECOND);
        assert!(!is_ended(&mut waiting_ends));
        waiting.spoke(start + 1000 * SECOND);
        callers.end_silent(start + 1010 * SECOND);
        assert!(is_ended(&mut waiting_ends));
        // Nothing comes of speaking too late.
        known.spoke(start + 1010 * SECOND);
        assert!(callers.list().callers.is_empty());
    }

    #[test]
    fn a_newcomer_ends_the_longest_silent_strangers_first() {
        let callers = Callers::new(CallerLimits {
            connections: Some(3),
            ..CallerLimits::default()
        });
        let now = Instant::now();
        let mut three: Vec<_> = (0..3).map(|_| callers.admit(now).unwrap()).collect();
        three[0].0.spoke(now);
        three[1].0.spoke(now);
        three[0].0.spoke(now);
        let mut ended = |who: usize| is_ended(&mut three[who].1);
        let (mut fourth, mut fourth_ends) = callers.admit(now).unwrap();
        assert!(ended(2) && !ended(1) && !ended(0));
        fourth.spoke(now);
        let (mut fifth, _fifth_ends) = callers.admit(now).unwrap();
        assert!(ended(1) && !ended(0));
        fifth.waits(now);
        fourth.waits(now);
        let (mut sixth, _sixth_ends) = callers.admit(now).unwrap();
        assert!(ended(0) && !is_ended(&mut fourth_ends));
        sixth.waits(now);
        assert!(callers.admit(now).is_none() && !callers.make_room());
        drop(fourth);
        assert!(callers.admit(now).is_some());
    }
}
