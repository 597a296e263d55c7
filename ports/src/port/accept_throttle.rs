//! Throttling of accepts after too many invalid connections.
//!
//! Established connections pay for the work spent on a new connection until it is identified as
//! valid. So a port that receives a flood of invalid connections accepts them one by one for a
//! while, with an interval after each; the system keeps some of the waiting ones in its backlog and
//! makes the others retry. A port with connection limits does not throttle: its purpose is many
//! connections with one request each.

use std::time::{Duration, Instant};

/// Tolerated rate of failed connections.
const TOLERATED_FAILURES_PER_SECOND: f64 = 200.0;
/// Maximum number of simultaneous failures.
const MAX_FAILURE_BURST: f64 = 20.0;
/// Duration of throttling after a flood.
const THROTTLE_DURATION: Duration = Duration::from_secs(10);
/// Interval after each accept while throttling.
pub(super) const ACCEPT_INTERVAL: Duration = Duration::from_millis(2);

/// Counts failed connections and decides whether to throttle.
#[derive(Debug)]
pub(super) struct AcceptThrottle {
    /// Failed connections, less the tolerated ones in the meantime.
    excess_failures: f64,
    /// Time of the last failure.
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

    /// Records a connection that failed, was closed for invalid data, or closed at once without
    /// sending any.
    pub(super) fn record_failure(&mut self, now: Instant) {
        let usual = TOLERATED_FAILURES_PER_SECOND * (now - self.at).as_secs_f64();
        self.excess_failures = (self.excess_failures - usual).max(0.0) + 1.0;
        self.at = now;
        if self.excess_failures > MAX_FAILURE_BURST {
            self.excess_failures = MAX_FAILURE_BURST;
            self.throttled_until = now + THROTTLE_DURATION;
        }
    }

    /// Returns whether accepts are throttled.
    pub(super) fn is_throttling(&self, now: Instant) -> bool {
        now < self.throttled_until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a throttle after this many failed connections per second, for one second.
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
