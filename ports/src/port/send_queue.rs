//! The queue of messages to send over one connection, and the waiting writers.

mod transport_queue;
mod unacknowledged;

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytes::BytesMut;
use tokio::sync::Notify;
use yarp_wire::Stamp;
use yarp_wire::connection::{Initiator, Progress, ProtocolError};
use yarp_wire::message::Command;

use super::counters::{LatestEnvelope, Traffic};
use super::dedicated_thread::DedicatedThread;
use super::reply_channel::{Outcome, ReplyPool, ReplyReceiver, ReplySender};
use crate::latency::Form;
use crate::latency::{Batch, DatagramBatch, Optimisation};
use crate::socket::Socket;

pub(crate) use transport_queue::Parcel;
use transport_queue::TransportQueue;
pub(crate) use unacknowledged::Ticket;
use unacknowledged::Unacknowledged;

/// Bytes that may be waiting before writers must.
const HIGH_WATER_BYTES: usize = 256 * 1024;

/// The queue between the writers of a connection and the task that sends.
///
/// Small messages are stored contiguously, so that several need few system calls; a message is
/// never delayed for others to follow. Sending small messages needs no allocation once the buffers
/// have grown.
#[derive(Debug)]
pub(crate) struct SendQueue {
    state: Mutex<State>,
    /// Something was put in.
    pub(crate) filled: Notify,
    /// Room was made, a message was finished, or the connection ended.
    changed: Notify,
    /// Something was put in for the monitors.
    staged: Notify,
    /// `true` if the connection has closed; readable without the lock.
    over: AtomicBool,
    /// The pool of reply channels.
    slots: ReplyPool<Outcome>,
}

#[derive(Debug)]
struct State {
    transport: TransportQueue,
    queued: usize,
    /// Messages put in since `queued` was last 0.
    waiting: usize,
    /// `true` if monitors process messages first.
    monitored: bool,
    /// Messages that the monitors have not seen; their weight is in `queued`.
    staged: VecDeque<Staged>,
    /// Messages not yet acknowledged or replied to, if the reader does so.
    unacknowledged: Unacknowledged,
    closed: Option<Arc<str>>,
    traffic: Traffic,
    newest: LatestEnvelope,
    /// The socket for direct writes while the queue is empty.
    socket: Option<Arc<Socket>>,
    /// The thread that the connection was given.
    thread: Option<Arc<DedicatedThread>>,
    /// `true` if the sending task has not seen a new `thread` yet.
    moves: bool,
}

/// The side that writes a message to the socket.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Sender {
    /// The connection's task.
    Task,
    /// The caller, if the task has nothing to send.
    Writer,
}

/// The counters of a queue.
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
    pub(super) command: Command,
    pub(super) form: Form,
    answered: bool,
    outcome: Option<ReplySender<Outcome>>,
}

impl Staged {
    /// Returns its weight in the queue; never 0, so that it is counted.
    fn weight(&self) -> usize {
        self.form.pieces.len() + 1
    }
}

impl SendQueue {
    /// For a connection over a socket, or to a reader in this process.
    pub(crate) fn new(initiator: Option<Initiator>) -> Self {
        Self {
            state: Mutex::new(State {
                transport: TransportQueue::new(initiator),
                queued: 0,
                waiting: 0,
                monitored: false,
                staged: VecDeque::new(),
                unacknowledged: Unacknowledged::default(),
                closed: None,
                traffic: Traffic::default(),
                newest: LatestEnvelope::default(),
                socket: None,
                thread: None,
                moves: false,
            }),
            filled: Notify::new(),
            changed: Notify::new(),
            staged: Notify::new(),
            over: AtomicBool::new(false),
            slots: ReplyPool::default(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a message in; the answer serves to wait until the reader is done with it.
    pub(crate) fn push(&self, command: &Command, form: &Form) -> Result<Ticket, Arc<str>> {
        self.put(self.state(), command, form, None, Sender::Task)
    }

    /// Queues like [`SendQueue::push`], for messages with intervals: if nothing else is queued, the
    /// caller writes it as far as the socket accepts it, and no task is woken.
    pub(crate) fn push_now(&self, command: &Command, form: &Form) -> Result<Ticket, Arc<str>> {
        let sender = match Optimisation::DirectWrite.is_enabled() {
            true => Sender::Writer,
            false => Sender::Task,
        };
        self.put(self.state(), command, form, None, sender)
    }

    /// Queues like [`SendQueue::push`] if earlier messages leave room, else `None`.
    pub(crate) fn try_push(
        &self,
        command: &Command,
        form: &Form,
    ) -> Option<Result<Ticket, Arc<str>>> {
        let state = self.state();
        let has_room = state.queued < HIGH_WATER_BYTES || state.closed.is_some();
        has_room.then(|| self.put(state, command, form, None, Sender::Task))
    }

    /// Puts a request in; gives what to wait for the reply with.
    pub(crate) fn request(
        &self,
        command: &Command,
        payload: &Form,
    ) -> Result<ReplyReceiver<Outcome>, Arc<str>> {
        let (sender, call) = self.slots.begin();
        self.put(self.state(), command, payload, Some(sender), Sender::Task)?;
        Ok(call)
    }

    fn put(
        &self,
        mut state: MutexGuard<'_, State>,
        command: &Command,
        form: &Form,
        outcome: Option<ReplySender<Outcome>>,
        sender: Sender,
    ) -> Result<Ticket, Arc<str>> {
        if let Some(reason) = &state.closed {
            return Err(reason.clone());
        }
        let answered = state.transport.is_answered(command);
        let ticket = match answered {
            true => state.unacknowledged.begin(),
            false => Ticket::NONE,
        };
        if state.monitored {
            let staged = Staged {
                command: command.clone(),
                form: form.clone(),
                answered,
                outcome,
            };
            state.queued += staged.weight();
            state.staged.push_back(staged);
            drop(state);
            self.staged.notify_one();
        } else {
            // The sending task has been notified and will include this message, or is idle.
            let (is_expected, is_idle) = (state.transport.is_expected(), state.queued == 0);
            state.put(command, form, answered, outcome);
            let is_sent = sender == Sender::Writer && is_idle && state.send();
            drop(state);
            if !is_expected && !is_sent {
                self.filled.notify_one();
            }
        }
        Ok(ticket)
    }

    /// From now on [`SendQueue::push_now`] sends on this, or on nothing.
    pub(super) fn lend(&self, socket: Option<Arc<Socket>>) {
        let mut state = self.state();
        if state.closed.is_none() {
            state.socket = socket;
        }
    }

    /// From now on messages wait for [`SendQueue::next_staged`] first.
    pub(super) fn set_monitored(&self) {
        self.state().monitored = true;
    }

    /// Waits for the oldest message that the monitors have not processed; `None` once the
    /// connection has closed.
    pub(super) async fn next_staged(&self) -> Option<Staged> {
        loop {
            let more = self.staged.notified();
            {
                let mut state = self.state();
                if state.closed.is_some() {
                    return None;
                }
                if let Some(staged) = state.staged.pop_front() {
                    return Some(staged);
                }
            }
            more.await;
        }
    }

    /// Sends the output of the monitors for a message; `None` if they stopped it.
    pub(super) fn finish_staged(&self, staged: Staged, form: Option<Form>) {
        let mut state = self.state();
        let weight = staged.weight();
        let Staged {
            command,
            answered,
            outcome,
            ..
        } = staged;
        state.less(weight);
        let told = match (&state.closed, form) {
            (Some(reason), _) => Some(reason.clone()),
            (None, Some(form)) => {
                state.put(&command, &form, answered, outcome);
                drop(state);
                self.filled.notify_one();
                self.changed.notify_waiters();
                return;
            }
            (None, None) => {
                if answered {
                    state.unacknowledged.stop();
                }
                Some("a monitor stopped the message".into())
            }
        };
        drop(state);
        if let (Some(outcome), Some(reason)) = (outcome, told) {
            outcome.send(Err(reason));
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
            unanswered: state.unacknowledged.len(),
            stamp: state.newest.stamp(),
        }
    }

    /// Returns whether more than this many earlier messages are pending.
    pub(crate) fn is_behind(&self, messages: usize) -> bool {
        let state = self.state();
        let waiting = state.waiting + state.staged.len();
        let queued = state.queued > 0 && (messages == 0 || waiting > messages);
        queued || state.unacknowledged.len() > messages
    }

    /// Waits until earlier messages leave room for another.
    pub(crate) async fn room(&self) -> Result<(), Arc<str>> {
        self.wait_until(|state| state.queued < HIGH_WATER_BYTES)
            .await
    }

    /// Waits until every message has been sent, and acknowledged if the carrier has
    /// acknowledgements.
    pub(crate) async fn drained(&self) -> Result<(), Arc<str>> {
        self.wait_until(|state| state.queued == 0 && state.unacknowledged.is_empty())
            .await
    }

    /// Waits until the reader has completed a message, if it reports that.
    pub(crate) async fn done(&self, ticket: Ticket) -> Result<(), Arc<str>> {
        if !ticket.is_awaited() {
            return Ok(());
        }
        let is_done = |state: &State| state.unacknowledged.is_done(ticket);
        let outcome = self.wait_until(is_done).await;
        // Messages completed before the connection closed count as completed.
        match is_done(&self.state()) {
            true => Ok(()),
            false => outcome,
        }
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

    /// Exchanges an empty batch for all queued bytes; returns `true`, once, when the connection
    /// must move.
    pub(crate) fn take(&self, empty: &mut Batch) -> bool {
        let mut state = self.state();
        if let TransportQueue::Stream(_, batch) = &mut state.transport {
            std::mem::swap(batch, empty);
        }
        std::mem::take(&mut state.moves)
    }

    /// Exchanges like [`SendQueue::take`], for datagrams.
    pub(crate) fn take_datagrams(&self, empty: &mut DatagramBatch) -> bool {
        let mut state = self.state();
        if let TransportQueue::Datagrams(_, waiting) = &mut state.transport {
            std::mem::swap(waiting, empty);
        }
        std::mem::take(&mut state.moves)
    }

    /// Has the connection move, unless it was given a thread before; gives the one that it has now.
    pub(crate) fn give(&self, thread: Arc<DedicatedThread>) -> Arc<DedicatedThread> {
        let mut state = self.state();
        if let Some(has) = &state.thread {
            return has.clone();
        }
        state.thread = Some(thread.clone());
        state.moves = true;
        drop(state);
        self.filled.notify_one();
        thread
    }

    /// Returns the connection's own thread, if it was given one.
    pub(crate) fn thread(&self) -> Option<Arc<DedicatedThread>> {
        self.state().thread.clone()
    }

    /// Returns the next message for a reader in this process.
    pub(crate) fn take_parcel(&self) -> Option<Parcel> {
        match &mut self.state().transport {
            TransportQueue::Local(waiting, _) => waiting.pop_front(),
            _ => None,
        }
    }

    /// A reader in this process is done with a message of this many bytes.
    pub(crate) fn delivered(&self, bytes: usize, reply: Option<&Form>) {
        let mut state = self.state();
        state.less(bytes);
        if let Some(reply) = reply.and_then(|reply| state.transport.reply(reply)) {
            state.unacknowledged.reply(reply);
        }
        state.unacknowledged.finish();
        drop(state);
        self.changed.notify_waiters();
    }

    /// Takes note that `bytes` have been handed to the socket.
    pub(crate) fn sent(&self, bytes: usize) {
        let mut state = self.state();
        state.less(bytes);
        let notify = state.queued < HIGH_WATER_BYTES;
        drop(state);
        if notify {
            self.changed.notify_waiters();
        }
    }

    /// Consumes bytes from the peer. Automatic answers are queued even if they end the connection.
    pub(crate) fn receive(&self, input: &mut BytesMut) -> Result<(), ProtocolError> {
        let mut state = self.state();
        let state = &mut *state;
        let TransportQueue::Stream(initiator, batch) = &mut state.transport else {
            return Ok(());
        };
        let mut finished = false;
        let end = loop {
            let progress = match initiator.poll(input) {
                Ok(Some(progress)) => progress,
                Ok(None) => break Ok(()),
                Err(error) => break Err(error),
            };
            match progress {
                Progress::Reply(payload) => {
                    let last = !initiator.carrier().acknowledges;
                    state.unacknowledged.reply(payload);
                    if last {
                        state.unacknowledged.finish();
                        finished = true;
                    }
                }
                Progress::Done => {
                    state.unacknowledged.finish();
                    finished = true;
                }
                Progress::Ready | Progress::Lines(_) => {}
            }
        };
        let said = initiator.take_output();
        state.queued += said.len();
        batch.buffer().extend_from_slice(&said);
        if finished {
            self.changed.notify_waiters();
        }
        end
    }

    /// Ends the connection for all who wait, now and later.
    pub(crate) fn close(&self, reason: &str) {
        let reason: Arc<str> = reason.into();
        let mut state = self.state();
        if state.closed.is_none() {
            state.closed = Some(reason.clone());
        }
        state.unacknowledged.fail(&reason);
        for staged in std::mem::take(&mut state.staged) {
            if let Some(outcome) = staged.outcome {
                outcome.send(Err(reason.clone()));
            }
        }
        state.transport.clear();
        state.socket = None;
        drop(state);
        self.over.store(true, Ordering::Release);
        self.changed.notify_waiters();
        self.filled.notify_one();
        self.staged.notify_one();
    }

    /// Returns whether the peer owes an answer, and nothing is queued meanwhile.
    pub(crate) fn awaits_answer(&self) -> bool {
        let state = self.state();
        state.queued == 0 && !state.unacknowledged.is_empty()
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.over.load(Ordering::Acquire)
    }
}

impl State {
    /// Lays a message behind those that are to be sent.
    fn put(
        &mut self,
        command: &Command,
        form: &Form,
        answered: bool,
        outcome: Option<ReplySender<Outcome>>,
    ) {
        if let Command::Data { envelope, .. } = command {
            self.traffic.messages += 1;
            self.traffic.bytes += form.pieces.len() as u64;
            if let Some(envelope) = envelope {
                self.newest.keep(envelope);
            }
        }
        self.waiting += 1;
        self.queued += self.transport.put(command, form);
        if answered {
            self.unacknowledged.push(outcome);
        }
    }

    /// Writes as much as the socket accepts now; returns whether that was all. No other writer may
    /// be active. An error here recurs in the task, which handles it.
    fn send(&mut self) -> bool {
        let (Some(socket), TransportQueue::Stream(_, batch)) = (&self.socket, &mut self.transport)
        else {
            return false;
        };
        let mut sent = 0;
        let _ = batch.write_to(socket, |bytes| sent += bytes);
        self.less(sent);
        self.queued == 0
    }

    /// So many bytes are not to be sent any more.
    fn less(&mut self, bytes: usize) {
        self.queued = self.queued.saturating_sub(bytes);
        if self.queued == 0 {
            self.waiting = 0;
        }
    }
}
