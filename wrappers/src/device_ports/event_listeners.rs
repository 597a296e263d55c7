//! Listeners of the events of a device.

use std::sync::Mutex;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use super::lock;

/// Maximum number of queued events for a listener that does not read.
const MAX_QUEUED_EVENTS: usize = 256;
/// Maximum number of listeners; one more ends the oldest.
const MAX_LISTENERS: usize = 64;

/// Hands each event to every listener.
#[derive(Debug)]
pub(crate) struct EventListeners<E>(Mutex<Vec<SyncSender<E>>>);

impl<E: Clone> EventListeners<E> {
    /// Creates a list without listeners.
    pub(crate) fn new() -> Self {
        Self(Mutex::default())
    }

    /// Adds a listener.
    pub(crate) fn listen(&self) -> Receiver<E> {
        let (sender, receiver) = sync_channel(MAX_QUEUED_EVENTS);
        let mut listeners = lock(&self.0);
        if listeners.len() == MAX_LISTENERS {
            listeners.remove(0);
        }
        listeners.push(sender);
        receiver
    }

    /// Hands an event to the listeners, and forgets those that are gone.
    ///
    /// A listener whose queue is full misses it.
    pub(crate) fn announce(&self, event: &E) {
        lock(&self.0).retain(|listener| {
            let sent = listener.try_send(event.clone());
            !matches!(sent, Err(TrySendError::Disconnected(_)))
        });
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::TryRecvError;

    use super::*;

    #[test]
    fn a_listener_too_many_ends_the_oldest() {
        let listeners = EventListeners::<u32>::new();
        let oldest = listeners.listen();
        let others: Vec<_> = (1..64).map(|_| listeners.listen()).collect();
        assert_eq!(oldest.try_recv(), Err(TryRecvError::Empty));
        let newest = listeners.listen();
        assert_eq!(oldest.try_recv(), Err(TryRecvError::Disconnected));
        for listener in others.iter().chain([&newest]) {
            assert_eq!(listener.try_recv(), Err(TryRecvError::Empty));
        }
    }

    #[test]
    fn a_listener_that_does_not_read_misses_the_newest_events() {
        let listeners = EventListeners::new();
        drop(listeners.listen());
        let listener = listeners.listen();
        for number in 0..300 {
            listeners.announce(&number);
        }
        let received: Vec<i32> = listener.try_iter().collect();
        assert_eq!(received.len(), 256);
        assert_eq!(received.last(), Some(&255));
        assert_eq!(lock(&listeners.0).len(), 1, "of those that are there");
    }
}
