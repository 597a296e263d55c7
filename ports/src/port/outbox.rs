//! What is to be sent over one connection, and who waits for it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytes::{Bytes, BytesMut};
use tokio::sync::{Notify, oneshot};
use yarp_wire::Stamp;
use yarp_wire::carrier::Transport;
use yarp_wire::connection::{Initiator, Progress, ProtocolError};
use yarp_wire::message::{Command, Payload};

use super::counters::{Newest, Traffic};

/// What becomes of a message that somebody waits for.
pub(crate) type Outcome = Result<Option<Payload>, Arc<str>>;

/// Bytes that may be waiting before writers must.
const HIGH_WATER: usize = 256 * 1024;
/// Payloads from this size on are sent from where they are instead of being copied.
const SHARED: usize = 16 * 1024;

/// The queue between those who write to a connection and the task that owns its socket.
///
/// Small messages are laid one behind the other, so that a writer that runs ahead costs few
/// system calls; a message is never held back for others to follow.
#[derive(Debug)]
pub(crate) struct Outbox {
    state: Mutex<State>,
    /// Something was put in.
    pub(crate) filled: Notify,
    /// Room was made, a message was finished, or the connection ended.
    changed: Notify,
    /// Something was put in for the monitors.
    staged: Notify,
}

#[derive(Debug)]
struct State {
    initiator: Initiator,
    chunks: VecDeque<Bytes>,
    tail: BytesMut,
    queued: usize,
    /// Whether monitors see messages first.
    monitored: bool,
    /// Messages that the monitors have not seen; their weight is in `queued`.
    staged: VecDeque<Staged>,
    /// One entry per message that is not done with, where the peer says when it is.
    unfinished: VecDeque<Pending>,
    closed: Option<Arc<str>>,
    traffic: Traffic,
    newest: Newest,
}

/// What has been and is to be sent.
#[derive(Debug)]
pub(crate) struct Depth {
    pub(crate) traffic: Traffic,
    pub(crate) queued: usize,
    pub(crate) unanswered: usize,
    pub(crate) stamp: Option<Stamp>,
}

/// A message on its way to the monitors.
#[derive(Debug)]
pub(crate) struct Staged {
    command: Command,
    payload: Bytes,
    outcome: Option<oneshot::Sender<Outcome>>,
}

impl Staged {
    pub(super) fn command(&self) -> &Command {
        &self.command
    }

    pub(super) fn payload(&self) -> &Bytes {
        &self.payload
    }

    /// What it counts for while it waits; never 0, so that it is noticed.
    fn weight(&self) -> usize {
        self.payload.len() + 1
    }
}

#[derive(Debug)]
struct Pending {
    reply: Option<Payload>,
    outcome: Option<oneshot::Sender<Outcome>>,
}

impl Outbox {
    pub(crate) fn new(initiator: Initiator) -> Self {
        Self {
            state: Mutex::new(State {
                initiator,
                chunks: VecDeque::new(),
                tail: BytesMut::new(),
                queued: 0,
                monitored: false,
                staged: VecDeque::new(),
                unfinished: VecDeque::new(),
                closed: None,
                traffic: Traffic::default(),
                newest: Newest::default(),
            }),
            filled: Notify::new(),
            changed: Notify::new(),
            staged: Notify::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a message in; gives what to wait for if `watched` and the peer tells the outcome.
    pub(crate) fn push(
        &self,
        command: &Command,
        payload: &Bytes,
        watched: bool,
    ) -> Result<Option<oneshot::Receiver<Outcome>>, Arc<str>> {
        let mut state = self.state();
        if let Some(reason) = &state.closed {
            return Err(reason.clone());
        }
        let mut receiver = None;
        let outcome = (watched && state.is_answered(command)).then(|| {
            let (sender, waiting) = oneshot::channel();
            receiver = Some(waiting);
            sender
        });
        if state.monitored {
            let staged = Staged {
                command: command.clone(),
                payload: payload.clone(),
                outcome,
            };
            state.queued += staged.weight();
            state.staged.push_back(staged);
            drop(state);
            self.staged.notify_one();
            return Ok(receiver);
        }
        state.put(command, payload, outcome);
        drop(state);
        self.filled.notify_one();
        Ok(receiver)
    }

    /// From now on messages wait for [`Outbox::next_staged`] first.
    pub(super) fn set_monitored(&self) {
        self.state().monitored = true;
    }

    /// The oldest message that the monitors have not seen, as soon as there is one; `None` once
    /// the connection has ended.
    pub(super) async fn next_staged(&self) -> Option<Staged> {
        loop {
            let staged = self.staged.notified();
            {
                let mut state = self.state();
                if state.closed.is_some() {
                    return None;
                }
                if let Some(staged) = state.staged.pop_front() {
                    return Some(staged);
                }
            }
            staged.await;
        }
    }

    /// Sends what the monitors have made of a message; `None` if they stopped it.
    pub(super) fn finish_staged(&self, staged: Staged, payload: Option<Bytes>) {
        let mut state = self.state();
        // What the connection took with it when it ended is told below.
        state.queued = state.queued.saturating_sub(staged.weight());
        let wants_reply = matches!(staged.command, Command::Data { reply: true, .. });
        let told = match (&state.closed, &payload) {
            (Some(reason), _) => Some(Err(reason.clone())),
            (None, None) if wants_reply => Some(Err("a monitor stopped the message".into())),
            (None, None) => Some(Ok(None)),
            (None, Some(_)) => None,
        };
        if let Some(outcome) = told {
            drop(state);
            if let Some(waiting) = staged.outcome {
                // Whoever asked may have stopped waiting.
                let _ = waiting.send(outcome);
            }
        } else if let Some(payload) = payload {
            state.put(&staged.command, &payload, staged.outcome);
            drop(state);
            self.filled.notify_one();
        }
        self.changed.notify_waiters();
    }

    /// A message was not sent.
    pub(crate) fn count_dropped(&self) {
        self.state().traffic.dropped += 1;
    }

    pub(crate) fn depth(&self) -> Depth {
        let state = self.state();
        Depth {
            traffic: state.traffic,
            queued: state.queued,
            unanswered: state.unfinished.len(),
            stamp: state.newest.stamp(),
        }
    }

    /// Whether an earlier message is still on its way.
    pub(crate) fn is_busy(&self) -> bool {
        let state = self.state();
        state.queued > 0 || !state.unfinished.is_empty()
    }

    /// Whether earlier messages leave room for another, or nothing is to be waited for any more.
    pub(crate) fn has_room(&self) -> bool {
        let state = self.state();
        state.queued < HIGH_WATER || state.closed.is_some()
    }

    /// Waits until earlier messages leave room for another.
    pub(crate) async fn room(&self) -> Result<(), Arc<str>> {
        self.wait_until(|state| state.queued < HIGH_WATER).await
    }

    /// Waits until every message has been handed over, and acknowledged where that is the custom.
    pub(crate) async fn drained(&self) -> Result<(), Arc<str>> {
        self.wait_until(|state| state.queued == 0 && state.unfinished.is_empty())
            .await
    }

    /// Waits for the end of the connection; tells why it ended.
    pub(crate) async fn ended(&self) -> Arc<str> {
        loop {
            if let Err(reason) = self.wait_until(|_| false).await {
                return reason;
            }
        }
    }

    async fn wait_until(&self, done: impl Fn(&State) -> bool) -> Result<(), Arc<str>> {
        loop {
            let changed = self.changed.notified();
            tokio::pin!(changed);
            changed.as_mut().enable();
            {
                let state = self.state();
                if let Some(reason) = &state.closed {
                    return Err(reason.clone());
                }
                if done(&state) {
                    return Ok(());
                }
            }
            changed.await;
        }
    }

    /// Moves all that is to be sent behind what `batch` still holds.
    pub(crate) fn take(&self, batch: &mut VecDeque<Bytes>) {
        let mut state = self.state();
        batch.append(&mut state.chunks);
        if !state.tail.is_empty() {
            let tail = state.tail.split().freeze();
            batch.push_back(tail);
        }
    }

    /// Takes note that `bytes` have been handed to the socket.
    pub(crate) fn sent(&self, bytes: usize) {
        let mut state = self.state();
        state.queued = state.queued.saturating_sub(bytes);
        let notify = state.queued < HIGH_WATER;
        drop(state);
        if notify {
            self.changed.notify_waiters();
        }
    }

    /// Takes what the peer said.
    pub(crate) fn receive(&self, input: &mut BytesMut) -> Result<(), ProtocolError> {
        let mut state = self.state();
        let mut finished = false;
        while let Some(progress) = state.initiator.poll(input)? {
            match progress {
                Progress::Reply(payload) => {
                    let last = !state.initiator.carrier().acknowledges;
                    if let Some(pending) = state.unfinished.front_mut() {
                        pending.reply = Some(payload);
                    }
                    if last {
                        state.finish();
                        finished = true;
                    }
                }
                Progress::Done => {
                    state.finish();
                    finished = true;
                }
                Progress::Ready | Progress::Lines(_) => {}
            }
        }
        let said = state.initiator.said();
        state.queued += said.len();
        state.tail.extend_from_slice(&said);
        drop(state);
        if finished {
            self.changed.notify_waiters();
        }
        Ok(())
    }

    /// Ends the connection for all who wait, now and later.
    pub(crate) fn close(&self, reason: &str) {
        let reason: Arc<str> = reason.into();
        let mut state = self.state();
        if state.closed.is_none() {
            state.closed = Some(reason.clone());
        }
        for pending in state.unfinished.drain(..) {
            if let Some(outcome) = pending.outcome {
                // Nobody may be waiting any more.
                let _ = outcome.send(Err(reason.clone()));
            }
        }
        for staged in std::mem::take(&mut state.staged) {
            if let Some(outcome) = staged.outcome {
                let _ = outcome.send(Err(reason.clone()));
            }
        }
        state.chunks.clear();
        state.tail.clear();
        drop(state);
        self.changed.notify_waiters();
        self.filled.notify_one();
        self.staged.notify_one();
    }

    /// Whether the peer owes an answer, and there is nothing to send meanwhile.
    pub(crate) fn awaits_answer(&self) -> bool {
        let state = self.state();
        state.queued == 0 && !state.unfinished.is_empty()
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.state().closed.is_some()
    }
}

impl State {
    /// Whether the peer tells what becomes of such a message.
    fn is_answered(&self, command: &Command) -> bool {
        self.initiator.carrier().acknowledges
            || matches!(command, Command::Admin | Command::Data { reply: true, .. })
    }

    /// Lays a message behind those that are to be sent.
    fn put(
        &mut self,
        command: &Command,
        payload: &Bytes,
        outcome: Option<oneshot::Sender<Outcome>>,
    ) {
        let answered = self.is_answered(command);
        let Self {
            initiator,
            chunks,
            tail,
            queued,
            unfinished,
            traffic,
            newest,
            ..
        } = self;
        if let Command::Data { envelope, .. } = command {
            traffic.messages += 1;
            traffic.bytes += payload.len() as u64;
            if let Some(envelope) = envelope {
                newest.keep(envelope);
            }
        }
        let before = tail.len();
        let datagrams = initiator.carrier().transport == Transport::Datagrams;
        initiator.send(command, payload.len(), tail);
        if payload.len() < SHARED || datagrams {
            tail.extend_from_slice(payload);
            *queued += tail.len() - before;
            if datagrams {
                // Each chunk is one message.
                chunks.push_back(tail.split().freeze());
            }
        } else {
            *queued += tail.len() - before + payload.len();
            chunks.push_back(tail.split().freeze());
            chunks.push_back(payload.clone());
        }
        if answered {
            unfinished.push_back(Pending {
                reply: None,
                outcome,
            });
        }
    }

    /// The oldest unfinished message is done with.
    fn finish(&mut self) {
        if let Some(pending) = self.unfinished.pop_front()
            && let Some(outcome) = pending.outcome
        {
            // Whoever asked may have stopped waiting.
            let _ = outcome.send(Ok(pending.reply));
        }
    }
}
