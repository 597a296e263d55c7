//! A thread that sleeps on a lock for a task that must not.

use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use tokio::sync::Notify;

use super::lock::ProcessLock;

/// A sleep ends by itself after this long, as stock's does: a wake-up may be lost with a process.
const LONGEST: Duration = Duration::from_secs(1);

/// Ends its thread when dropped.
#[derive(Debug)]
pub(super) struct Sleeper(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    lock: Arc<ProcessLock>,
    wish: Mutex<Wish>,
    changed: Condvar,
    woken: Notify,
}

#[derive(Debug, Eq, PartialEq)]
enum Wish {
    Nothing,
    Sleep,
    End,
}

impl Sleeper {
    pub(super) fn new(lock: Arc<ProcessLock>) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            lock,
            wish: Mutex::new(Wish::Nothing),
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
        *self.0.wish() = Wish::Sleep;
        self.0.changed.notify_one();
        self.0.woken.notified().await;
    }
}

impl Shared {
    fn wish(&self) -> MutexGuard<'_, Wish> {
        self.wish.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self) {
        loop {
            let mut wish = self.wish();
            while *wish == Wish::Nothing {
                let waiting = self.changed.wait(wish);
                wish = waiting.unwrap_or_else(PoisonError::into_inner);
            }
            if *wish == Wish::End {
                return;
            }
            *wish = Wish::Nothing;
            drop(wish);
            self.lock.take_within(LONGEST);
            self.woken.notify_one();
        }
    }
}

impl Drop for Sleeper {
    fn drop(&mut self) {
        *self.0.wish() = Wish::End;
        self.0.changed.notify_one();
        self.0.lock.free();
    }
}
