//! Signals that end a command.

use std::io::Write;
use std::time::Duration;

use tokio::sync::watch;

/// Time after the first signal from which a second signal aborts the process.
const SECOND_SIGNAL_ABORT_AFTER: Duration = Duration::from_secs(2);

/// Receives SIGINT, SIGTERM and SIGHUP from its creation on.
///
/// The first signal ends the waits of the command, which then closes its ports. If that takes
/// longer than two seconds, a second signal aborts the process.
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
                signals.next().await;
                sender.send_modify(|heard| *heard += 1);
                let first = tokio::time::Instant::now();
                loop {
                    signals.next().await;
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
            // Standard output may be closed; the command ends all the same.
            let _ = writeln!(std::io::stdout(), "Interrupting...");
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

    async fn next(&mut self) {
        let [interrupt, terminate, hangup] = &mut self.0;
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
            _ = hangup.recv() => {}
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

    async fn next(&mut self) {
        // On an error the system delivers no signals.
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}
