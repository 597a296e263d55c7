//! How fast a port lets newcomers in.
//!
//! What a newcomer costs until it has said something sensible is paid by those who are connected. So a port to which garbage
//! comes in a flood lets newcomers in one by one for a while, with a pause after each; the system keeps some of those who
//! wait, and tells the others to try again. A port that has a list of its callers does not: it lives from newcomers, who
//! come for one answer each.

use std::time::{Duration, Instant};

/// Broken connections per second that are no flood.
const USUAL: f64 = 200.0;
/// How many may break at once.
const AT_ONCE: f64 = 20.0;
/// For how long a flood is remembered.
const MEMORY: Duration = Duration::from_secs(10);
/// After each newcomer, in a flood.
pub(super) const PAUSE: Duration = Duration::from_millis(2);

/// The door of a port.
#[derive(Debug)]
pub(super) struct Door {
    /// Connections that broke, less those that were usual in the meantime.
    broken: f64,
    /// When that was.
    at: Instant,
    wide_again: Instant,
}

impl Door {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            broken: 0.0,
            at: now,
            wide_again: now,
        }
    }

    /// A connection broke, was broken off for the garbage that came, or went again at once without a word.
    pub(super) fn broke(&mut self, now: Instant) {
        let usual = USUAL * (now - self.at).as_secs_f64();
        self.broken = (self.broken - usual).max(0.0) + 1.0;
        self.at = now;
        if self.broken > AT_ONCE {
            self.broken = AT_ONCE;
            self.wide_again = now + MEMORY;
        }
    }

    /// Whether newcomers come one by one.
    pub(super) fn is_narrow(&self, now: Instant) -> bool {
        now < self.wide_again
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A door after so many broken connections a second for a second.
    fn after(rate: u32) -> (Door, Instant) {
        let begin = Instant::now();
        let mut door = Door::new(begin);
        let mut now = begin;
        for _ in 0..rate {
            now += Duration::from_secs(1) / rate;
            door.broke(now);
        }
        (door, now)
    }

    #[test]
    fn garbage_now_and_then_leaves_the_door_wide() {
        let (door, now) = after(150);
        assert!(!door.is_narrow(now));
    }

    #[test]
    fn a_flood_narrows_the_door_until_it_is_forgotten() {
        let (door, now) = after(5000);
        assert!(door.is_narrow(now));
        assert!(!door.is_narrow(now + MEMORY));
    }

    #[test]
    fn what_comes_through_a_narrow_door_keeps_it_narrow() {
        let (mut door, mut now) = after(5000);
        for _ in 0..10_000 {
            assert!(door.is_narrow(now));
            now += PAUSE + Duration::from_millis(1);
            door.broke(now);
        }
    }
}
