//! Increasing delays between attempts.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Pauses before attempts, each twice as long as the previous one, up to a maximum.
#[derive(Debug)]
pub(super) struct Backoff {
    first: Duration,
    longest: Duration,
    next: Duration,
}

impl Backoff {
    pub(super) fn new(first: Duration, longest: Duration) -> Self {
        Self {
            first,
            longest: longest.max(first),
            next: first,
        }
    }

    /// After something that worked the pauses begin anew.
    pub(super) fn reset(&mut self) {
        self.next = self.first;
    }

    fn next_delay(&mut self) -> Duration {
        let pause = self.next;
        self.next = (self.next * 2).min(self.longest);
        pause
    }

    /// Sleeps for the next pause, or until `ending` is set and the thread unparked.
    pub(super) fn wait(&mut self, ending: &AtomicBool) {
        sleep_until(Instant::now() + self.next_delay(), ending);
    }
}

/// Sleeps until then, or until `ending` is set and the thread unparked.
pub(super) fn sleep_until(deadline: Instant, ending: &AtomicBool) {
    while !ending.load(Ordering::Acquire) {
        let now = Instant::now();
        if now >= deadline {
            return;
        }
        thread::park_timeout(deadline - now);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, mpsc};

    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest_and_begin_anew() {
        let milliseconds = Duration::from_millis;
        let mut backoff = Backoff::new(milliseconds(50), milliseconds(150));
        let pauses: Vec<_> = (0..4).map(|_| backoff.next_delay()).collect();
        assert_eq!(pauses, [50, 100, 150, 150].map(milliseconds));
        backoff.reset();
        assert_eq!(backoff.next_delay(), milliseconds(50));
    }

    #[test]
    fn an_end_interrupts_a_wait_that_would_last_minutes() {
        let ending = Arc::new(AtomicBool::new(false));
        let (sender, returned) = mpsc::channel();
        let waiter = thread::spawn({
            let ending = ending.clone();
            move || {
                Backoff::new(Duration::from_secs(600), Duration::from_secs(600)).wait(&ending);
                sender.send(()).ok();
            }
        });
        let early = returned.recv_timeout(Duration::from_millis(20));
        assert!(early.is_err(), "the wait ended by itself");
        // An unpark alone, as other code may cause one, does not end it.
        waiter.thread().unpark();
        let early = returned.recv_timeout(Duration::from_millis(20));
        assert!(early.is_err(), "the wait ended without being told");
        ending.store(true, Ordering::Release);
        waiter.thread().unpark();
        let ended = returned.recv_timeout(Duration::from_secs(60));
        assert!(ended.is_ok(), "the wait was not interrupted");
    }
}
