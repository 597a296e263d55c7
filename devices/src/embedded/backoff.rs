//! Increasing pauses between attempts.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use backon::{BackoffBuilder, ExponentialBackoff, ExponentialBuilder};

/// Returns the pauses before attempts, each twice as long as the previous one, up to a maximum.
pub(super) fn backoff(first: Duration, longest: Duration) -> ExponentialBackoff {
    ExponentialBuilder::new()
        .with_min_delay(first)
        .with_max_delay(longest.max(first))
        .without_max_times()
        .build()
}

/// Sleeps for the next pause, or until `ending` is set and the thread unparked.
pub(super) fn wait(pauses: &mut ExponentialBackoff, ending: &AtomicBool) {
    let pause = pauses.next().expect("attempts are not limited");
    sleep_until(Instant::now() + pause, ending);
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
    fn pauses_double_up_to_the_longest() {
        let milliseconds = Duration::from_millis;
        let pauses = backoff(milliseconds(50), milliseconds(150));
        let pauses: Vec<_> = pauses.take(4).map(|pause| pause.as_millis()).collect();
        assert_eq!(pauses, [50, 100, 150, 150]);
        let mut pauses = backoff(milliseconds(50), milliseconds(10));
        assert_eq!(pauses.nth(1_000), Some(milliseconds(50)));
    }

    #[test]
    fn an_end_interrupts_a_wait_that_would_last_minutes() {
        let ending = Arc::new(AtomicBool::new(false));
        let (sender, returned) = mpsc::channel();
        let waiter = thread::spawn({
            let ending = ending.clone();
            move || {
                let mut pauses = backoff(Duration::from_secs(600), Duration::from_secs(600));
                wait(&mut pauses, &ending);
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
