//! Detection of leaked tasks and descriptors.

use std::process::Command;

use tokio::runtime::{Builder, Handle};

use super::common::until;

/// Set in a process that runs one test.
const ALONE: &str = "YARP_TEST_ALONE";

/// Runs `test` on a runtime and in a process of its own, and insists that no task and no descriptor
/// is left of it.
///
/// Descriptors belong to the whole process. Such a test calls this once, and does nothing else.
pub(crate) fn leaving_nothing(test: impl Future<Output = ()>) {
    let thread = std::thread::current();
    let name = thread.name().expect("the thread of a test has its name");
    // With one thread all tests run on the first one: none runs beside this one.
    if name != "main" && std::env::var_os(ALONE).is_none() {
        return run_again(name);
    }
    let runtime = || Builder::new_current_thread().enable_all().build().unwrap();
    // The first runtime of a process opens what all share.
    drop(runtime());
    let before = descriptors();
    let own = runtime();
    own.block_on(async {
        test.await;
        until(|| tasks() == 0).await;
    });
    drop(own);
    assert_eq!(descriptors(), before, "descriptors");
}

/// Runs the test of this name in another process.
fn run_again(name: &str) {
    let program = std::env::current_exe().unwrap();
    let output = Command::new(program)
        .args([name, "--exact", "--nocapture", "--test-threads=1"])
        .env(ALONE, "1")
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    println!("{printed}");
    eprintln!("{}", String::from_utf8_lossy(&output.stderr));
    let passed = output.status.success() && printed.contains("1 passed");
    assert!(passed, "the test failed in a process of its own");
}

/// Descriptors that this process has open.
pub(crate) fn descriptors() -> usize {
    std::fs::read_dir("/proc/self/fd").unwrap().count()
}

/// Tasks of this runtime that have not ended.
pub(crate) fn tasks() -> usize {
    Handle::current().metrics().num_alive_tasks()
}

/// Numbers of tasks and descriptors at rest.
#[derive(Debug, Eq, PartialEq)]
pub(crate) struct Rest {
    tasks: usize,
    descriptors: usize,
}

impl Rest {
    pub(crate) fn now() -> Self {
        Self {
            tasks: tasks(),
            descriptors: descriptors(),
        }
    }

    /// Waits until there are as many again.
    #[track_caller]
    pub(crate) fn comes_back(self) -> impl Future<Output = ()> {
        until(move || Self::now() == self)
    }
}
