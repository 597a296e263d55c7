//! Messages whose completion the reader reports, which it does in order.

use std::collections::VecDeque;
use std::sync::Arc;

use yarp_wire::message::Payload;

use super::super::reply_channel::{Outcome, ReplySender};

/// The position of a message; `None` if the reader does not report completion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ticket(Option<u64>);

impl Ticket {
    /// A message without completion report.
    pub(super) const NONE: Self = Self(None);

    /// Returns whether the reader will say when it is done.
    pub(crate) fn is_awaited(self) -> bool {
        self.0.is_some()
    }
}

/// Those that it has not said so of.
#[derive(Debug, Default)]
pub(super) struct Unacknowledged {
    /// Those of them that were handed on.
    pending: VecDeque<Pending>,
    /// Number of messages since the beginning.
    begun: u64,
    /// Number of completed messages.
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

    /// Adds a sent message; `outcome` receives its result.
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

    /// Fails all pending messages.
    pub(super) fn fail(&mut self, reason: &Arc<str>) {
        for pending in self.pending.drain(..) {
            if let Some(outcome) = pending.outcome {
                outcome.send(Err(reason.clone()));
            }
        }
    }

    /// Returns whether the reader has completed a message, or would not report it.
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
