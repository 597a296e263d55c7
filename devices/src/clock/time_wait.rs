//! Waits in the time of a clock on the network.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, Wake, Waker};
use std::thread::{self, Thread};
use std::time::{Duration, Instant};

use super::NetworkTime;

/// Longest time that a parked thread sleeps at once.
const MAX_PARK: Duration = Duration::from_secs(1);

/// A wait until a deadline in the time of a clock. Dropping it cancels the wait.
#[derive(Debug)]
#[must_use = "futures do nothing unless awaited"]
pub struct TimeWait {
    time: Arc<NetworkTime>,
    deadline: Instant,
    id: Option<u64>,
}

impl TimeWait {
    /// Creates a wait until [`NetworkTime::instant`] reaches `deadline`.
    pub fn new(time: Arc<NetworkTime>, deadline: Instant) -> Self {
        Self {
            time,
            deadline,
            id: None,
        }
    }

    /// Registers the waker; returns false when the deadline has passed.
    fn register(&mut self, waker: &Waker) -> bool {
        self.id = self.time.register(self.deadline, self.id, waker);
        self.id.is_some()
    }
}

impl Future for TimeWait {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        match self.register(context.waker()) {
            true => Poll::Pending,
            false => Poll::Ready(()),
        }
    }
}

impl Drop for TimeWait {
    fn drop(&mut self) {
        if let Some(id) = self.id {
            self.time.unregister(id);
        }
    }
}

/// Parks the thread until the deadline, until it is unparked, or for a second. May return early.
pub(super) fn park_until(time: &Arc<NetworkTime>, deadline: Instant) {
    let mut wait = TimeWait::new(Arc::clone(time), deadline);
    let waker = Waker::from(Arc::new(Unpark(thread::current())));
    if wait.register(&waker) {
        thread::park_timeout(MAX_PARK);
    }
}

/// Unparks a thread.
struct Unpark(Thread);

impl Wake for Unpark {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}
