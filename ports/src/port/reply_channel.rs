//! Channels for one reply: that of a peer, or that of the owner.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;
use yarp_wire::message::Payload;

/// The result of a request to a peer.
pub(crate) type Outcome = Result<Option<Payload>, Arc<str>>;

/// Maximum number of unused channels kept.
const MAX_POOLED: usize = 4;

/// A value that can be sent over a reply channel.
pub(crate) trait SenderDropped {
    /// Returns the value that is received if the sender is dropped without sending.
    fn sender_dropped() -> Self;
}

impl SenderDropped for Outcome {
    fn sender_dropped() -> Self {
        Err("closed here".into())
    }
}

/// A pool of channels; a finished one is reused, so that a call needs no allocation.
#[derive(Debug)]
pub(super) struct ReplyPool<T>(Arc<Mutex<Vec<Arc<Slot<T>>>>>);

#[derive(Debug)]
struct Slot<T> {
    outcome: Mutex<Option<T>>,
    told: Notify,
}

/// Sends the result of a request; dropped unused, it sends [`SenderDropped::sender_dropped`].
#[derive(Debug)]
pub(crate) struct ReplySender<T: SenderDropped>(Arc<Slot<T>>);

/// Receives the result of a request. A result sent after it was dropped is discarded.
#[derive(Debug)]
pub(crate) struct ReplyReceiver<T> {
    slots: ReplyPool<T>,
    slot: Arc<Slot<T>>,
}

impl<T> Default for ReplyPool<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T> Default for Slot<T> {
    fn default() -> Self {
        Self {
            outcome: Mutex::default(),
            told: Notify::new(),
        }
    }
}

impl<T: SenderDropped> ReplyPool<T> {
    pub(super) fn begin(&self) -> (ReplySender<T>, ReplyReceiver<T>) {
        let mut slot = self.kept().pop().unwrap_or_default();
        match Arc::get_mut(&mut slot) {
            Some(slot) => *slot = Slot::default(),
            // The previous sender still holds a reference.
            None => slot = Arc::default(),
        }
        let slots = Self(self.0.clone());
        (ReplySender(slot.clone()), ReplyReceiver { slots, slot })
    }
}

impl<T> ReplyPool<T> {
    fn kept(&self) -> MutexGuard<'_, Vec<Arc<Slot<T>>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Slot<T> {
    fn outcome(&self) -> MutexGuard<'_, Option<T>> {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: SenderDropped> ReplySender<T> {
    pub(super) fn send(self, outcome: T) {
        *self.0.outcome() = Some(outcome);
    }
}

impl<T: SenderDropped> Drop for ReplySender<T> {
    fn drop(&mut self) {
        self.0.outcome().get_or_insert_with(T::sender_dropped);
        self.0.told.notify_one();
    }
}

impl<T> ReplyReceiver<T> {
    /// Waits for the result.
    pub(super) async fn outcome(self) -> T {
        let Self { slots, slot } = self;
        loop {
            let told = slot.outcome().take();
            if let Some(outcome) = told {
                let mut kept = slots.kept();
                if kept.len() < MAX_POOLED {
                    kept.push(slot);
                }
                return outcome;
            }
            slot.told.notified().await;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_reply_goes_to_its_caller() {
        let slots = ReplyPool::<Outcome>::default();
        // A receiver that does not wait does not leave its result to the next.
        let (late, call) = slots.begin();
        drop(call);
        let (sender, next) = slots.begin();
        late.send(Err("for nobody".into()));
        sender.send(Ok(None));
        assert_eq!(next.outcome().await, Ok(None));
        let (sender, call) = slots.begin();
        drop(sender);
        assert!(call.outcome().await.is_err());
        let (sender, call) = slots.begin();
        let telling = async { sender.send(Ok(None)) };
        let (told, ()) = tokio::join!(call.outcome(), telling);
        assert_eq!(told, Ok(None));
        assert_eq!(slots.kept().len(), 1);
    }
}
