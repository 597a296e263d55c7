//! A timer with a fixed rate, which counts missed deadlines.

use std::fmt;
use std::time::{Duration, Instant};

use crate::clock::TimeSource;

/// Shortest period; a period of 0 would never end.
pub const MIN_PERIOD: Duration = Duration::from_micros(100);
/// Time that [`MissedCycles::CatchUp`] makes up for.
const MAX_CATCH_UP: Duration = Duration::from_millis(100);
/// The same for a clock on the network, which advances in steps.
const MAX_NETWORK_CATCH_UP: Duration = Duration::from_secs(10);

/// Deadlines at equal distances.
///
/// ```
/// use std::time::{Duration, Instant};
/// use yarp_devices::periodic_timer::{MissedCycles, PeriodicTimer};
///
/// let (start, period) = (Instant::now(), Duration::from_millis(2));
/// let mut timer = PeriodicTimer::new(start, period, MissedCycles::Skip);
/// assert_eq!(timer.next(), start + period);
/// timer.done(start + period * 3 / 2);
/// // This one was due at 4 ms and took until 9 ms: those of 6 and 8 ms are missed.
/// timer.done(start + period * 9 / 2);
/// assert_eq!((timer.statistics().cycles, timer.statistics().missed), (2, 2));
/// assert_eq!(timer.next(), start + period * 5);
/// ```
#[derive(Clone, Debug)]
pub struct PeriodicTimer {
    period: Duration,
    next: Instant,
    missed_cycles: MissedCycles,
    max_catch_up: Duration,
    source: TimeSource,
    statistics: CycleStatistics,
}

/// Treatment of cycles that were due while an earlier one took too long.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum MissedCycles {
    /// Leaves them out; later ones keep their deadlines.
    Skip,
    /// Carries them out one after the other, as a model that keeps up with time needs them. After a pause of the machine of
    /// more than 100 ms, or a step of more than 10 s of a clock on the network, the deadlines start anew.
    CatchUp,
    /// Starts the deadlines anew, so that no cycle comes less than a period after the previous one: for commands in small steps.
    Restart,
}

/// Statistics of a [`PeriodicTimer`].
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct CycleStatistics {
    /// Cycles that were carried out.
    pub cycles: u64,
    /// Cycles that were left out because the previous one had not ended in time.
    pub missed: u64,
    /// Cycles that were more than a period late.
    pub late: u64,
    /// The longest time from when a cycle was due until it was done.
    pub longest: Duration,
    /// Number of cycles by the time from when they were due until they were done.
    pub delays: DelayHistogram,
}

/// Upper ends of the ranges of a [`DelayHistogram`], µs; the last range has none.
const DELAY_BOUNDS: [u64; 8] = [50, 100, 200, 500, 1_000, 2_000, 5_000, 10_000];

/// Numbers of cycles by their delay.
///
/// ```
/// use std::time::Duration;
/// use yarp_devices::periodic_timer::DelayHistogram;
///
/// let mut delays = DelayHistogram::default();
/// for micros in [10, 50, 51, 99_000] {
///     delays.add(Duration::from_micros(micros));
/// }
/// assert_eq!(delays.to_string(), "2 to 50 us, 1 to 100 us, 1 above 10 ms");
/// ```
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct DelayHistogram([u64; DELAY_BOUNDS.len() + 1]);

impl DelayHistogram {
    /// Counts a cycle.
    pub fn add(&mut self, delay: Duration) {
        let reaches = |bound: &u64| delay <= Duration::from_micros(*bound);
        let range = DELAY_BOUNDS.iter().position(reaches);
        self.0[range.unwrap_or(DELAY_BOUNDS.len())] += 1;
    }

    /// Returns the sums of both.
    fn and(self, other: Self) -> Self {
        Self(std::array::from_fn(|range| self.0[range] + other.0[range]))
    }
}

/// The ranges that are not empty.
impl fmt::Display for DelayHistogram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let time = |micros: u64| match micros % 1000 {
            0 => format!("{} ms", micros / 1000),
            _ => format!("{micros} us"),
        };
        let mut separator = "";
        for (range, count) in self.0.iter().enumerate().filter(|(_, count)| **count > 0) {
            write!(f, "{separator}{count} ")?;
            match DELAY_BOUNDS.get(range) {
                Some(bound) => write!(f, "to {}", time(*bound))?,
                None => write!(f, "above {}", time(DELAY_BOUNDS[range - 1]))?,
            }
            separator = ", ";
        }
        match separator {
            "" => write!(f, "none"),
            _ => Ok(()),
        }
    }
}

impl PeriodicTimer {
    /// Creates a timer whose first cycle is due one period after `start`. Shorter periods than [`MIN_PERIOD`] become that.
    pub fn new(start: Instant, period: Duration, missed_cycles: MissedCycles) -> Self {
        let period = period.max(MIN_PERIOD);
        Self {
            period,
            next: start + period,
            missed_cycles,
            max_catch_up: MAX_CATCH_UP,
            source: TimeSource::System,
            statistics: CycleStatistics::default(),
        }
    }

    /// Creates a timer on a time source; its first cycle is due one period from now.
    ///
    /// Not for hardware: a clock on the network may stand still.
    pub fn on(source: TimeSource, period: Duration, missed_cycles: MissedCycles) -> Self {
        let max_catch_up = match source.is_network() {
            true => MAX_NETWORK_CATCH_UP,
            false => MAX_CATCH_UP,
        };
        Self {
            max_catch_up,
            source: source.clone(),
            ..Self::new(source.instant(), period, missed_cycles)
        }
    }

    /// Returns the start of the next cycle.
    pub fn next(&self) -> Instant {
        self.next
    }

    /// Waits for the next cycle and begins it; returns false if `is_ending` does. Heeds that at once when the thread is unparked.
    pub fn wait(&mut self, is_ending: impl Fn() -> bool) -> bool {
        loop {
            if is_ending() {
                return false;
            }
            let now = self.source.instant();
            if now >= self.next {
                self.done(now);
                return true;
            }
            // May wake early, then the loop comes back here.
            self.source.park_until(self.next);
        }
    }

    /// Does `work` at once and in every cycle from then on, until `is_ending` returns true. Heeds that at once when the thread
    /// is unparked.
    pub fn repeat(&mut self, is_ending: impl Fn() -> bool, mut work: impl FnMut()) {
        while !is_ending() {
            work();
            self.wait(&is_ending);
        }
    }

    /// Ends the current cycle; returns the number of cycles that are left out because of it.
    pub fn done(&mut self, now: Instant) -> u64 {
        let taken = now.saturating_duration_since(self.next);
        self.statistics.cycles += 1;
        self.statistics.late += u64::from(taken > self.period);
        self.statistics.longest = self.statistics.longest.max(taken);
        self.statistics.delays.add(taken);
        let (missed, next) = match self.missed_cycles {
            MissedCycles::Skip => {
                let missed = taken.as_nanos() / self.period.as_nanos();
                let behind = taken.as_nanos() % self.period.as_nanos();
                let behind = Duration::from_nanos(u64::try_from(behind).unwrap_or_default());
                let next = match missed {
                    0 => self.next + self.period,
                    _ => now - behind + self.period,
                };
                (u64::try_from(missed).unwrap_or(u64::MAX), next)
            }
            MissedCycles::CatchUp if taken <= self.max_catch_up => (0, self.next + self.period),
            MissedCycles::CatchUp | MissedCycles::Restart => (0, self.next.max(now) + self.period),
        };
        self.statistics.missed += missed;
        self.next = next;
        missed
    }

    /// Returns the statistics so far.
    pub fn statistics(&self) -> CycleStatistics {
        self.statistics
    }
}

impl CycleStatistics {
    /// Returns both together: sums, and the longer of the longest.
    pub fn and(self, other: Self) -> Self {
        Self {
            cycles: self.cycles + other.cycles,
            missed: self.missed + other.missed,
            late: self.late + other.late,
            longest: self.longest.max(other.longest),
            delays: self.delays.and(other.delays),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    const PERIOD: Duration = Duration::from_millis(2);

    fn timer(missed_cycles: MissedCycles) -> (Instant, PeriodicTimer) {
        let start = Instant::now();
        (start, PeriodicTimer::new(start, PERIOD, missed_cycles))
    }

    #[test]
    fn deadlines_do_not_drift_and_a_pause_is_not_made_up_for() {
        let (start, mut timer) = timer(MissedCycles::Skip);
        for cycle in 1..=100 {
            assert_eq!(timer.next(), start + PERIOD * cycle);
            assert_eq!(timer.done(timer.next() + Duration::from_micros(700)), 0);
        }
        assert_eq!(timer.done(timer.next() + Duration::from_secs(1)), 500);
        assert_eq!(timer.next(), start + PERIOD * 602);
        let statistics = timer.statistics();
        let counted = (statistics.cycles, statistics.missed, statistics.late);
        assert_eq!(counted, (101, 500, 1));
        assert_eq!(statistics.longest, Duration::from_secs(1));
        let delays = statistics.delays.and(statistics.delays);
        assert_eq!(delays.to_string(), "200 to 1 ms, 2 above 10 ms");
        assert_eq!(DelayHistogram::default().to_string(), "none");
    }

    /// A cycle is late when the next one should have begun already.
    #[test]
    fn a_cycle_is_late_after_a_period() {
        let (_, mut timer) = timer(MissedCycles::Skip);
        timer.done(timer.next() + PERIOD);
        assert_eq!(timer.statistics().late, 0);
        timer.done(timer.next() + PERIOD + Duration::from_micros(1));
        assert_eq!(timer.statistics().late, 1);
    }

    #[test]
    fn late_cycles_are_made_up_for_unless_the_machine_paused() {
        let (start, mut timer) = timer(MissedCycles::CatchUp);
        let longest = Duration::from_millis(100);
        assert_eq!(timer.done(timer.next() + longest), 0);
        assert_eq!(timer.next(), start + PERIOD * 2);
        let pause = timer.next() + longest + Duration::from_millis(1);
        assert_eq!(timer.done(pause), 0);
        assert_eq!(timer.next(), pause + PERIOD);
        assert_eq!(timer.statistics().late, 2);
    }

    #[test]
    fn commands_in_steps_come_no_less_than_a_period_apart() {
        let (start, mut timer) = timer(MissedCycles::Restart);
        timer.done(timer.next());
        assert_eq!(timer.next(), start + PERIOD * 2);
        let late = timer.next() + Duration::from_millis(1);
        timer.done(late);
        assert_eq!(timer.next(), late + PERIOD);
    }

    #[test]
    fn a_period_of_nothing_becomes_the_shortest() {
        let start = Instant::now();
        let timer = PeriodicTimer::new(start, Duration::ZERO, MissedCycles::Skip);
        assert_eq!(timer.next(), start + MIN_PERIOD);
    }

    #[test]
    fn repeated_work_does_not_drift_and_missed_cycles_are_left_out() {
        let ending = Cell::new(false);
        let start = Instant::now();
        let mut times = Vec::new();
        timer(MissedCycles::Skip).1.repeat(
            || ending.get(),
            || {
                times.push(start.elapsed());
                if times.len() == 3 {
                    std::thread::sleep(Duration::from_millis(9));
                }
                ending.set(times.len() == 20);
            },
        );
        // Nothing runs before its deadline, and the long third cycle costs the deadlines it overran.
        for (place, time) in times.iter().enumerate() {
            assert!(*time >= PERIOD * place as u32);
        }
        assert!(times[3] >= times[2] + Duration::from_millis(9));
        assert_eq!(times.len(), 20);
    }

    /// `docs/network-time.md`: at most 10 s of a single step of the clock.
    #[test]
    fn ten_seconds_of_a_step_of_a_network_clock_are_made_up_for_and_no_more() {
        for (step, caught_up) in [(10.0, true), (10.1, false)] {
            let time = std::sync::Arc::new(crate::clock::NetworkTime::new("/clock"));
            time.tick(100, 0).unwrap();
            let source = TimeSource::Network(time);
            let mut timer = PeriodicTimer::on(source, PERIOD, MissedCycles::CatchUp);
            let due = timer.next();
            let late = due + Duration::from_secs_f64(step);
            timer.done(late);
            let expected = if caught_up { due } else { late } + PERIOD;
            assert_eq!(timer.next(), expected, "{step} s");
        }
    }
}
