//! Work that is done every period, on a thread of its own.

use std::io;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tokio::sync::oneshot;
use yarp_devices::clock::TimeSource;
use yarp_devices::periodic_timer::{MissedCycles, PeriodicTimer};

use crate::OpenError;

/// Periods that servers publish with.
const PERIOD_RANGE: RangeInclusive<Duration> = Duration::from_millis(1)..=Duration::from_secs(60);

/// Checks a requested period.
pub(crate) fn check_period(asked: Duration) -> Result<(), OpenError> {
    if PERIOD_RANGE.contains(&asked) {
        return Ok(());
    }
    let (min, max) = PERIOD_RANGE.into_inner();
    Err(OpenError::Period { asked, min, max })
}

/// A thread that does something every period.
///
/// It is a thread and not a task, so that the period does not depend on the other tasks of the program. The period is one of
/// the process's time source.
#[derive(Debug)]
pub(crate) struct PeriodicThread {
    ending: Arc<AtomicBool>,
    thread: JoinHandle<()>,
    ended: oneshot::Receiver<()>,
}

impl PeriodicThread {
    /// Starts; `work` is dropped on the thread when it ends.
    pub(crate) fn start(
        name: &str,
        period: Duration,
        mut work: impl FnMut() + Send + 'static,
    ) -> io::Result<Self> {
        let ending = Arc::new(AtomicBool::new(false));
        let theirs = ending.clone();
        let (alive, ended) = oneshot::channel();
        let thread = thread::Builder::new().name(name.into()).spawn(move || {
            yarp_ports::request_low_timer_slack();
            let mut timer = PeriodicTimer::on(TimeSource::current(), period, MissedCycles::Skip);
            timer.repeat(|| theirs.load(Ordering::Acquire), &mut work);
            // Its captures are dropped before the end is reported.
            drop(work);
            drop(alive);
        })?;
        Ok(Self {
            ending,
            thread,
            ended,
        })
    }

    /// Ends the thread; waits for running work at most until `deadline`.
    pub(crate) async fn end(self, deadline: Duration) {
        self.ending.store(true, Ordering::Release);
        self.thread.thread().unpark();
        if tokio::time::timeout(deadline, self.ended).await.is_err() {
            tracing::warn!(
                "publisher did not stop in time: a device call is still blocking; continuing without it"
            );
        } else if self.thread.join().is_err() {
            tracing::error!("publishing had panicked");
        }
    }
}
