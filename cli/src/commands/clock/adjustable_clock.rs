//! A time that can be paused, stepped and made faster or slower.

use std::ops::RangeInclusive;
use std::time::Instant;

use yarp_wire::{Bottle, Value};

/// Seconds of the clock per second that a request may ask for.
pub(super) const RATE_RANGE: RangeInclusive<f64> = 0.001..=1000.0;
/// Largest step that a request may ask for, s.
pub(super) const MAX_STEP: f64 = 86_400.0;

/// A time that passes at a rate of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct AdjustableClock {
    /// Time shown at `since`, s.
    base: f64,
    since: Instant,
    rate: f64,
    paused: bool,
}

impl AdjustableClock {
    /// Creates a clock that shows `base` seconds at `now`.
    pub(super) fn new(base: f64, rate: f64, paused: bool, now: Instant) -> Self {
        Self {
            base,
            since: now,
            rate,
            paused,
        }
    }

    /// Returns the time shown, in seconds.
    pub(super) fn time(&self, now: Instant) -> f64 {
        match self.paused {
            true => self.base,
            false => {
                self.base + now.saturating_duration_since(self.since).as_secs_f64() * self.rate
            }
        }
    }

    /// Returns the seconds of the clock per second while it runs.
    pub(super) fn rate(&self) -> f64 {
        self.rate
    }

    /// Returns whether the clock is paused.
    pub(super) fn is_paused(&self) -> bool {
        self.paused
    }

    /// Pauses the clock, or lets it go on from the time it shows.
    pub(super) fn set_paused(&mut self, paused: bool, now: Instant) {
        self.rebase(now);
        self.paused = paused;
    }

    /// Adds seconds to the time.
    pub(super) fn step(&mut self, seconds: f64) {
        self.base += seconds;
    }

    /// Changes the rate; the time does not jump.
    pub(super) fn set_rate(&mut self, rate: f64, now: Instant) {
        self.rebase(now);
        self.rate = rate;
    }

    fn rebase(&mut self, now: Instant) {
        self.base = self.time(now);
        self.since = now;
    }
}

/// Returns a time in the form of stock's clocks: whole seconds, and nanoseconds.
pub(super) fn time_bottle(seconds: f64) -> Bottle {
    let whole = seconds.trunc();
    let parts = [whole, (seconds - whole) * 1e9];
    // Seconds have 32 bits, so they stop in 2038.
    parts
        .map(|part| Value::Int32(part as i32))
        .into_iter()
        .collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_clock_begins_at_its_base_and_has_its_own_rate() {
        let start = Instant::now();
        let clock = AdjustableClock::new(100.0, 0.5, false, start);
        assert_eq!(clock.time(start), 100.0);
        assert_eq!(clock.time(start + Duration::from_secs(3)), 101.5);
    }

    #[test]
    fn no_change_but_a_step_makes_the_time_jump() {
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let mut clock = AdjustableClock::new(0.0, 1.0, false, start);
        clock.set_paused(true, at(10));
        assert_eq!(clock.time(at(15)), 10.0);
        clock.step(2.5);
        assert_eq!(clock.time(at(16)), 12.5);
        clock.set_rate(10.0, at(17));
        assert_eq!(clock.time(at(18)), 12.5);
        clock.set_paused(false, at(20));
        assert_eq!(clock.time(at(21)), 22.5);
        clock.set_rate(1.0, at(21));
        assert_eq!(clock.time(at(22)), 23.5);
        clock.set_paused(false, at(22));
        assert_eq!(clock.time(at(22)), 23.5);
    }

    #[test]
    fn a_time_is_two_integers() {
        assert_eq!(time_bottle(0.0).to_string(), "0 0");
        assert_eq!(time_bottle(101.5).to_string(), "101 500000000");
        assert_eq!(time_bottle(-1.25).to_string(), "-1 -250000000");
        assert_eq!(time_bottle(1e12).get(0), Some(&Value::Int32(i32::MAX)));
    }
}
