//! Signals that end a command.

use std::collections::HashMap;
use std::time::Duration;

use tokio::sync::watch;
use tokio::time::Instant;

use crate::output::{self, Stream};

/// Time after the first signal from which a second signal aborts the process.
const SECOND_SIGNAL_ABORT_AFTER: Duration = Duration::from_secs(2);

/// Interval in which the same signal again is taken for the same wish: `timeout` sends it to its child and to the group of
/// the child, a terminal that closes to all that run in it.
const DUPLICATE_INTERVAL: Duration = Duration::from_secs(2);
/// The same for SIGINT, which a person may well mean twice.
const DUPLICATE_INTERVAL_OF_KEYS: Duration = Duration::from_millis(100);

/// Hears SIGINT, SIGTERM and SIGHUP from the moment it is made.
///
/// The first signal ends the waits of the command, which then closes its ports; if that takes
/// longer than two seconds, a second signal ends the process at once. The same signal again within
/// [`DUPLICATE_INTERVAL`] does not count.
#[derive(Debug)]
pub(crate) struct Interrupt {
    heard: watch::Receiver<u32>,
    told: bool,
}

impl Interrupt {
    /// Starts to listen; from now on signals do not end the process by themselves.
    pub(crate) fn listen() -> Self {
        Self::listen_with(1, SECOND_SIGNAL_ABORT_AFTER)
    }

    /// Starts to listen like [`listen`](Self::listen), but leaves the first `count` signals to the
    /// command. A later signal aborts the process if the first one was `abort_after` ago.
    pub(crate) fn listen_with(count: u32, abort_after: Duration) -> Self {
        let (sender, heard) = watch::channel(0);
        if let Ok(mut signals) = Signals::new() {
            // The task ends with the runtime, that is with the command.
            tokio::spawn(async move {
                let mut last = HashMap::new();
                last.insert(signals.next().await, Instant::now());
                sender.send_modify(|heard| *heard += 1);
                let first = Instant::now();
                loop {
                    let kind = signals.next().await;
                    let now = Instant::now();
                    if last
                        .get(&kind)
                        .is_some_and(|last| now - *last < kind.duplicate_interval())
                    {
                        continue;
                    }
                    last.insert(kind, now);
                    sender.send_modify(|heard| *heard += 1);
                    if *sender.borrow() > count && first.elapsed() >= abort_after {
                        std::process::abort();
                    }
                }
            });
        }
        Self { heard, told: false }
    }

    /// Waits until `count` signals were received. Cancel safe.
    pub(crate) async fn interrupted_times(&mut self, count: u32) {
        if self.heard.wait_for(|heard| *heard >= count).await.is_err() {
            // The system delivers no signals.
            std::future::pending::<()>().await;
        }
    }

    /// Waits for a signal, and prints a message for the first one. Cancel safe.
    pub(crate) async fn interrupted(&mut self) {
        self.interrupted_times(1).await;
        if !std::mem::replace(&mut self.told, true) {
            // Nobody may read it; we end all the same.
            output::try_line(Stream::Out, "Interrupting...");
        }
    }
}

/// A signal that ends a command.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
enum Kind {
    Interrupt,
    #[cfg_attr(not(unix), allow(dead_code))]
    Terminate,
    #[cfg_attr(not(unix), allow(dead_code))]
    Hangup,
}

impl Kind {
    fn duplicate_interval(self) -> Duration {
        match self {
            Self::Interrupt => DUPLICATE_INTERVAL_OF_KEYS,
            Self::Terminate | Self::Hangup => DUPLICATE_INTERVAL,
        }
    }
}

#[cfg(unix)]
struct Signals([tokio::signal::unix::Signal; 3]);

#[cfg(unix)]
impl Signals {
    fn new() -> std::io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(Self([
            signal(SignalKind::interrupt())?,
            signal(SignalKind::terminate())?,
            signal(SignalKind::hangup())?,
        ]))
    }

    async fn next(&mut self) -> Kind {
        let [interrupt, terminate, hangup] = &mut self.0;
        tokio::select! {
            _ = interrupt.recv() => Kind::Interrupt,
            _ = terminate.recv() => Kind::Terminate,
            _ = hangup.recv() => Kind::Hangup,
        }
    }
}

#[cfg(not(unix))]
struct Signals;

#[cfg(not(unix))]
impl Signals {
    fn new() -> std::io::Result<Self> {
        Ok(Self)
    }

    async fn next(&mut self) -> Kind {
        // On an error the system delivers no signals.
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
        Kind::Interrupt
    }
}
