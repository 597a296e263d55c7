//! Waiting for what a check expects.

use std::thread;
use std::time::{Duration, Instant};

/// Interval between two looks.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Waits until `condition` holds; panics with `what` after `timeout`.
#[track_caller]
pub(super) fn wait_until(what: &str, timeout: Duration, condition: impl Fn() -> bool) {
    let deadline = Instant::now() + timeout;
    while !condition() {
        assert!(
            Instant::now() < deadline,
            "{what} did not come within {timeout:?}"
        );
        thread::sleep(POLL_INTERVAL);
    }
}
