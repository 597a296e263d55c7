//! Scenarios one after the other, and the verdict that `conformance/kernel/boot.sh` waits for.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

/// Scenarios that were run, and those that failed.
#[derive(Debug, Default)]
pub(crate) struct Verdict {
    count: usize,
    failed: Vec<String>,
}

impl Verdict {
    /// Runs a scenario, which fails if it panics, and prints a line before and after it.
    pub(crate) fn run(&mut self, name: &str, scenario: impl FnOnce()) {
        self.count += 1;
        println!("{name} ...");
        let whole = catch_unwind(AssertUnwindSafe(scenario));
        println!("{name} {}", if whole.is_ok() { "ok" } else { "FAILED" });
        if whole.is_err() {
            self.failed.push(name.to_owned());
        }
    }

    /// Prints the verdict, and returns the exit code.
    pub(crate) fn end(self) -> ExitCode {
        let (count, failed) = (self.count, self.failed);
        if failed.is_empty() {
            println!("VERDICT: all {count} scenarios hold");
            return ExitCode::SUCCESS;
        }
        println!(
            "VERDICT: {} of {count} failed: {}",
            failed.len(),
            failed.join(", ")
        );
        ExitCode::FAILURE
    }
}
