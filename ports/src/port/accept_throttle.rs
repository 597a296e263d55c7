//! How fast a port lets newcomers in.
//!
//! What a newcomer costs until it has said something sensible is paid by those who are connected. So a port to which garbage
//! comes in a flood lets newcomers in one by one for a while, with a pause after each; the system keeps some of those who
//! wait, and tells the others to try again. A port that has a list of its callers does not: it lives from newcomers, who
//! come for one answer each.

use std::time::{Duration, Instant};

/// Broken connections per second that are no flood.
const TOLERATED_FAILURES_PER_SECOND: f64 = 200.0;
/// How many may break at once.
const MAX_FAILURE_BURST: f64 = 20.0;
/// For how long a flood is remembered.
const THROTTLE_DURATION: Duration = Duration::from_secs(10);
/// After each newcomer, in a flood.
pub(super) const ACCEPT_INTERVAL: Duration = Duration::from_millis(2);

/// The door of a port.
#[derive(Debug)]
pub(super) struct AcceptThrottle {
    /// Connections that broke, less those that were usual in the meantime.
    excess_failures: f64,
    /// When that was.
    at: Instant,
    throttled_until: Instant,
}

impl AcceptThrottle {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            excess_failures: 0.0,
            at: now,
            throttled_until: now,
        }
    }

    /// A connection broke, was broken off for the garbage that came, or went again at once without a word.
    pub(super) fn record_failure(&mut self, now: Instant) {
        let usual = TOLERATED_FAILURES_PER_SECOND * (now - self.at).as_secs_f64();
        self.excess_failures = (self.excess_failures - usual).max(0.0) + 1.0;
        self.at = now;
        if self.excess_failures > MAX_FAILURE_BURST {
            self.excess_failures = MAX_FAILURE_BURST;
            self.throttled_until = now + THROTTLE_DURATION;
        }
    }

    /// Whether newcomers come one by one.
    pub(super) fn is_throttling(&self, now: Instant) -> bool {
        now < self.throttled_until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A door after so many broken connections a second for a second.
    fn after(rate: u32) -> (AcceptThrottle, Instant) {
        let begin = Instant::now();
        let mut throttle = AcceptThrottle::new(begin);
        let mut now = begin;
        for _ in 0..rate {
            now += Duration::from_secs(1) / rate;
            throttle.record_failure(now);
        }
        (throttle, now)
    }

    #[test]
    fn occasional_invalid_connections_are_not_throttled() {
        let (throttle, now) = after(150);
        assert!(!throttle.is_throttling(now));
    }

    #[test]
    fn a_flood_is_throttled_until_it_expires() {
        let (throttle, now) = after(5000);
        assert!(throttle.is_throttling(now));
        assert!(!throttle.is_throttling(now + THROTTLE_DURATION));
    }

    #[test]
    fn continued_failures_keep_the_throttle_on() {
        let (mut throttle, mut now) = after(5000);
        for _ in 0..10_000 {
            assert!(throttle.is_throttling(now));
            now += ACCEPT_INTERVAL + Duration::from_millis(1);
            throttle.record_failure(now);
        }
    }
}
