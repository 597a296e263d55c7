//! Ports that close in the background, counted so that a program can wait for them before it ends.
//!
//! The runtime of a program drops its tasks when the program ends. A port that was dropped shortly
//! before would leave its name in the name server.

use tokio::sync::watch;

/// The number of ports of this process that open or close in tasks of their own.
static UNFINISHED: std::sync::LazyLock<watch::Sender<usize>> =
    std::sync::LazyLock::new(|| watch::channel(0).0);

/// A port that opens or closes; counts until it is dropped.
#[derive(Debug)]
pub(super) struct Unfinished(());

impl Unfinished {
    pub(super) fn new() -> Self {
        UNFINISHED.send_modify(|count| *count += 1);
        Self(())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        UNFINISHED.send_modify(|count| *count -= 1);
    }
}

/// Waits until all ports that were dropped have closed and unregistered their names, also those
/// that were dropped while they opened.
///
/// A program calls it last, with a timeout, before its runtime ends: closing takes a few seconds if
/// the name server does not answer.
pub async fn wait_for_dropped_ports() {
    // The sender is static, so waiting cannot fail.
    let _ = UNFINISHED.subscribe().wait_for(|count| *count == 0).await;
}
