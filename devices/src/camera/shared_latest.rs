//! The latest value, shared by one writer and any number of readers.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, TryLockError};

/// Places to write to. A reader that is stopped in the middle of taking holds one.
const SLOTS: usize = 8;

/// The latest value of one writer, for readers that never block it.
///
/// The writer tries slots until it finds one that no reader is copying from, and then publishes its number. A reader
/// copies the published slot; if the writer has reused it meanwhile, the reader gets a still newer value. Readers get
/// a clone, so the value should be cheap to clone: a [`Frame`](crate::image::Frame) shares its pixels.
#[derive(Debug)]
pub struct LatestValue<T> {
    slots: [Mutex<Option<T>>; SLOTS],
    newest: AtomicUsize,
}

impl<T> Default for LatestValue<T> {
    fn default() -> Self {
        Self {
            slots: std::array::from_fn(|_| Mutex::new(None)),
            newest: AtomicUsize::new(0),
        }
    }
}

impl<T: Clone> LatestValue<T> {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Puts something newer there; to be called by one thread only. Never waits.
    ///
    /// `false` in the unlikely case that every place was being taken from, and nothing was put.
    pub fn put(&self, newer: T) -> bool {
        let current = self.newest.load(Ordering::Relaxed);
        for step in 1..SLOTS {
            let place = (current + step) % SLOTS;
            let mut slot = match self.slots[place].try_lock() {
                Ok(slot) => slot,
                Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
                Err(TryLockError::WouldBlock) => continue,
            };
            *slot = Some(newer);
            // Before the slot is released: a reader that sees this one never gets an older one afterwards.
            self.newest.store(place, Ordering::Release);
            return true;
        }
        false
    }

    /// The newest, if anything was ever put. Waits for other readers at most, for as long as they need to clone.
    pub fn get(&self) -> Option<T> {
        let place = self.newest.load(Ordering::Acquire);
        let slot = self.slots[place].lock();
        slot.unwrap_or_else(PoisonError::into_inner).clone()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    #[test]
    fn a_reader_gets_what_was_put_last() {
        let newest = LatestValue::new();
        assert_eq!(newest.get(), None::<u32>);
        for number in 0..100 {
            assert!(newest.put(number));
            assert_eq!(newest.get(), Some(number));
            assert_eq!(newest.get(), Some(number));
        }
    }

    #[test]
    fn a_reader_that_stops_in_the_middle_does_not_hold_up_the_writer() {
        let newest = LatestValue::new();
        newest.put(0);
        // As many readers as may be stopped at once, each holding another place.
        let held: Vec<_> = newest.slots.iter().take(SLOTS - 2).collect();
        let held: Vec<_> = held.iter().map(|slot| slot.lock().unwrap()).collect();
        for number in 1..20 {
            assert!(newest.put(number), "a place is left");
        }
        drop(held);
        assert_eq!(newest.get(), Some(19));
        let all: Vec<_> = newest
            .slots
            .iter()
            .map(|slot| slot.lock().unwrap())
            .collect();
        assert!(!newest.put(20), "no place is left, and nobody waits");
        drop(all);
        assert_eq!(newest.get(), Some(19));
    }

    /// Two numbers that agree are shared; readers look for pairs that do not, and for older ones.
    #[test]
    fn nobody_sees_a_torn_or_an_older_one() {
        let newest = LatestValue::new();
        let over = AtomicBool::new(false);
        newest.put(vec![0_u64; 64]);
        std::thread::scope(|scope| {
            let readers: Vec<_> = (0..3)
                .map(|_| {
                    scope.spawn(|| {
                        let mut last = 0;
                        while !over.load(Ordering::Acquire) {
                            let seen = newest.get().expect("something was put");
                            assert!(seen.iter().all(|part| *part == seen[0]), "torn: {seen:?}");
                            assert!(seen[0] >= last, "{} after {last}", seen[0]);
                            last = seen[0];
                        }
                    })
                })
                .collect();
            for number in 1..20_000 {
                newest.put(vec![number; 64]);
            }
            over.store(true, Ordering::Release);
            readers
                .into_iter()
                .for_each(|reader| reader.join().unwrap());
        });
    }
}
