//! A limit on how often the same place in the code reports something.
//!
//! Whoever can make a port report something can make it do so a thousand times a second: bad connections, for example. Each
//! place in the code may report [`BURST`] lines at once and [`RATE`] lines per second on average.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::callsite::Identifier;

/// Lines that may come at once.
const BURST: u32 = 200;
/// Lines per second on average.
const RATE: f64 = 10.0;

/// Recent reports of each place in the code. Bounded by the size of the program.
#[derive(Debug)]
pub(super) struct Repeats {
    places: Mutex<Option<HashMap<Identifier, Allowance>>>,
}

#[derive(Debug)]
struct Allowance {
    /// Lines that may come now.
    lines: f64,
    /// When `lines` was true.
    since: Instant,
    left_out: u64,
}

impl Repeats {
    pub(super) const fn new() -> Self {
        Self {
            places: Mutex::new(None),
        }
    }

    /// Admits a line of a place in the code, and returns how many were left out since the last one; `None` if it is to be
    /// left out.
    pub(super) fn admit(&self, place: Identifier, now: Instant) -> Option<u64> {
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        let places = places.get_or_insert_default();
        let allowance = places.entry(place).or_insert(Allowance {
            lines: BURST.into(),
            since: now,
            left_out: 0,
        });
        allowance.admit(now)
    }
}

impl Allowance {
    fn admit(&mut self, now: Instant) -> Option<u64> {
        let passed: Duration = now.saturating_duration_since(self.since);
        self.lines = (self.lines + passed.as_secs_f64() * RATE).min(BURST.into());
        self.since = now;
        if self.lines < 1.0 {
            self.left_out += 1;
            return None;
        }
        self.lines -= 1.0;
        Some(std::mem::take(&mut self.left_out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_thinned_and_counted() {
        let begin = Instant::now();
        let mut allowance = Allowance {
            lines: BURST.into(),
            since: begin,
            left_out: 0,
        };
        let admitted = (0..1000).filter(|_| allowance.admit(begin).is_some());
        assert_eq!(admitted.count() as u32, BURST);
        let later = begin + Duration::from_secs_f64(1.05 / RATE);
        assert_eq!(allowance.admit(later), Some(1000 - u64::from(BURST)));
        assert_eq!(allowance.admit(later), None);
        let much_later = later + Duration::from_secs(3600);
        assert_eq!(allowance.admit(much_later), Some(1));
        let admitted = (0..1000).filter(|_| allowance.admit(much_later).is_some());
        assert_eq!(admitted.count() as u32, BURST - 1);
    }
}
