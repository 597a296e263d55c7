//! A signal that ends tasks.

use tokio::sync::watch;
use tokio::task::JoinSet;

/// Waits for the end of all tasks. One that panicked, or that went with the runtime, has ended.
pub(crate) async fn join<T: 'static>(mut tasks: JoinSet<T>) {
    while tasks.join_next().await.is_some() {}
}

/// Cancels every task that holds a [`Cancelled`] of it, on request or when dropped.
#[derive(Debug)]
pub(crate) struct Cancel(watch::Sender<bool>);

/// The end of a [`Cancel`] that a task listens to.
#[derive(Clone, Debug)]
pub(crate) struct Cancelled(watch::Receiver<bool>);

impl Cancel {
    pub(crate) fn new() -> (Self, Cancelled) {
        let (sender, receiver) = watch::channel(false);
        (Self(sender), Cancelled(receiver))
    }

    pub(crate) fn cancel(&self) {
        self.0.send_replace(true);
    }
}

impl Cancelled {
    /// Returns once the signal was given.
    pub(crate) async fn cancelled(&mut self) {
        // An error says that the sender is gone, which is as good as a signal.
        let _ = self.0.wait_for(|cancelled| *cancelled).await;
    }
}
