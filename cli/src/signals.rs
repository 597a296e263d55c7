//! The wish of a person or a service manager that we end.

use std::io::Write;
use std::time::Duration;

use tokio::sync::watch;

/// A second signal after this long ends the process at once.
const SECOND_SIGNAL_ABORT_AFTER: Duration = Duration::from_secs(2);

/// Hears SIGINT, SIGTERM and SIGHUP from the moment it is made.
///
/// The first signal ends the waits of the command, which then closes its ports; if that takes
/// longer than two seconds, a second signal ends the process at once.
#[derive(Debug)]
pub(crate) struct Interrupt {
    heard: watch::Receiver<u32>,
    told: bool,
}

impl Interrupt {
    /// Begins to listen; from now on signals do not end the process by themselves.
    pub(crate) fn listen() -> Self {
        Self::listen_with(1, SECOND_SIGNAL_ABORT_AFTER)
    }

    /// As [`listen`](Self::listen), but the first `count` signals are the command's business, and one after them ends
    /// the process at once, if the first was `patience` ago.
    pub(crate) fn listen_with(count: u32, abort_after: Duration) -> Self {
        let (sender, heard) = watch::channel(0);
        if let Ok(mut signals) = Signals::new() {
            // Ends with the runtime, that is with the command.
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

    /// Returns once so many signals came. Cancelling is safe.
    pub(crate) async fn heard_times(&mut self, count: u32) {
        if self.heard.wait_for(|heard| *heard >= count).await.is_err() {
            // Nobody listens: no signal will be heard.
            std::future::pending::<()>().await;
        }
    }

    /// Returns once a signal came, and says so the first time. Cancelling is safe.
    pub(crate) async fn heard(&mut self) {
        self.heard_times(1).await;
        if !std::mem::replace(&mut self.told, true) {
            // If standard output is gone, we end all the same.
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
        // An error says that the system cannot tell us; then there is nothing to hear.
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}
