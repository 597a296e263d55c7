//! The time of a clock on the network.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::Waker;
use std::time::{Duration, Instant};

/// Largest number of seconds that a clock may show; stock's clocks have 31 bits.
const MAX_SECONDS: i64 = u32::MAX as i64;
/// Nanoseconds in a second.
const NANOSECONDS: i64 = 1_000_000_000;

/// Time that advances only when a clock says so.
///
/// It has two faces. [`time`](Self::time) is the newest time of the clock, and jumps back when the clock does.
/// [`elapsed`](Self::elapsed) is the sum of the clock's steps forward: it never decreases, and waits refer to it, so that a
/// clock that starts anew prolongs no wait.
///
/// ```
/// use std::time::Duration;
/// use yarp_devices::clock::NetworkTime;
///
/// let time = NetworkTime::new("/clock");
/// for seconds in [100, 103, 0, 1] {
///     time.tick(seconds, 500_000_000).unwrap();
/// }
/// assert_eq!(time.time(), Some(1.5));
/// assert_eq!(time.elapsed(), Duration::from_secs(4));
/// ```
#[derive(Debug)]
pub struct NetworkTime {
    clock: String,
    /// Instant of no elapsed time.
    origin: Instant,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// The newest time of the clock.
    time: Option<Duration>,
    elapsed: Duration,
    /// Real time of the newest message, and of the newest one with another time.
    ticked: Option<Instant>,
    advanced: Option<Instant>,
    waits: Vec<Wait>,
    next_wait: u64,
}

#[derive(Debug)]
struct Wait {
    id: u64,
    deadline: Duration,
    waker: Waker,
}

/// A message of a clock that is no time.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
#[error(
    "expected 0 to {MAX_SECONDS} seconds and 0 to 999999999 nanoseconds, got {seconds} and {nanoseconds}"
)]
pub struct InvalidTick {
    /// Seconds of the message.
    pub seconds: i64,
    /// Nanoseconds of the message.
    pub nanoseconds: i64,
}

/// Real time since a clock was heard.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct ClockStatus {
    /// Time since the newest message.
    pub since_tick: Duration,
    /// Time since the clock last showed another time than before.
    pub since_change: Duration,
}

impl NetworkTime {
    /// Creates the time of the clock with this port name, before its first message.
    pub fn new(clock: &str) -> Self {
        Self {
            clock: clock.to_owned(),
            origin: Instant::now(),
            state: Mutex::default(),
        }
    }

    /// Returns the port name of the clock.
    pub fn clock(&self) -> &str {
        &self.clock
    }

    /// Takes a message of the clock: whole seconds, and nanoseconds. Wakes the waits whose deadline it reaches.
    ///
    /// Errors: [`InvalidTick`] for values out of range; nothing changes then.
    pub fn tick(&self, seconds: i64, nanoseconds: i64) -> Result<(), InvalidTick> {
        self.tick_at(seconds, nanoseconds, Instant::now())
    }

    fn tick_at(&self, seconds: i64, nanoseconds: i64, at: Instant) -> Result<(), InvalidTick> {
        if !(0..=MAX_SECONDS).contains(&seconds) || !(0..NANOSECONDS).contains(&nanoseconds) {
            return Err(InvalidTick {
                seconds,
                nanoseconds,
            });
        }
        let whole = Duration::from_secs(seconds.unsigned_abs());
        let time = whole + Duration::from_nanos(nanoseconds.unsigned_abs());
        let mut state = self.state();
        let step = state
            .time
            .map_or(Duration::ZERO, |last| time.saturating_sub(last));
        state.elapsed = state.elapsed.saturating_add(step);
        state.ticked = Some(at);
        if state.time.replace(time) != Some(time) {
            state.advanced = Some(at);
        }
        let elapsed = state.elapsed;
        let due: Vec<Wait> = state
            .waits
            .extract_if(.., |wait| wait.deadline <= elapsed)
            .collect();
        drop(state);
        for wait in due {
            wait.waker.wake();
        }
        Ok(())
    }

    /// Returns the newest time of the clock, in seconds; `None` before its first message.
    pub fn time(&self) -> Option<f64> {
        self.state().time.map(|time| time.as_secs_f64())
    }

    /// Returns the sum of the clock's steps forward since its first message.
    pub fn elapsed(&self) -> Duration {
        self.state().elapsed
    }

    /// Returns [`elapsed`](Self::elapsed) as an instant, for code that works with deadlines.
    pub fn instant(&self) -> Instant {
        let elapsed = self.elapsed();
        self.origin.checked_add(elapsed).unwrap_or(self.origin)
    }

    /// Returns how long the clock has been silent, and standing still; `None` before its first message.
    pub fn status(&self) -> Option<ClockStatus> {
        let state = self.state();
        Some(ClockStatus {
            since_tick: state.ticked?.elapsed(),
            since_change: state.advanced?.elapsed(),
        })
    }

    /// Registers a wait that ends at `deadline`, under the id it had, if any. Returns `None` when the deadline has passed.
    pub(super) fn register(
        &self,
        deadline: Instant,
        id: Option<u64>,
        waker: &Waker,
    ) -> Option<u64> {
        let deadline = deadline.saturating_duration_since(self.origin);
        let mut state = self.state();
        if deadline <= state.elapsed {
            return None;
        }
        let known = state.waits.iter_mut().find(|wait| Some(wait.id) == id);
        if let Some(known) = known {
            known.waker.clone_from(waker);
            return id;
        }
        let id = state.next_wait;
        state.next_wait += 1;
        state.waits.push(Wait {
            id,
            deadline,
            waker: waker.clone(),
        });
        Some(id)
    }

    /// Forgets a wait.
    pub(super) fn unregister(&self, id: u64) {
        self.state().waits.retain(|wait| wait.id != id);
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // The state is whole between any two calls.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_no_time_change_nothing() {
        let time = NetworkTime::new("/clock");
        time.tick(5, 0).unwrap();
        for (seconds, nanoseconds) in [
            (-1, 0),
            (6, -1),
            (6, NANOSECONDS),
            (MAX_SECONDS + 1, 0),
            (i64::MIN, i64::MIN),
            (i64::MAX, i64::MAX),
        ] {
            let refused = time.tick(seconds, nanoseconds);
            assert_eq!(
                refused,
                Err(InvalidTick {
                    seconds,
                    nanoseconds
                })
            );
        }
        assert_eq!((time.time(), time.elapsed()), (Some(5.0), Duration::ZERO));
        time.tick(MAX_SECONDS, NANOSECONDS - 1).unwrap();
    }

    #[test]
    fn a_clock_that_jumps_without_end_overflows_nothing() {
        let time = NetworkTime::new("/clock");
        for _ in 0..10_000 {
            time.tick(0, 0).unwrap();
            time.tick(MAX_SECONDS, 0).unwrap();
        }
        assert!(time.instant() >= time.origin);
    }

    #[test]
    fn a_clock_that_repeats_its_time_ticks_but_stands() {
        let time = NetworkTime::new("/clock");
        assert_eq!(time.status(), None);
        let Some(past) = Instant::now().checked_sub(Duration::from_secs(60)) else {
            return;
        };
        time.tick_at(5, 0, past).unwrap();
        time.tick(5, 0).unwrap();
        let status = time.status().unwrap();
        let minute = Duration::from_secs(60);
        assert!(status.since_change >= minute && status.since_tick < minute);
        time.tick(4, 0).unwrap();
        assert!(time.status().unwrap().since_change < minute);
    }
}
