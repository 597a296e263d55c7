//! The messages that the reader says of when it is done with them, which it does in their order.

use std::collections::VecDeque;
use std::sync::Arc;

use yarp_wire::message::Payload;

use super::super::reply_channel::{Outcome, ReplySender};

/// The place of a message among them; none where readers do not say.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ticket(Option<u64>);

impl Ticket {
    /// Of a message that the reader says nothing of.
    pub(super) const NONE: Self = Self(None);

    /// Whether the reader will say when it is done.
    pub(crate) fn is_awaited(self) -> bool {
        self.0.is_some()
    }
}

/// Those that it has not said so of.
#[derive(Debug, Default)]
pub(super) struct Unacknowledged {
    /// Those of them that were handed on.
    pending: VecDeque<Pending>,
    /// How many there were, since the beginning.
    begun: u64,
    /// How many of those are done with.
    finished: u64,
}

#[derive(Debug)]
struct Pending {
    reply: Option<Payload>,
    outcome: Option<ReplySender<Outcome>>,
    /// A monitor stopped it: it is done with as soon as those before it are.
    stopped: bool,
}

impl Unacknowledged {
    /// A place for a message, which [`Unacknowledged::push`] or [`Unacknowledged::stop`] fills in the same order.
    pub(super) fn begin(&mut self) -> Ticket {
        self.begun += 1;
        Ticket(Some(self.begun))
    }

    /// The message is on its way; `outcome` is told what becomes of it.
    pub(super) fn push(&mut self, outcome: Option<ReplySender<Outcome>>) {
        self.pending.push_back(Pending {
            reply: None,
            outcome,
            stopped: false,
        });
    }

    /// The message is not sent.
    pub(super) fn stop(&mut self) {
        if self.pending.is_empty() {
            self.finished += 1;
            return;
        }
        self.pending.push_back(Pending {
            reply: None,
            outcome: None,
            stopped: true,
        });
    }

    /// The oldest is replied to.
    pub(super) fn reply(&mut self, reply: Payload) {
        if let Some(pending) = self.pending.front_mut() {
            pending.reply = Some(reply);
        }
    }

    /// The oldest is done with, and those that were stopped behind it.
    pub(super) fn finish(&mut self) {
        let Some(pending) = self.pending.pop_front() else {
            return;
        };
        self.finished += 1;
        if let Some(outcome) = pending.outcome {
            outcome.send(Ok(pending.reply));
        }
        while self.pending.front().is_some_and(|pending| pending.stopped) {
            self.pending.pop_front();
            self.finished += 1;
        }
    }

    /// Nobody will say anything any more.
    pub(super) fn fail(&mut self, reason: &Arc<str>) {
        for pending in self.pending.drain(..) {
            if let Some(outcome) = pending.outcome {
                outcome.send(Err(reason.clone()));
            }
        }
    }

    /// Whether the reader is done with a message, as far as it would say.
    pub(super) fn is_done(&self, Ticket(place): Ticket) -> bool {
        place.is_none_or(|place| self.finished >= place)
    }

    pub(super) fn len(&self) -> usize {
        self.pending.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.pending.is_empty()
    }
}
