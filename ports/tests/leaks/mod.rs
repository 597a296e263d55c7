//! Detection of leaked tasks and descriptors.

use std::sync::{Mutex, PoisonError};

use tokio::runtime::{Builder, Handle};

use super::common::until;

/// Descriptors belong to the whole process: one test at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// Runs `test` on a runtime of its own while no other such test of the process runs, and insists
/// that no task and no descriptor is left of it.
pub(crate) fn leaving_nothing(test: impl Future<Output = ()>) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
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
