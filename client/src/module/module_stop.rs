//! Requests to stop a module.

use std::pin::pin;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Wake, Waker};
use std::time::{Duration, Instant};

use tokio::signal::unix::{Signal, SignalKind, signal};
use yarp_devices::clock::TimeSource;
use yarp_ports::blocking;

use crate::{Error, Result};

/// Time after the first signal from which a second one ends the process at once.
const FORCED_EXIT_DELAY: Duration = Duration::from_secs(2);

/// Stops a module from any thread.
#[derive(Clone, Debug, Default)]
pub struct StopHandle(Arc<State>);

#[derive(Debug, Default)]
struct State {
    stopped: Mutex<bool>,
    changed: Condvar,
}

impl StopHandle {
    /// Stops the module before its next update.
    pub fn stop(&self) {
        *self.lock() = true;
        self.0.changed.notify_all();
    }

    /// Returns whether the module was asked to stop.
    pub fn is_stopped(&self) -> bool {
        *self.lock()
    }

    /// Waits until the module is asked to stop, at most until `deadline` of a time source; returns whether it was.
    pub(super) fn wait_until(&self, source: &TimeSource, deadline: Instant) -> bool {
        let Some(wait) = source.network_wait(deadline) else {
            return self.wait_until_system(deadline);
        };
        let mut wait = pin!(wait);
        let waker = Waker::from(Arc::clone(&self.0));
        loop {
            // A tick in between is noticed: it takes the lock to notify.
            let stopped = self.lock();
            let reached = wait.as_mut().poll(&mut Context::from_waker(&waker));
            if *stopped || reached == Poll::Ready(()) {
                return *stopped;
            }
            let waited = self.0.changed.wait(stopped);
            drop(waited.unwrap_or_else(PoisonError::into_inner));
        }
    }

    fn wait_until_system(&self, deadline: Instant) -> bool {
        let mut stopped = self.lock();
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if *stopped || left.is_zero() {
                return *stopped;
            }
            let waited = self.0.changed.wait_timeout(stopped, left);
            stopped = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn lock(&self) -> MutexGuard<'_, bool> {
        // A flag is valid whoever panicked while holding it.
        self.0
            .stopped
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Stops the module on SIGINT, SIGTERM and SIGHUP.
    pub(super) fn on_signals(&self) -> Result<()> {
        let stop = self.clone();
        blocking::wait(async move {
            let mut signals = Signals::listen().map_err(|source| Error::System {
                step: "cannot listen for signals",
                source,
            })?;
            tokio::spawn(async move {
                signals.next().await;
                stop.stop();
                let first = Instant::now();
                loop {
                    signals.next().await;
                    if first.elapsed() >= FORCED_EXIT_DELAY {
                        std::process::abort();
                    }
                }
            });
            Ok(())
        })
    }
}

impl Wake for State {
    fn wake(self: Arc<Self>) {
        let _stopped = self.stopped.lock().unwrap_or_else(PoisonError::into_inner);
        self.changed.notify_all();
    }
}

struct Signals {
    interrupt: Signal,
    terminate: Signal,
    hangup: Signal,
}

impl Signals {
    fn listen() -> std::io::Result<Self> {
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hangup: signal(SignalKind::hangup())?,
        })
    }

    async fn next(&mut self) {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            _ = self.hangup.recv() => {}
        }
    }
}
