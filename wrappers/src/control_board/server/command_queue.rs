//! The command queue of the device: commands wait only while it executes an earlier one.
//!
//! Source of the policy: section 5.4.1 of the thesis on which the ports of the arm are modelled. A command in the
//! queue is replaced by a newer one that conflicts with it; one that was passed to the device is not.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::super::messages::{Action, Set, Setting};

/// Maximum number of queued commands; beyond that the oldest is dropped.
const CAPACITY: usize = 256;
/// The shortest time between two lines about drops.
const WARNING_INTERVAL: Duration = Duration::from_secs(5);

/// Kind of a command, which determines conflicts with others.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Kind {
    /// Positions, also relative ones: the newest is the target.
    Move,
    /// Anything else that is set.
    Other(Setting),
    /// Stop: goes first, and drops all commands in the queue for one of its axes.
    Stop,
}

impl Kind {
    /// Returns the kind of a queued command; `None` for commands that are executed at once.
    pub(super) fn of(set: &Set) -> Option<Self> {
        match set {
            Set::Act(Action::Stop, _) => Some(Self::Stop),
            Set::Values(setting, ..) => match setting {
                Setting::Position | Setting::Distance => Some(Self::Move),
                Setting::Velocity
                | Setting::DirectPosition
                | Setting::DirectVelocity
                | Setting::Torque
                | Setting::Current
                | Setting::DutyCycle => Some(Self::Other(*setting)),
                _ => None,
            },
            _ => None,
        }
    }

    /// Returns the kind of a streamed command, which is always queued.
    pub(super) fn of_streamed(setting: Setting) -> Self {
        match setting {
            Setting::Position | Setting::Distance => Self::Move,
            other => Self::Other(other),
        }
    }
}

/// A command in the queue. `T` notifies the sender of the outcome.
#[derive(Debug)]
pub(super) struct QueuedCommand<T> {
    pub(super) number: u64,
    pub(super) kind: Kind,
    /// One for each axis of the board, true if the command addresses it.
    pub(super) axes: Vec<bool>,
    pub(super) what: T,
}

impl<T> QueuedCommand<T> {
    /// Returns whether `newer` replaces this one.
    fn is_replaced_by(&self, newer: &Self) -> bool {
        match newer.kind {
            Kind::Stop => self.kind != Kind::Stop && self.shares_an_axis_with(newer),
            kind => {
                let mut pairs = self.axes.iter().zip(&newer.axes);
                // A command without axes cannot be replaced.
                self.kind == kind
                    && self.axes.contains(&true)
                    && pairs.all(|(&mine, &theirs)| theirs || !mine)
            }
        }
    }

    fn shares_an_axis_with(&self, other: &Self) -> bool {
        let mut pairs = self.axes.iter().zip(&other.axes);
        pairs.any(|(&mine, &theirs)| mine && theirs)
    }
}

/// A dropped command, and the number of the one that replaced it.
pub(super) type Dropped<T> = (QueuedCommand<T>, u64);

#[derive(Debug)]
pub(super) struct CommandQueue<T> {
    name: String,
    state: Mutex<State<T>>,
    /// Signalled when the device is free and a command is queued, or at the end.
    next: Condvar,
}

#[derive(Debug)]
struct State<T> {
    /// True while the device executes a command.
    busy: bool,
    waiting: VecDeque<QueuedCommand<T>>,
    over: bool,
    /// Orders dropped since the start.
    dropped: u64,
    last_warning: Option<(Instant, u64)>,
}

/// Holds the device for a command until it is dropped.
#[derive(Debug)]
pub(super) struct DeviceGuard<'a, T>(&'a CommandQueue<T>);

impl<T> Drop for DeviceGuard<'_, T> {
    fn drop(&mut self) {
        let mut state = self.0.lock();
        state.busy = false;
        if !state.waiting.is_empty() {
            self.0.next.notify_one();
        }
    }
}

impl<T> CommandQueue<T> {
    /// `name`: of the board, for the log.
    pub(super) fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            state: Mutex::new(State {
                busy: false,
                waiting: VecDeque::new(),
                over: false,
                dropped: 0,
                last_warning: None,
            }),
            next: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Acquires the device, if it is free and the queue is empty.
    pub(super) fn try_acquire(&self) -> Option<DeviceGuard<'_, T>> {
        let mut state = self.lock();
        if state.busy || state.over || !state.waiting.is_empty() {
            return None;
        }
        state.busy = true;
        Some(DeviceGuard(self))
    }

    /// Queues a command; returns those that it dropped.
    ///
    /// A command that does not fit, or comes after the end, is returned as dropped by 0.
    pub(super) fn enqueue(&self, newer: QueuedCommand<T>) -> Vec<Dropped<T>> {
        let mut state = self.lock();
        if state.over {
            return vec![(newer, 0)];
        }
        let number = newer.number;
        let mut dropped = Vec::new();
        let mut place = None;
        let mut at = 0;
        while at < state.waiting.len() {
            if state.waiting[at].is_replaced_by(&newer) {
                dropped.extend(state.waiting.remove(at).map(|older| (older, number)));
                place.get_or_insert(at);
            } else {
                at += 1;
            }
        }
        // It takes the place of what it dropped, so that two streams do not push each other to the end for ever; but
        // never in front of an older one about the same axes.
        let overtakes =
            |from: usize| (state.waiting.range(from..)).any(|one| one.shares_an_axis_with(&newer));
        let place = match (newer.kind, place) {
            (Kind::Stop, _) => 0,
            (_, Some(place)) if !overtakes(place) => place,
            _ => state.waiting.len(),
        };
        state.waiting.insert(place, newer);
        if state.waiting.len() > CAPACITY {
            // Not the stop in front.
            let oldest = state.waiting.iter().position(|one| one.kind != Kind::Stop);
            let oldest = oldest.and_then(|oldest| state.waiting.remove(oldest));
            dropped.extend(oldest.map(|oldest| (oldest, 0)));
        }
        if !state.busy {
            self.next.notify_one();
        }
        if !dropped.is_empty() {
            state.dropped += dropped.len() as u64;
            self.warn_about_drops(&mut state);
        }
        dropped
    }

    /// A line in the log, not more often than every 5 s.
    fn warn_about_drops(&self, state: &mut State<T>) {
        let now = Instant::now();
        let before = match state.last_warning {
            Some((last, _)) if now < last + WARNING_INTERVAL => return,
            Some((_, dropped)) => dropped,
            None => 0,
        };
        let newly = state.dropped - before;
        state.last_warning = Some((now, state.dropped));
        tracing::warn!(
            board = %self.name,
            "dropped {newly} commands for newer ones while the device was busy: \
             they arrive faster than the device accepts them"
        );
    }

    /// Waits for the next command and the device; `None` after the end.
    pub(super) fn next(&self) -> Option<(QueuedCommand<T>, DeviceGuard<'_, T>)> {
        let mut state = self.lock();
        loop {
            if state.over {
                return None;
            }
            if !state.busy
                && let Some(order) = state.waiting.pop_front()
            {
                state.busy = true;
                return Some((order, DeviceGuard(self)));
            }
            let woken = self.next.wait(state);
            state = woken.unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Returns the number of dropped commands.
    pub(super) fn dropped(&self) -> u64 {
        self.lock().dropped
    }

    /// Ends the queue: queued commands are dropped, and no more are accepted.
    pub(super) fn end(&self) {
        let mut state = self.lock();
        state.over = true;
        let left = std::mem::take(&mut state.waiting);
        drop(state);
        self.next.notify_all();
        drop(left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VELOCITY: Kind = Kind::Other(Setting::Velocity);

    fn order(number: u64, kind: Kind, axes: &[usize]) -> QueuedCommand<()> {
        let axes = (0..4).map(|axis| axes.contains(&axis)).collect();
        QueuedCommand {
            number,
            kind,
            axes,
            what: (),
        }
    }

    /// Returns the commands left in the queue, in their order, when these arrive while the device is busy; and which
    /// were dropped by which.
    fn left(orders: impl IntoIterator<Item = QueuedCommand<()>>) -> (Vec<u64>, Vec<(u64, u64)>) {
        let queue = CommandQueue::new("/test");
        let taking = queue.try_acquire().expect("nobody has it");
        assert!(queue.try_acquire().is_none());
        let orders = orders.into_iter();
        let dropped: Vec<_> = orders.flat_map(|order| queue.enqueue(order)).collect();
        assert_eq!(queue.dropped(), dropped.len() as u64);
        drop(taking);
        let mut left = Vec::new();
        while !queue.lock().waiting.is_empty() {
            assert!(queue.try_acquire().is_none(), "nobody overtakes what waits");
            let (order, _taking) = queue.next().expect("one waits");
            left.push(order.number);
        }
        assert!(queue.try_acquire().is_some());
        let by = |(order, by): &Dropped<()>| (order.number, *by);
        (left, dropped.iter().map(by).collect())
    }

    #[test]
    fn a_newer_order_of_its_kind_that_covers_its_axes_takes_its_place() {
        let moves = [
            order(1, Kind::Move, &[0, 1]),
            order(2, Kind::Move, &[0, 1, 2]),
            order(3, Kind::Move, &[0, 1, 2]),
        ];
        assert_eq!(left(moves), (vec![3], vec![(1, 2), (2, 3)]));
    }

    #[test]
    fn independent_orders_are_kept_in_their_order() {
        let orders = [
            order(1, Kind::Move, &[0]),
            order(2, VELOCITY, &[0]),
            order(3, Kind::Move, &[1]),
            // Covers neither.
            order(4, Kind::Move, &[1, 2]),
            order(5, Kind::Move, &[2]),
        ];
        assert_eq!(left(orders), (vec![1, 2, 4, 5], vec![(3, 4)]));
    }

    #[test]
    fn a_stream_keeps_its_place_so_that_another_cannot_hold_it_up() {
        let orders = [
            order(1, Kind::Move, &[0]),
            order(2, VELOCITY, &[1]),
            order(3, Kind::Move, &[0]),
        ];
        assert_eq!(left(orders), (vec![3, 2], vec![(1, 3)]));
    }

    #[test]
    fn an_order_never_overtakes_an_older_one_on_its_axes() {
        let orders = [
            order(1, Kind::Move, &[0]),
            order(2, Kind::Move, &[0, 1]),
            order(3, Kind::Move, &[0]),
        ];
        // 2 covers 1; 3 does not cover 2 and comes behind it.
        assert_eq!(left(orders), (vec![2, 3], vec![(1, 2)]));
        let orders = [
            order(1, Kind::Move, &[0]),
            order(2, VELOCITY, &[0]),
            order(3, Kind::Move, &[0]),
        ];
        assert_eq!(left(orders), (vec![2, 3], vec![(1, 3)]));
    }

    #[test]
    fn a_stop_goes_first_and_drops_whatever_would_move_its_axes() {
        let orders = [
            order(1, Kind::Move, &[0, 1]),
            order(2, VELOCITY, &[2]),
            order(3, Kind::Stop, &[1]),
        ];
        assert_eq!(left(orders), (vec![3, 2], vec![(1, 3)]));
    }

    #[test]
    fn what_has_no_room_or_comes_after_the_end_is_given_back() {
        let queue = CommandQueue::new("/test");
        let _taking = queue.try_acquire();
        for number in 0..CAPACITY as u64 {
            // Commands without axes: the device will refuse them, and they replace none.
            assert!(queue.enqueue(order(number, VELOCITY, &[])).is_empty());
        }
        let dropped = queue.enqueue(order(1000, VELOCITY, &[]));
        assert_eq!((dropped[0].0.number, dropped[0].1), (0, 0));
        queue.end();
        assert_eq!(queue.enqueue(order(1001, VELOCITY, &[]))[0].0.number, 1001);
        assert!(queue.next().is_none());
    }
}
