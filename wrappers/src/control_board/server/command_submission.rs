//! Orders on their way to the device: at once, or in turn; and the watch over the motions that they start.

use std::future::Future;
use std::pin::Pin;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use tokio::sync::oneshot;
use yarp_devices::{Axes, AxisIndex, Mode};
use yarp_ports::Answer;
use yarp_wire::{Bottle, Vocab32};

use super::super::messages::{
    Command, Malformed, MotionEnd, MotionState, MotionUpdate, Numbered, Reply, Set,
};
use super::board_request_handler::{Refusal, RequestHandler};
use super::command_queue::{Dropped, Kind, QueuedCommand};
use super::motion_tracker::{AxisEffect, Motion};

/// Interval between queries whether a motion has ended.
const MOTION_POLL_INTERVAL: Duration = Duration::from_millis(5);

/// A command in the queue.
#[derive(Debug)]
pub(super) struct PendingCommand {
    set: Set,
    from: String,
    numbered: bool,
    /// Sends the outcome to the waiting caller; none for streamed commands.
    reply_sender: Option<oneshot::Sender<Result<(), Refusal>>>,
}

/// Outcome of a submitted command so far.
pub(super) enum Submission {
    /// The device took or refused it.
    Done(Result<(), Refusal>),
    /// It waits.
    Queued(Outcome),
}

/// The outcome of a queued command.
pub(super) type Outcome = Pin<Box<dyn Future<Output = Result<(), Refusal>> + Send>>;

/// A result now, or when its turn has come.
pub(super) enum ReplyTiming<T> {
    /// It is there.
    Now(T),
    /// It is ready when the device has executed the command, or another replaced it.
    Later(Pin<Box<dyn Future<Output = T> + Send>>),
}

impl<T> ReplyTiming<T> {
    pub(super) fn later(result: impl Future<Output = T> + Send + 'static) -> Self {
        Self::Later(Box::pin(result))
    }

    #[cfg(test)]
    pub(super) fn now(self) -> T {
        match self {
            Self::Now(result) => result,
            Self::Later(_) => panic!("the device is free"),
        }
    }
}

impl ReplyTiming<Reply> {
    pub(super) fn into_answer(self) -> Answer {
        match self {
            Self::Now(reply) => Answer::reply(reply.into_bottle()),
            Self::Later(reply) => {
                Answer::Later(Box::pin(async { Answer::reply(reply.await.into_bottle()) }))
            }
        }
    }
}

impl RequestHandler {
    /// Submits a command to the device: executed at once if it is free, else queued. Also its number.
    ///
    /// `numbered`: a client wants to know how the motion ends.
    pub(super) fn submit(&self, set: &Set, from: &str, numbered: bool) -> (u64, Submission) {
        let set = &*set.without_repetitions();
        let number = self.motions.number();
        let Some(kind) = Kind::of(set) else {
            return (
                number,
                Submission::Done(self.execute(number, set, numbered)),
            );
        };
        if let Some(_taking) = self.queue.try_acquire() {
            return (
                number,
                Submission::Done(self.execute(number, set, numbered)),
            );
        }
        if let Err(error) = self.check_queueable(set) {
            return (number, Submission::Done(Err(error)));
        }
        let (reply_sender, pending_outcome) = oneshot::channel();
        let waiting = PendingCommand {
            set: set.clone(),
            from: from.to_owned(),
            numbered,
            reply_sender: Some(reply_sender),
        };
        self.queue(number, kind, waiting);
        let pending_outcome = async { pending_outcome.await.unwrap_or(Err(Refusal::Dropped(0))) };
        (number, Submission::Queued(Box::pin(pending_outcome)))
    }

    /// Handles a streamed command; a malformed one changes nothing.
    pub(super) fn handle_command(&self, command: Command, from: &str) {
        let streamed = match command.parse() {
            Ok(streamed) => streamed,
            Err(error) => return self.refused(&error, from),
        };
        let set = Set::Values(streamed.setting, streamed.selection, command.values);
        let set = set.without_repetitions().into_owned();
        if let Err(error) = self.check_queueable(&set) {
            return self.refused(&error, from);
        }
        let waiting = PendingCommand {
            set,
            from: from.to_owned(),
            numbered: false,
            reply_sender: None,
        };
        let kind = Kind::of_streamed(streamed.setting);
        self.queue(self.motions.number(), kind, waiting);
    }

    /// Checks a command well enough that it may replace a queued one: its axes and its values, for which the device
    /// is not needed. Limits and modes may change before its turn comes; the device judges those then.
    fn check_queueable(&self, set: &Set) -> Result<(), Refusal> {
        let axes = set.axes();
        let Set::Values(_, _, values) = set else {
            return Ok(axes.check(self.axes())?);
        };
        axes.check_command(self.axes(), "values", values.len())?;
        Ok(axes.check_finite(self.axes(), "value", values)?)
    }

    fn queue(&self, number: u64, kind: Kind, waiting: PendingCommand) {
        let mut axes = vec![false; self.axes()];
        for axis in known(waiting.set.axes(), self.axes()) {
            axes[axis.index()] = true;
        }
        let order = QueuedCommand {
            number,
            kind,
            axes,
            what: waiting,
        };
        for dropped in self.queue.enqueue(order) {
            self.dropped(dropped);
        }
    }

    fn dropped(&self, (order, by): Dropped<PendingCommand>) {
        let PendingCommand {
            set,
            from,
            numbered,
            reply_sender,
        } = order.what;
        tracing::debug!(board = %self.name(), from, "order {} dropped for {by}", order.number);
        let Some(reply_sender) = reply_sender else {
            return;
        };
        if self.is_watched(&set, numbered) {
            let axes = known(set.axes(), self.axes()).collect();
            self.motions.dropped(order.number, axes, by);
        }
        // A caller that has stopped waiting needs no reply.
        let _ = reply_sender.send(Err(Refusal::Dropped(by)));
    }

    /// Executes queued commands until the queue ends. Blocks.
    pub(super) fn run_queue(&self) {
        while let Some((order, taking)) = self.queue.next() {
            self.run_queued(order);
            drop(taking);
        }
    }

    /// Executes one queued command, if there is one.
    #[cfg(test)]
    pub(super) fn run_next_queued(&self) -> bool {
        let waits = self.queue.try_acquire().is_none();
        if waits && let Some((order, _taking)) = self.queue.next() {
            self.run_queued(order);
        }
        waits
    }

    fn run_queued(&self, order: QueuedCommand<PendingCommand>) {
        let PendingCommand {
            set,
            from,
            numbered,
            reply_sender,
        } = order.what;
        let outcome = self.execute(order.number, &set, numbered);
        match reply_sender {
            Some(reply_sender) => {
                if let Err(error) = &outcome {
                    self.report_refusal(&format_args!("{set:?} from {from} refused: {error}"));
                }
                // A caller that has stopped waiting needs no reply.
                let _ = reply_sender.send(outcome);
            }
            None => match outcome {
                Ok(()) => self.refusing.store(false, Ordering::Relaxed),
                Err(error) => self.refused(&error, &from),
            },
        }
    }

    fn is_watched(&self, set: &Set, numbered: bool) -> bool {
        let asked = numbered || self.motions.readers.load(Ordering::Relaxed) > 0;
        asked && AxisEffect::of(set) == Some(AxisEffect::Move)
    }

    /// Calls the device, and keeps the book of motions.
    fn execute(&self, number: u64, set: &Set, numbered: bool) -> Result<(), Refusal> {
        let Some(touch) = AxisEffect::of(set) else {
            return self.order(set);
        };
        let axes = set.axes();
        let watched = self.is_watched(set, numbered);
        let begun = (self.motions).begin(number, known(axes, self.axes()));
        // From before the move: a fault may change them at any time from now on.
        let modes = if watched { self.modes_of(axes) } else { None };
        let outcome = self.order(set);
        let motion = (watched && outcome.is_ok()).then(|| Motion {
            axes: known(axes, self.axes()).collect(),
            modes,
            targets: self.targets_of(axes),
        });
        let touch = outcome.is_ok().then_some(touch);
        self.motions.passed(begun, touch, motion);
        outcome
    }

    fn modes_of(&self, axes: Axes<'_>) -> Option<Vec<Mode>> {
        self.control_mode().ok()?.control_modes(axes).ok()
    }

    fn targets_of(&self, axes: Axes<'_>) -> Option<Vec<f64>> {
        self.position_control().ok()?.target_positions(axes).ok()
    }

    /// Watches over motions until that ends. Blocks.
    pub(super) fn watch(&self) {
        let mut pause = MOTION_POLL_INTERVAL;
        while self.motions.wait(pause) {
            let begun = Instant::now();
            for asked in self.motions.asked() {
                if let Some(end) = self.end_of(&asked.motion) {
                    self.motions.ended(&asked, end);
                }
            }
            // A device that is slow to answer is left alone at least half of the time.
            pause = MOTION_POLL_INTERVAL.max(begun.elapsed());
        }
    }

    /// Returns how a motion has ended by the device; `None` while it moves.
    fn end_of(&self, motion: &Motion) -> Option<MotionEnd> {
        let axes = Axes::Group(&motion.axes);
        let failed = |reason: String| Some(MotionEnd::Failed { reason });
        let done = match self.position_control().map(|board| board.motion_done(axes)) {
            Ok(Ok(done)) => done,
            Ok(Err(error)) => return failed(error.to_string()),
            Err(error) => return failed(error.to_string()),
        };
        // PolledMotion behind `done`: a fault ends a motion, too.
        if let (Some(before), Some(now)) = (&motion.modes, self.modes_of(axes)) {
            let mut pairs = motion.axes.iter().zip(before.iter().zip(now));
            if let Some((axis, (_, mode))) = pairs.find(|(_, (before, now))| *before != now) {
                return failed(self.fault_text(*axis, mode));
            }
        }
        if !done {
            return None;
        }
        match (&motion.targets, self.targets_of(axes)) {
            // Not by a command of this server.
            (Some(before), Some(now)) if *before != now => Some(MotionEnd::Stopped),
            _ => Some(MotionEnd::Done),
        }
    }

    fn fault_text(&self, axis: AxisIndex, mode: Mode) -> String {
        let fault = self.joint_fault().ok();
        let fault = fault.and_then(|faults| faults.last_fault(axis).ok());
        match fault.filter(|fault| fault.code != 0) {
            Some(fault) => format!("joint {axis} is in {mode} mode: {}", fault.message),
            None => format!("joint {axis} is in {mode} mode"),
        }
    }

    /// Executes a message of our own protocol and returns the reply.
    pub(super) fn answer_numbered(
        &self,
        wanted: Result<Numbered, Malformed>,
        from: &str,
    ) -> Answer {
        let set = match wanted {
            Ok(Numbered::Drops) => return Answer::reply(Numbered::drops(self.queue.dropped())),
            Ok(Numbered::Ask(number)) => {
                return Answer::reply(self.motions.motion_state(number).to_bottle());
            }
            Ok(Numbered::Submit(set)) if AxisEffect::of(&set) == Some(AxisEffect::Move) => set,
            Ok(Numbered::Submit(_)) => {
                tracing::info!(board = %self.name(), from, "only moves have numbers");
                return Answer::reply(Bottle::of(Vocab32::FAIL));
            }
            Err(error) => {
                self.report_refusal(&format_args!("command from {from} refused: {error}"));
                return Answer::reply(Bottle::of(Vocab32::FAIL));
            }
        };
        let set = set.without_repetitions();
        let (number, given) = self.submit(&set, from, true);
        let axes: Vec<_> = known(set.axes(), self.axes()).collect();
        match given {
            Submission::Done(outcome) => {
                Answer::reply(outcome_of(number, axes, outcome).to_bottle())
            }
            Submission::Queued(pending_outcome) => Answer::Later(Box::pin(async move {
                Answer::reply(outcome_of(number, axes, pending_outcome.await).to_bottle())
            })),
        }
    }
}

/// Returns the reply to a numbered move.
fn outcome_of(number: u64, axes: Vec<AxisIndex>, outcome: Result<(), Refusal>) -> MotionUpdate {
    let state = match outcome {
        Ok(()) => MotionState::Moving,
        Err(Refusal::Dropped(by)) => MotionState::Ended(MotionEnd::Dropped { by }),
        Err(error) => MotionState::Ended(MotionEnd::Failed {
            reason: error.to_string(),
        }),
    };
    MotionUpdate {
        number,
        axes,
        state,
    }
}

/// The axes that there are. A group may name more of them, some with two values; the device refuses that.
fn known(axes: Axes<'_>, total: usize) -> impl Iterator<Item = AxisIndex> {
    axes.iter(total)
        .filter(move |axis| axis.index() < total)
        .take(total)
}
