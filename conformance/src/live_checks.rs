//! Results of a program that drives a live peer, one line per check.

use std::fmt::Debug;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use yarp_devices::DeviceError;

/// Timeout for an action of a peer.
pub const CHECK_TIMEOUT: Duration = Duration::from_secs(20);

/// Prints `ok` or `FAIL` per check, and counts failures.
#[derive(Debug, Default)]
pub struct Checks {
    failed: usize,
}

impl Checks {
    /// Creates an empty list of checks.
    pub fn new() -> Self {
        Self::default()
    }

    /// Records a check: a value, and a test if it is good.
    pub fn check<T: Debug>(
        &mut self,
        what: &str,
        found: Result<T, DeviceError>,
        good: impl Fn(&T) -> bool,
    ) {
        let fine = found.as_ref().is_ok_and(good);
        self.failed += usize::from(!fine);
        println!("{} {what}: {found:?}", if fine { "ok  " } else { "FAIL" });
    }

    /// Repeats a request until the answer is good, or [`CHECK_TIMEOUT`] expires.
    pub fn until<T: Debug>(
        &mut self,
        what: &str,
        ask: impl Fn() -> Result<T, DeviceError>,
        good: impl Fn(&T) -> bool,
    ) {
        let deadline = Instant::now() + CHECK_TIMEOUT;
        let mut found = ask();
        while !found.as_ref().is_ok_and(&good) && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(10));
            found = ask();
        }
        self.check(what, found, good);
    }

    /// Returns the exit code of the program.
    pub fn exit_code(self) -> ExitCode {
        if self.failed == 0 {
            return ExitCode::SUCCESS;
        }
        println!("{} checks failed", self.failed);
        ExitCode::FAILURE
    }
}
