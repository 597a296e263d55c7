//! A thread that does something every so often.

use std::thread;
use std::time::{Duration, Instant};

/// Of machines that keep up with time. After a longer pause of the machine the loop continues from where it was.
const MAX_CATCH_UP: Duration = Duration::from_millis(100);
/// A period of 0 would never end.
const MIN_PERIOD: Duration = Duration::from_micros(100);

/// Periods that do not drift: the n-th ends n periods after the start.
#[derive(Debug)]
pub(crate) struct PeriodicTimer {
    period: Duration,
    deadline: Instant,
    late: u64,
    /// Maximum time that is caught up with.
    max_catch_up: Duration,
}

impl PeriodicTimer {
    pub(crate) fn new(period: Duration) -> Self {
        let period = period.max(MIN_PERIOD);
        Self {
            period,
            deadline: Instant::now() + period,
            late: 0,
            max_catch_up: MAX_CATCH_UP,
        }
    }

    /// Disables catching up: for callers that command a machine in small steps, none of which may come too early.
    pub(crate) fn without_catch_up(period: Duration) -> Self {
        Self {
            max_catch_up: Duration::ZERO,
            ..Self::new(period)
        }
    }

    /// Waits for the end of the period; false if the loop shall end. Wakes up at once when the thread is unparked.
    pub(crate) fn wait(&mut self, is_ending: impl Fn() -> bool) -> bool {
        loop {
            if is_ending() {
                return false;
            }
            let now = Instant::now();
            if now >= self.deadline {
                self.go_on(now);
                return true;
            }
            // May wake early, then the loop comes back here.
            thread::park_timeout(self.deadline - now);
        }
    }

    fn go_on(&mut self, now: Instant) {
        let lateness = now - self.deadline;
        if lateness > self.period {
            self.late += 1;
        }
        if lateness > self.max_catch_up {
            self.deadline = now;
        }
        self.deadline += self.period;
    }

    /// Returns the number of periods that began more than a period late.
    pub(super) fn late(&self) -> u64 {
        self.late
    }
}
