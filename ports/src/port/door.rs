//! How fast a port lets newcomers in.
//!
//! What a newcomer costs until it has said something sensible is paid by those who are connected. So a port to which garbage
//! comes in a flood lets newcomers in one by one, with a pause after each; the system keeps those who wait. A port that
//! has a list of its callers does not: it lives from newcomers, who come for one answer each.

use std::time::{Duration, Instant};

/// Broken connections per second that are no flood.
const USUAL: f64 = 200.0;
/// How many may break at once.
const AT_ONCE: f64 = 50.0;
/// More are not counted, so that a flood is forgotten within a second.
const MOST: f64 = AT_ONCE + USUAL / 2.0;
/// After each newcomer, in a flood.
const PAUSE: Duration = Duration::from_millis(2);

/// The door of a port.
#[derive(Debug)]
pub(super) struct Door {
    /// Connections that broke, less those that were usual in the meantime.
    broken: f64,
    /// When that was.
    at: Instant,
}

impl Door {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            broken: 0.0,
            at: now,
        }
    }

    /// A connection broke: what came on it was garbage.
    pub(super) fn broke(&mut self, now: Instant) {
        self.forget(now);
        self.broken = (self.broken + 1.0).min(MOST);
    }

    /// How long the door stays closed behind a newcomer.
    pub(super) fn pause(&mut self, now: Instant) -> Option<Duration> {
        self.forget(now);
        (self.broken > AT_ONCE).then_some(PAUSE)
    }

    fn forget(&mut self, now: Instant) {
        let usual = USUAL * (now - self.at).as_secs_f64();
        self.broken = (self.broken - usual).max(0.0);
        self.at = now;
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
    fn garbage_now_and_then_closes_no_door() {
        let (mut door, now) = after(150);
        assert_eq!(door.pause(now), None);
    }

    #[test]
    fn a_flood_narrows_the_door_until_it_has_been_over_for_a_second() {
        let (mut door, now) = after(5000);
        assert_eq!(door.pause(now), Some(PAUSE));
        assert_eq!(door.pause(now + Duration::from_secs(1)), None);
    }

    #[test]
    fn what_comes_through_a_narrow_door_keeps_it_narrow() {
        let (mut door, mut now) = after(5000);
        for _ in 0..10_000 {
            let pause = door.pause(now).expect("still a flood");
            now += pause + Duration::from_millis(1);
            door.broke(now);
        }
    }
}
