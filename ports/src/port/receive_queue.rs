//! The queue of received messages.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

use tokio::sync::Notify;

use super::Received;

/// The behaviour when messages arrive faster than they are read.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Queue {
    /// Only the newest is kept, as stock's `BufferedPort` does by default.
    Latest,
    /// This many are kept; then the connection waits, and with `tcp` its sender.
    Wait(usize),
    /// So many are kept; then the oldest is dropped.
    DropOldest(usize),
    /// So many are kept; then new ones are dropped.
    DropNewest(usize),
    /// All are kept and none is lost, like stock's `BufferedPort` after `setStrict`: a slow reader
    /// does not block a writer. Only when 64 MiB are queued does the connection wait, as under
    /// [`Queue::Wait`]; stock continues until its memory is exhausted.
    Strict,
}

/// Bytes that may wait under [`Queue::Strict`].
const MAX_STRICT_BYTES: usize = 64 << 20;

/// Messages of all input connections of a port, in order of arrival.
#[derive(Debug)]
pub(crate) struct ReceiveQueue {
    queue: Queue,
    state: Mutex<State>,
    arrived: Notify,
    room: Notify,
}

#[derive(Debug, Default)]
struct State {
    messages: VecDeque<Received>,
    /// Their approximate total size in bytes; maintained only under [`Queue::Strict`].
    bytes: usize,
    dropped: u64,
    closed: bool,
}

/// Bytes that a message takes while it waits, about.
fn weight(message: &Received) -> usize {
    let envelope = message
        .envelope
        .as_ref()
        .map_or(0, |envelope| envelope.len());
    size_of::<Received>() + message.payload.len() + envelope
}

impl ReceiveQueue {
    pub(crate) fn new(queue: Queue) -> Self {
        Self {
            queue,
            state: Mutex::default(),
            arrived: Notify::new(),
            room: Notify::new(),
        }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Queues a message; waits only under [`Queue::Wait`] and [`Queue::Strict`]. Returns the
    /// connection of a dropped message.
    pub(crate) async fn push(&self, mut message: Received) -> Option<u64> {
        loop {
            let room = self.room.notified();
            tokio::pin!(room);
            room.as_mut().enable();
            match self.try_push(message) {
                Ok(dropped) => return dropped,
                Err(waiting) => message = waiting,
            }
            room.await;
        }
    }

    /// Queues like [`ReceiveQueue::push`], but returns the message if that would wait.
    #[expect(
        clippy::result_large_err,
        reason = "what is no error need not be small"
    )]
    pub(crate) fn try_push(&self, message: Received) -> Result<Option<u64>, Received> {
        // The size is only needed there.
        let weight = match self.queue {
            Queue::Strict => weight(&message),
            _ => 0,
        };
        let mut state = self.state();
        if state.closed {
            return Ok(None);
        }
        let full = |limit: usize| state.messages.len() >= limit.max(1);
        let dropped = match self.queue {
            Queue::Wait(limit) if full(limit) => return Err(message),
            // One that is too large comes alone.
            Queue::Strict if full(1) && state.bytes + weight > MAX_STRICT_BYTES => {
                return Err(message);
            }
            Queue::DropNewest(limit) if full(limit) => {
                state.dropped += 1;
                return Ok(Some(message.connection));
            }
            Queue::Latest if full(1) => state.messages.pop_front(),
            Queue::DropOldest(limit) if full(limit) => state.messages.pop_front(),
            _ => None,
        };
        state.dropped += u64::from(dropped.is_some());
        state.bytes += weight;
        state.messages.push_back(message);
        drop(state);
        self.arrived.notify_one();
        Ok(dropped.map(|message| message.connection))
    }

    /// Waits for the oldest queued message; `None` once closed and empty.
    pub(crate) async fn pop(&self) -> Option<Received> {
        loop {
            let arrived = self.arrived.notified();
            {
                let mut state = self.state();
                if let Some(message) = self.take(&mut state) {
                    let more = !state.messages.is_empty();
                    drop(state);
                    if more {
                        self.arrived.notify_one();
                    }
                    if matches!(self.queue, Queue::Wait(_) | Queue::Strict) {
                        self.room.notify_one();
                    }
                    return Some(message);
                }
                if state.closed {
                    drop(state);
                    self.arrived.notify_one();
                    return None;
                }
            }
            arrived.await;
        }
    }

    fn take(&self, state: &mut State) -> Option<Received> {
        let message = state.messages.pop_front()?;
        if self.queue == Queue::Strict {
            state.bytes -= weight(&message);
        }
        Some(message)
    }

    /// Returns the oldest message kept, if there is one now.
    pub(crate) fn try_pop(&self) -> Option<Received> {
        let message = self.take(&mut self.state());
        self.room.notify_one();
        message
    }

    /// Messages that were dropped, as the queue's rule says.
    pub(crate) fn dropped(&self) -> u64 {
        self.state().dropped
    }

    /// Messages that wait to be read.
    pub(crate) fn waiting(&self) -> usize {
        self.state().messages.len()
    }

    /// Ends all waits, now and later.
    pub(crate) fn close(&self) {
        self.state().closed = true;
        self.arrived.notify_one();
        self.room.notify_waiters();
    }
}
