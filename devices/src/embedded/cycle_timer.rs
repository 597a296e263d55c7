//! A timer with a fixed rate, which counts missed deadlines.

use std::time::{Duration, Instant};

/// Deadlines at equal distances. A cycle that ends after the next deadline has missed it; missed cycles are skipped,
/// not run in a burst.
///
/// ```
/// use std::time::{Duration, Instant};
/// use yarp_devices::embedded::PeriodicTimer;
///
/// let (start, period) = (Instant::now(), Duration::from_millis(2));
/// let mut pace = PeriodicTimer::new(start, period);
/// assert_eq!(pace.next(), start + period);
/// pace.done(start + period * 3 / 2);
/// // This one was due at 4 ms and took until 9 ms: those of 6 and 8 ms are missed.
/// pace.done(start + period * 9 / 2);
/// assert_eq!((pace.timing().cycles, pace.timing().missed), (2, 2));
/// assert_eq!(pace.next(), start + period * 5);
/// ```
#[derive(Clone, Debug)]
pub struct PeriodicTimer {
    period: Duration,
    next: Instant,
    timing: CycleStatistics,
}

/// Statistics of a [`PeriodicTimer`].
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct CycleStatistics {
    /// Cycles that were carried out.
    pub cycles: u64,
    /// Cycles that were skipped because the previous one had not ended in time.
    pub missed: u64,
    /// The longest time from when a cycle was due until it was done.
    pub longest: Duration,
}

impl PeriodicTimer {
    /// Creates a timer whose first cycle is due one period after `start`; a period is at least 100 µs.
    pub fn new(start: Instant, period: Duration) -> Self {
        let period = period.max(Duration::from_micros(100));
        Self {
            period,
            next: start + period,
            timing: CycleStatistics::default(),
        }
    }

    /// Returns the start of the next cycle.
    pub fn next(&self) -> Instant {
        self.next
    }

    /// Ends the current cycle; returns the number of cycles that were missed because of it.
    pub fn done(&mut self, now: Instant) -> u64 {
        let taken = now.saturating_duration_since(self.next);
        let missed = u64::try_from(taken.as_nanos() / self.period.as_nanos()).unwrap_or(u64::MAX);
        self.timing.cycles += 1;
        self.timing.missed += missed;
        self.timing.longest = self.timing.longest.max(taken);
        self.next += self.period;
        if missed > 0 {
            let behind = taken.as_nanos() % self.period.as_nanos();
            let behind = Duration::from_nanos(u64::try_from(behind).unwrap_or_default());
            self.next = now - behind + self.period;
        }
        missed
    }

    /// Returns the statistics so far.
    pub fn timing(&self) -> CycleStatistics {
        self.timing
    }
}

impl CycleStatistics {
    /// The two together: sums, and the longer of the longest.
    pub fn and(self, other: Self) -> Self {
        Self {
            cycles: self.cycles + other.cycles,
            missed: self.missed + other.missed,
            longest: self.longest.max(other.longest),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deadlines_do_not_drift_and_a_pause_is_not_made_up_for() {
        let (start, period) = (Instant::now(), Duration::from_millis(2));
        let mut pace = PeriodicTimer::new(start, period);
        for cycle in 1..=100 {
            assert_eq!(pace.next(), start + period * cycle);
            assert_eq!(pace.done(pace.next() + Duration::from_micros(700)), 0);
        }
        assert_eq!(pace.done(pace.next() + Duration::from_secs(1)), 500);
        assert_eq!(pace.next(), start + period * 602);
        let timing = pace.timing();
        assert_eq!((timing.cycles, timing.missed), (101, 500));
        assert_eq!(timing.longest, Duration::from_secs(1));
    }
}
