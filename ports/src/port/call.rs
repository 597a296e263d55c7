//! Waiting for the reply to a request.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;
use yarp_wire::message::Payload;

/// What becomes of a request.
pub(crate) type Outcome = Result<Option<Payload>, Arc<str>>;

/// Places that are kept for the next callers of a connection.
const KEPT: usize = 4;

/// Where the callers of a connection wait. Each leaves his place to the next, so that a call allocates none.
#[derive(Debug, Default)]
pub(super) struct Slots(Mutex<Vec<Arc<Slot>>>);

#[derive(Debug, Default)]
struct Slot {
    outcome: Mutex<Option<Outcome>>,
    told: Notify,
}

/// Tells a caller what became of his request; dropped without a word, that the connection was closed.
#[derive(Debug)]
pub(crate) struct Teller(Arc<Slot>);

/// A caller. Dropped before he was told, he has the reply thrown away.
#[derive(Debug)]
pub(crate) struct Call<'a> {
    slots: &'a Slots,
    slot: Arc<Slot>,
}

impl Slots {
    pub(super) fn begin(&self) -> (Teller, Call<'_>) {
        let mut slot = self.kept().pop().unwrap_or_default();
        match Arc::get_mut(&mut slot) {
            Some(slot) => *slot = Slot::default(),
            // Who told the last caller is not quite gone.
            None => slot = Arc::default(),
        }
        let teller = Teller(slot.clone());
        (teller, Call { slots: self, slot })
    }

    fn kept(&self) -> MutexGuard<'_, Vec<Arc<Slot>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Slot {
    fn outcome(&self) -> MutexGuard<'_, Option<Outcome>> {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Teller {
    pub(super) fn tell(self, outcome: Outcome) {
        *self.0.outcome() = Some(outcome);
    }
}

impl Drop for Teller {
    fn drop(&mut self) {
        let closed = || Err("closed here".into());
        self.0.outcome().get_or_insert_with(closed);
        self.0.told.notify_one();
    }
}

impl Call<'_> {
    /// Waits until he is told.
    pub(super) async fn outcome(self) -> Outcome {
        let Self { slots, slot } = self;
        loop {
            let told = slot.outcome().take();
            if let Some(outcome) = told {
                let mut kept = slots.kept();
                if kept.len() < KEPT {
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
    async fn a_reply_is_for_who_asked() {
        let slots = Slots::default();
        // One who does not wait for it does not leave it to the next.
        let (late, call) = slots.begin();
        drop(call);
        let (teller, next) = slots.begin();
        late.tell(Err("for nobody".into()));
        teller.tell(Ok(None));
        assert_eq!(next.outcome().await, Ok(None));
        let (teller, call) = slots.begin();
        drop(teller);
        assert!(call.outcome().await.is_err());
        let (teller, call) = slots.begin();
        let telling = async { teller.tell(Ok(None)) };
        let (told, ()) = tokio::join!(call.outcome(), telling);
        assert_eq!(told, Ok(None));
        assert_eq!(slots.kept().len(), 1);
    }
}
