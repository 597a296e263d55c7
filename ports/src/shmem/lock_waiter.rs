//! A thread that sleeps on a lock for a task that must not.

use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use tokio::sync::Notify;

use super::process_lock::ProcessLock;

/// A sleep ends by itself after this long, as stock's does: a wake-up may be lost with a process.
const MAX_WAIT: Duration = Duration::from_secs(1);

/// Ends its thread when dropped.
#[derive(Debug)]
pub(super) struct LockWaiter(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    lock: Arc<ProcessLock>,
    request: Mutex<Request>,
    changed: Condvar,
    woken: Notify,
}

#[derive(Debug, Eq, PartialEq)]
enum Request {
    Nothing,
    Sleep,
    End,
}

impl LockWaiter {
    pub(super) fn new(lock: Arc<ProcessLock>) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            lock,
            request: Mutex::new(Request::Nothing),
            changed: Condvar::new(),
            woken: Notify::new(),
        });
        let own = shared.clone();
        thread::Builder::new()
            .name("shmem".to_owned())
            .spawn(move || own.run())?;
        Ok(Self(shared))
    }

    /// Waits until the lock was freed, at the most for as long as stock does. Safe to cancel.
    pub(super) async fn sleep(&self) {
        *self.0.request() = Request::Sleep;
        self.0.changed.notify_one();
        self.0.woken.notified().await;
    }
}

impl Shared {
    fn request(&self) -> MutexGuard<'_, Request> {
        self.request.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self) {
        loop {
            let mut request = self.request();
            while *request == Request::Nothing {
                let waiting = self.changed.wait(request);
                request = waiting.unwrap_or_else(PoisonError::into_inner);
            }
            if *request == Request::End {
                return;
            }
            *request = Request::Nothing;
            drop(request);
            self.lock.take_within(MAX_WAIT);
            self.woken.notify_one();
        }
    }
}

impl Drop for LockWaiter {
    fn drop(&mut self) {
        *self.0.request() = Request::End;
        self.0.changed.notify_one();
        self.0.lock.free();
    }
}
