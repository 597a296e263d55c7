//! The incoming connections that a process holds, those of all its ports together.
//!
//! A newcomer that finds no place ends another connection: first one that has not sent its header, then an anonymous one
//! that has been idle, then a datagram input whose writer is not known, then an anonymous reader. Anonymous connections that
//! wait for a reply stay, as long as they are at most half of all. A connection from a port
//! (a name that begins with `/`) that a name server knows is never ended for being idle; if there are only such connections,
//! the newcomer is turned away. Whether a name server knows a port is asked once most places are taken by ports; one that is
//! not known counts as anonymous from then on. How many places there are is in [`limits`].
//!
//! **Invariant:** a message that comes on an admitted connection takes no lock here and reads no clock.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use super::dedicated_thread::ConnectionControl;
use super::port_context::is_port;
use super::send_queue::SendQueue;
use crate::error::PortError;
use crate::network::Network;
use crate::port_limits;

/// Interval between two rounds of questions about ports.
const ASK_INTERVAL: Duration = Duration::from_secs(1);
/// Time that the name server has for each.
const ASK_DEADLINE: Duration = Duration::from_secs(2);

/// The places of one process.
#[derive(Debug, Default)]
pub(super) struct ConnectionSlots(Mutex<State>);

/// The places of this process.
pub(super) fn process() -> &'static Arc<ConnectionSlots> {
    static PROCESS: std::sync::LazyLock<Arc<ConnectionSlots>> =
        std::sync::LazyLock::new(Arc::default);
    &PROCESS
}

#[derive(Debug, Default)]
struct State {
    entries: BTreeMap<Key, Entry>,
    next: u64,
    /// Entries that are inputs over datagrams.
    datagrams: usize,
    /// Entries that are from ports.
    peers: usize,
    /// When a name server was last asked about ports.
    asked: Option<Instant>,
}

type Key = (Phase, u64);

/// Phases of a connection; those listed first make room first.
#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd)]
pub(super) enum Phase {
    /// Has not sent its header.
    Silent,
    /// Has sent one, and is not from a port.
    Anonymous,
    /// Sends datagrams, and no name server knows its name.
    UnknownWriter,
    /// Reads what the port writes, and is no port.
    Viewer,
    /// Says that it is from a port: does not end to make room.
    Peer,
}

#[derive(Debug)]
struct Entry {
    /// When its header is due; none if the port has limits of its own.
    due: Option<Instant>,
    activity: Arc<Activity>,
    /// The activity that was last seen.
    seen: u64,
    ending: Ending,
    sends_datagrams: bool,
    /// The port that it says it is from.
    peer: Option<Box<str>>,
}

#[derive(Debug)]
enum Ending {
    Input(ConnectionControl),
    Output(Weak<SendQueue>),
}

/// Activity of a connection, recorded by its own task.
#[derive(Debug, Default)]
struct Activity {
    /// Messages and replies.
    count: AtomicU64,
    /// A reply is being made for it.
    is_served: AtomicBool,
    /// A name server knows the port that it says it is from.
    is_known: AtomicBool,
    /// It was told to end.
    has_ended: AtomicBool,
    /// Its key, which changes under the lock alone.
    phase: AtomicU8,
    number: AtomicU64,
}

/// A place, given back on drop.
#[derive(Debug)]
pub(super) struct ConnectionSlot {
    slots: Arc<ConnectionSlots>,
    is_silent: bool,
    activity: Arc<Activity>,
}

impl ConnectionSlots {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns a place for a connection that has just come; none if all places are taken by ports.
    ///
    /// The header is due at `due`, unless that is none.
    pub(super) fn admit(
        self: &Arc<Self>,
        control: &ConnectionControl,
        due: Option<Instant>,
    ) -> Option<ConnectionSlot> {
        self.admit_up_to(port_limits::connections(), control, due)
    }

    fn admit_up_to(
        self: &Arc<Self>,
        most: usize,
        control: &ConnectionControl,
        due: Option<Instant>,
    ) -> Option<ConnectionSlot> {
        let mut state = self.state();
        while state.entries.len() >= most {
            if !state.end_one(most) {
                return None;
            }
        }
        let activity = Arc::<Activity>::default();
        let entry = Entry {
            due,
            activity: activity.clone(),
            seen: 0,
            ending: Ending::Input(control.clone()),
            sends_datagrams: false,
            peer: None,
        };
        state.insert(Phase::Silent, entry);
        Some(ConnectionSlot {
            slots: self.clone(),
            is_silent: true,
            activity,
        })
    }

    /// Returns whether somebody should call [`ask_about_peers`] now: most places are taken by ports.
    pub(super) fn wants_to_know(&self, now: Instant) -> bool {
        self.wants_to_know_of(port_limits::connections(), now)
    }

    fn wants_to_know_of(&self, most: usize, now: Instant) -> bool {
        let mut state = self.state();
        let due = |asked: Instant| now >= asked + ASK_INTERVAL;
        let wants = 4 * state.peers >= 3 * most && state.asked.is_none_or(due);
        if wants {
            state.asked = Some(now);
        }
        wants
    }

    /// Returns connections that say they are from ports nobody has asked about.
    fn unknown_peers(&self) -> Vec<(Arc<Activity>, String)> {
        let state = self.state();
        let peers = state.entries.range(Phase::Peer.all());
        let unknown = peers.filter(|(_, entry)| !entry.activity.is_known.load(Relaxed));
        unknown
            .filter_map(|(_, entry)| Some((entry.activity.clone(), entry.peer.as_deref()?.into())))
            .collect()
    }

    /// A name server does not know the port: the connection counts as anonymous.
    fn demote(&self, activity: &Activity) {
        let mut state = self.state();
        if let Some(entry) = state.remove(activity.key()) {
            state.insert(Phase::Anonymous, entry);
        }
    }

    /// Ends a connection to free its descriptor; tells whether there was one to end.
    pub(super) fn make_room(&self) -> bool {
        self.state().end_one(port_limits::connections())
    }

    /// Ends connections whose header is overdue; tells when the next one is due.
    pub(super) fn end_overdue(&self, now: Instant) -> Option<Instant> {
        let mut state = self.state();
        let silent = state.entries.range(Phase::Silent.all());
        let due = silent.filter_map(|(key, entry)| Some((*key, entry.due?)));
        let (overdue, later): (Vec<_>, Vec<_>) = due.partition(|(_, due)| *due <= now);
        for (key, _) in overdue {
            state.end(key, "its header did not come in time");
        }
        later.into_iter().map(|(_, due)| due).min()
    }
}

/// Asks the name server about the ports that connections say they are from.
pub(super) async fn ask_about_peers(network: Network) {
    let network = network.with_timeout(ASK_DEADLINE);
    for (activity, name) in process().unknown_peers() {
        match network.query(&name).await {
            Ok(_) => activity.is_known.store(true, Relaxed),
            Err(PortError::Unknown { .. } | PortError::NoNameServer) => process().demote(&activity),
            // It may know them.
            Err(_) => return,
        }
    }
}

impl Phase {
    /// Those that make room, in this order.
    const EVICTED: [Self; 4] = [
        Self::Silent,
        Self::Anonymous,
        Self::UnknownWriter,
        Self::Viewer,
    ];

    fn all(self) -> RangeInclusive<Key> {
        (self, 0)..=(self, u64::MAX)
    }
}

impl State {
    fn insert(&mut self, phase: Phase, entry: Entry) {
        self.datagrams += usize::from(entry.sends_datagrams);
        self.peers += usize::from(phase == Phase::Peer);
        entry.activity.phase.store(phase as u8, Relaxed);
        entry.activity.number.store(self.next, Relaxed);
        self.entries.insert((phase, self.next), entry);
        self.next += 1;
    }

    fn remove(&mut self, key: Key) -> Option<Entry> {
        let entry = self.entries.remove(&key)?;
        self.datagrams -= usize::from(entry.sends_datagrams);
        self.peers -= usize::from(key.0 == Phase::Peer);
        Some(entry)
    }

    /// Its place is free from now on; its descriptor is as soon as its task has run.
    fn end(&mut self, key: Key, reason: &str) {
        let Some(entry) = self.remove(key) else {
            return;
        };
        entry.activity.has_ended.store(true, Relaxed);
        match entry.ending {
            Ending::Input(control) => control.end(),
            Ending::Output(send_queue) => {
                if let Some(send_queue) = send_queue.upgrade() {
                    send_queue.close(reason);
                }
            }
        }
        tracing::debug!(phase = ?key.0, reason, "ending a connection");
    }

    /// Ends a connection so that another of at most `most` finds a place; returns whether there was one to end.
    fn end_one(&mut self, most: usize) -> bool {
        let mut standings = Phase::EVICTED.into_iter();
        standings.any(|phase| self.end_first_of(phase)) || self.end_first_caller(most / 2)
    }

    /// Ends the oldest connection that waits for a reply and is not from a port, if there are more than `allowed`.
    fn end_first_caller(&mut self, allowed: usize) -> bool {
        let anonymous = self
            .entries
            .range((Phase::Silent, 0)..=(Phase::Viewer, u64::MAX));
        let waits = |entry: &Entry| {
            entry.activity.is_served.load(Relaxed) && !entry.activity.is_known.load(Relaxed)
        };
        let callers: Vec<Key> = anonymous
            .filter(|(_, entry)| waits(entry))
            .map(|(key, _)| *key)
            .collect();
        let oldest = callers.iter().min_by_key(|(_, number)| *number);
        match oldest.filter(|_| callers.len() > allowed) {
            Some(key) => {
                self.end(*key, "too many callers wait for replies");
                true
            }
            None => false,
        }
    }

    /// Ends the one that has been idle for longest; tells whether there is one.
    ///
    /// One that was active since it was last looked at goes behind the others instead.
    fn end_first_of(&mut self, phase: Phase) -> bool {
        let reason = "it makes room for another";
        let pass = self.next;
        while let Some((&key, entry)) = self.entries.range_mut(phase.all()).next() {
            if key.1 >= pass {
                // All have been active.
                let mut all = self.entries.range(phase.all());
                let first = all.find(|(_, entry)| !entry.activity.stays());
                let first = first.map(|(key, _)| *key);
                first.into_iter().for_each(|key| self.end(key, reason));
                return first.is_some();
            }
            let count = entry.activity.count.load(Relaxed);
            let is_active = std::mem::replace(&mut entry.seen, count) != count;
            if !is_active && !entry.activity.stays() {
                self.end(key, reason);
                return true;
            }
            if let Some(entry) = self.remove(key) {
                self.insert(phase, entry);
            }
        }
        false
    }
}

impl Activity {
    /// Returns the key of its entry; to be called under the lock.
    fn key(&self) -> Key {
        let phase = self.phase.load(Relaxed);
        let phase = Phase::EVICTED.get(usize::from(phase));
        let phase = phase.copied().unwrap_or(Phase::Peer);
        (phase, self.number.load(Relaxed))
    }

    fn stays(&self) -> bool {
        self.is_served.load(Relaxed) || self.is_known.load(Relaxed)
    }
}

/// Takes note that a name server knows the writer of a datagram input, which then does not make room.
#[derive(Clone, Debug)]
pub(super) struct KnownWriter(Arc<Activity>);

impl KnownWriter {
    pub(super) fn set(&self) {
        self.0.is_known.store(true, Relaxed);
    }
}

impl ConnectionSlot {
    /// Takes note of a message, or of the end of a wait for a reply.
    #[inline]
    pub(super) fn spoke(&mut self) {
        // Nobody else writes these two.
        let count = self.activity.count.load(Relaxed);
        self.activity.count.store(count + 1, Relaxed);
        self.activity.is_served.store(false, Relaxed);
        if self.is_silent {
            self.transition_to(Phase::Anonymous, |_| ());
        }
    }

    /// Takes note that a reply is being made.
    pub(super) fn waits(&self) {
        self.activity.is_served.store(true, Relaxed);
    }

    /// Takes note that the connection says it is from a port.
    pub(super) fn is_peer(&mut self, name: &str) {
        self.transition_to(Phase::Peer, |entry| entry.peer = Some(name.into()));
    }

    /// Takes note that messages come in datagrams, from a writer that is not known yet; tells whether there is room.
    pub(super) fn sends_datagrams(&mut self) -> bool {
        let most = port_limits::datagram_inputs();
        {
            let mut state = self.slots.state();
            while state.datagrams >= most {
                if !state.end_first_of(Phase::UnknownWriter) {
                    return false;
                }
            }
        }
        self.transition_to(Phase::UnknownWriter, |entry| entry.sends_datagrams = true);
        true
    }

    /// Returns whether it was told to end, to make room or because its header was overdue.
    pub(super) fn has_ended(&self) -> bool {
        self.activity.has_ended.load(Relaxed)
    }

    pub(super) fn known_writer(&self) -> KnownWriter {
        KnownWriter(self.activity.clone())
    }

    /// Takes note that the port writes to the connection from now on, and who reads.
    pub(super) fn reads(&mut self, send_queue: &Arc<SendQueue>, reader: &str) {
        let is_port = is_port(reader);
        let phase = match is_port {
            true => Phase::Peer,
            false => Phase::Viewer,
        };
        let ending = Ending::Output(Arc::downgrade(send_queue));
        self.transition_to(phase, |entry| {
            entry.ending = ending;
            entry.peer = is_port.then(|| reader.into());
        });
    }

    fn transition_to(&mut self, phase: Phase, change: impl FnOnce(&mut Entry)) {
        let mut state = self.slots.state();
        // Else it has been ended, and will know soon.
        if let Some(mut entry) = state.remove(self.activity.key()) {
            change(&mut entry);
            state.insert(phase, entry);
        }
        self.is_silent = false;
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        let mut state = self.slots.state();
        state.remove(self.activity.key());
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::port::dedicated_thread::ControlReceiver;

    struct Guest {
        place: ConnectionSlot,
        _steering: ConnectionControl,
        control_receiver: ControlReceiver,
    }

    impl Guest {
        fn has_ended(&mut self) -> bool {
            let mut ended = tokio_test_poll(self.control_receiver.clone());
            ended.take().is_some()
        }
    }

    fn tokio_test_poll(mut control_receiver: ControlReceiver) -> Option<()> {
        use std::task::{Context, Poll, Waker};
        let mut ended = std::pin::pin!(control_receiver.ended());
        match ended.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(()) => Some(()),
            Poll::Pending => None,
        }
    }

    fn admit(slots: &Arc<ConnectionSlots>, most: usize) -> Option<Guest> {
        let (control, control_receiver) = ConnectionControl::new();
        let due = Some(Instant::now() + Duration::from_secs(30));
        let place = slots.admit_up_to(most, &control, due)?;
        Some(Guest {
            place,
            _steering: control,
            control_receiver,
        })
    }

    #[test]
    fn silent_connections_make_room_first_then_idle_anonymous_ones_and_ports_never() {
        let slots = Arc::<ConnectionSlots>::default();
        let mut guests: Vec<_> = (0..4).map(|_| admit(&slots, 4).unwrap()).collect();
        guests[0].place.spoke();
        guests[0].place.is_peer("/p");
        guests[1].place.spoke();
        guests[2].place.spoke();
        let mut fifth = admit(&slots, 4).unwrap();
        assert!(guests[3].has_ended(), "the silent one");
        fifth.place.spoke();
        fifth.place.is_peer("/p");
        // Both anonymous ones were active, and are looked at for the first time.
        let mut sixth = admit(&slots, 4).unwrap();
        assert!(guests[1].has_ended());
        sixth.place.spoke();
        sixth.place.is_peer("/p");
        // One more has spoken, the other has not.
        guests[2].place.waits();
        assert!(admit(&slots, 4).is_none(), "it is being served");
        guests[2].place.spoke();
        let mut seventh = admit(&slots, 4).unwrap();
        assert!(guests[2].has_ended());
        seventh.place.spoke();
        seventh.place.is_peer("/p");
        assert!(admit(&slots, 4).is_none() && !slots.make_room());
        for peer in [&mut guests[0], &mut fifth, &mut sixth, &mut seventh] {
            assert!(!peer.has_ended());
        }
        drop(seventh);
        assert!(admit(&slots, 4).is_some());
    }

    #[test]
    fn an_active_anonymous_connection_outlives_an_idle_one() {
        let slots = Arc::<ConnectionSlots>::default();
        let mut guests: Vec<_> = (0..3).map(|_| admit(&slots, 3).unwrap()).collect();
        guests.iter_mut().for_each(|guest| guest.place.spoke());
        // All were active; the first makes room, the others have been looked at.
        let mut newcomer = admit(&slots, 3).unwrap();
        assert!(guests[0].has_ended());
        newcomer.place.spoke();
        guests[1].place.spoke();
        let _another = admit(&slots, 3).unwrap();
        assert!(guests[2].has_ended() && !guests[1].has_ended() && !newcomer.has_ended());
    }

    #[test]
    fn overdue_headers_end_connections() {
        let slots = Arc::<ConnectionSlots>::default();
        let now = Instant::now();
        let mut guests: Vec<_> = (0..2).map(|_| admit(&slots, 9).unwrap()).collect();
        guests[1].place.spoke();
        let (own, _keep) = ConnectionControl::new();
        let _own_limits = slots.admit_up_to(9, &own, None).unwrap();
        let next = slots.end_overdue(now).unwrap();
        assert!(next > now && !guests[0].has_ended());
        assert_eq!(slots.end_overdue(next), None);
        assert!(guests[0].has_ended() && !guests[1].has_ended());
        assert_eq!(slots.state().entries.len(), 2);
    }

    #[test]
    fn a_port_that_no_name_server_knows_is_anonymous() {
        let slots = Arc::<ConnectionSlots>::default();
        let now = Instant::now();
        let mut guests: Vec<_> = (0..4).map(|_| admit(&slots, 4).unwrap()).collect();
        guests[0].place.is_peer("/a");
        guests[1].place.is_peer("/b");
        assert!(!slots.wants_to_know_of(4, now));
        guests[2].place.is_peer("/c");
        assert!(slots.wants_to_know_of(4, now));
        assert!(!slots.wants_to_know_of(4, now), "not again at once");
        guests[3].place.is_peer("/d");
        assert!(admit(&slots, 4).is_none());
        let unknown = slots.unknown_peers();
        let names: Vec<_> = unknown.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(names, ["/a", "/b", "/c", "/d"]);
        unknown[0].0.is_known.store(true, Relaxed);
        slots.demote(&unknown[1].0);
        assert_eq!(slots.unknown_peers().len(), 2);
        let _newcomer = admit(&slots, 4).unwrap();
        assert!(guests[1].has_ended() && !guests[0].has_ended());
        drop(guests);
        assert_eq!(slots.state().peers, 0);
        assert_eq!(slots.state().entries.len(), 1);
    }

    /// Requests that take long held all places, each by an anonymous caller.
    #[test]
    fn callers_that_wait_hold_half_of_the_places() {
        let slots = Arc::<ConnectionSlots>::default();
        let mut guests: Vec<_> = (0..4).map(|_| admit(&slots, 4).unwrap()).collect();
        for guest in &mut guests {
            guest.place.spoke();
            guest.place.waits();
        }
        // A port waits as long as it likes.
        guests[0].place.is_peer("/port");
        assert!(
            admit(&slots, 4).is_some(),
            "three callers, and two may wait"
        );
        assert!(guests[1].has_ended());
        let mut fifth = admit(&slots, 4).unwrap();
        fifth.place.is_peer("/other");
        assert!(admit(&slots, 4).is_none(), "two callers wait");
        let ended: Vec<_> = guests.iter_mut().map(Guest::has_ended).collect();
        assert_eq!(ended, [false, true, false, false]);
    }
}
