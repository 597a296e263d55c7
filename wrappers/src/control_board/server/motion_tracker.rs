//! Numbered motions: those in progress, and how the others ended.
//!
//! The device is queried for a motion without any lock. Its answer counts only if no command was started on the axes
//! of the motion from before the query until after the answer: [`MotionTracker::begin`] makes such answers void.

use std::collections::{BTreeMap, HashMap, VecDeque, hash_map::RandomState};
use std::hash::BuildHasher;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::mpsc;
use yarp_devices::{AxisIndex, Mode};

use super::super::messages::{Action, MotionEnd, MotionState, MotionUpdate, Set, Setting};

/// Maximum number of remembered completions.
const MAX_REMEMBERED_MOTIONS: usize = 1000;
/// Maximum number of announcements queued for the port; a client that misses one queries the board.
const MAX_QUEUED_ANNOUNCEMENTS: usize = 1000;
/// Each run has so many numbers of its own.
const NUMBERS_PER_RUN: u64 = 1_000_000;

/// Effect of a command on motions of its axes, once the device has accepted it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum AxisEffect {
    /// It starts a motion, and takes the axes.
    Move,
    /// It takes the axes.
    Takes,
    /// It stops them.
    Stops,
    /// It sets these modes; only other ones end a motion.
    Modes(Vec<Mode>),
    /// It ends motions for this reason.
    Breaks(&'static str),
}

impl AxisEffect {
    /// Returns the effect of a command; `None` if it affects no motion.
    pub(super) fn of(set: &Set) -> Option<Self> {
        Some(match set {
            Set::Values(setting, ..) => match setting {
                Setting::Position | Setting::Distance => Self::Move,
                Setting::Velocity
                | Setting::DirectPosition
                | Setting::DirectVelocity
                | Setting::Torque
                | Setting::Current
                | Setting::DutyCycle => Self::Takes,
                _ => return None,
            },
            Set::Act(action, _) => match action {
                Action::Stop => Self::Stops,
                Action::Calibrate
                | Action::Home
                | Action::Park
                | Action::CalibrateRobot
                | Action::ParkRobot => Self::Takes,
                Action::DisableAmplifiers => Self::Breaks("the amplifier was switched off"),
                Action::TorqueMode => Self::Breaks("the control mode was changed"),
                _ => return None,
            },
            Set::ControlModes(_, modes) => Self::Modes(modes.clone()),
            Set::CalibrateAxis(..) => Self::Takes,
            Set::ManualBrake(_, true) => Self::Breaks("the brake was put on"),
            _ => return None,
        })
    }
}

/// A motion, as known from its beginning.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    pub(super) axes: Vec<AxisIndex>,
    /// The control modes before it began, if the device has any.
    pub(super) modes: Option<Vec<Mode>>,
    /// Its target, if the device reports it.
    pub(super) targets: Option<Vec<f64>>,
}

/// A command that the device is about to execute.
#[derive(Debug)]
pub(super) struct StartedCommand {
    pub(super) number: u64,
    axes: Vec<AxisIndex>,
    epochs: Vec<u64>,
}

/// A motion for which the device is queried.
#[derive(Debug)]
pub(super) struct PolledMotion {
    number: u64,
    pub(super) motion: Motion,
    epochs: Vec<u64>,
}

#[derive(Debug)]
pub(super) struct MotionTracker {
    state: Mutex<State>,
    /// Signalled when a motion begins, and at the end.
    changed: Condvar,
    next: AtomicU64,
    /// Number of readers of announcements.
    pub(super) readers: AtomicUsize,
    announcements: mpsc::Sender<MotionUpdate>,
}

#[derive(Debug)]
struct State {
    /// For each axis, the number of commands started on it, and of those that the device is executing now.
    axes: Vec<(u64, u32)>,
    moving: BTreeMap<u64, Motion>,
    ended: HashMap<u64, MotionUpdate>,
    /// Their numbers, the oldest first.
    order: VecDeque<u64>,
    over: bool,
}

impl MotionTracker {
    /// Creates a tracker and the receiver of its announcements.
    pub(super) fn new(axes: usize) -> (Self, mpsc::Receiver<MotionUpdate>) {
        let (announcements, announced) = mpsc::channel(MAX_QUEUED_ANNOUNCEMENTS);
        // Random, not the time: an arm's computer may start with the same wrong time each day.
        let run = RandomState::new().hash_one(std::process::id()) >> 32;
        let motions = Self {
            state: Mutex::new(State {
                axes: vec![(0, 0); axes],
                moving: BTreeMap::new(),
                ended: HashMap::new(),
                order: VecDeque::new(),
                over: false,
            }),
            changed: Condvar::new(),
            next: AtomicU64::new((run + 1) * NUMBERS_PER_RUN + 1),
            readers: AtomicUsize::new(0),
            announcements,
        };
        (motions, announced)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The number of the next command.
    pub(super) fn number(&self) -> u64 {
        self.next.fetch_add(1, Ordering::Relaxed)
    }

    /// The device is about to execute a command; its answers about motions on these axes do not count until
    /// [`passed`](Self::passed). The axes are ones that there are.
    pub(super) fn begin(
        &self,
        number: u64,
        axes: impl Iterator<Item = AxisIndex>,
    ) -> StartedCommand {
        let mut state = self.lock();
        let axes: Vec<_> = axes.collect();
        let mut epochs = Vec::with_capacity(axes.len());
        for axis in &axes {
            let (begun, taking) = &mut state.axes[axis.index()];
            *begun += 1;
            // Concurrent commands are not exclusive, in either order of execution.
            epochs.push(if *taking == 0 { *begun } else { 0 });
            *taking += 1;
        }
        StartedCommand {
            number,
            axes,
            epochs,
        }
    }

    /// The device has executed the command (`touch` is its effect on motions), or refused it (`None`). A motion that
    /// began is `motion`, if it is to be watched.
    pub(super) fn passed(
        &self,
        begun: StartedCommand,
        touch: Option<AxisEffect>,
        motion: Option<Motion>,
    ) {
        let mut state = self.lock();
        let mut alone = true;
        for (axis, epoch) in begun.axes.iter().zip(&begun.epochs) {
            let (now, taking) = &mut state.axes[axis.index()];
            *taking -= 1;
            alone &= now == epoch && *taking == 0;
        }
        let Some(touch) = touch else {
            return;
        };
        let ends = |motion: &Motion| match &touch {
            AxisEffect::Modes(modes) => {
                let set = begun.axes.iter().zip(modes);
                let was = |axis| {
                    let place = motion.axes.iter().position(|one| one == axis)?;
                    Some(motion.modes.as_ref().map(|modes| modes[place]))
                };
                set.into_iter()
                    .any(|(axis, mode)| was(axis).is_some_and(|was| was != Some(*mode)))
            }
            _ => motion.axes.iter().any(|axis| begun.axes.contains(axis)),
        };
        let end = match &touch {
            AxisEffect::Move | AxisEffect::Takes => MotionEnd::Superseded { by: begun.number },
            AxisEffect::Stops => MotionEnd::Stopped,
            AxisEffect::Modes(_) => failed("the control mode was changed"),
            AxisEffect::Breaks(reason) => failed(reason),
        };
        let ended: Vec<u64> = state
            .moving
            .iter()
            .filter(|(_, motion)| ends(motion))
            .map(|(number, _)| *number)
            .collect();
        for number in ended {
            self.end_motion(&mut state, number, end.clone());
        }
        let Some(motion) = motion else {
            return;
        };
        state.moving.insert(begun.number, motion);
        if alone {
            self.changed.notify_all();
        } else {
            // It is unknown which of the two the device executed last.
            let end = failed("another order was given while it began");
            self.end_motion(&mut state, begun.number, end);
        }
    }

    /// A command to move never reached the device.
    pub(super) fn dropped(&self, number: u64, axes: Vec<AxisIndex>, by: u64) -> MotionUpdate {
        let news = MotionUpdate {
            number,
            axes,
            state: MotionState::Ended(MotionEnd::Dropped { by }),
        };
        self.remember(&mut self.lock(), news.clone());
        news
    }

    /// Returns the motions in progress on whose axes no command is being started.
    pub(super) fn asked(&self) -> Vec<PolledMotion> {
        let state = self.lock();
        let quiet = |axis: &AxisIndex| state.axes[axis.index()].1 == 0;
        let moving = state.moving.iter();
        moving
            .filter(|(_, motion)| motion.axes.iter().all(quiet))
            .map(|(number, motion)| PolledMotion {
                number: *number,
                motion: motion.clone(),
                epochs: (motion.axes.iter().map(|axis| state.axes[axis.index()].0)).collect(),
            })
            .collect()
    }

    /// The device reports that a motion has ended; that does not count if a command was started on its axes since
    /// [`asked`](Self::asked).
    pub(super) fn ended(&self, asked: &PolledMotion, end: MotionEnd) {
        let mut state = self.lock();
        let mut axes = asked.motion.axes.iter().zip(&asked.epochs);
        if axes.all(|(axis, epoch)| state.axes[axis.index()].0 == *epoch) {
            self.end_motion(&mut state, asked.number, end);
        }
    }

    /// Returns the state of a motion.
    pub(super) fn motion_state(&self, number: u64) -> MotionUpdate {
        let state = self.lock();
        if let Some(news) = state.ended.get(&number) {
            return news.clone();
        }
        let (axes, known) = match state.moving.get(&number) {
            Some(motion) => (motion.axes.clone(), MotionState::Moving),
            None => (Vec::new(), MotionState::Unknown),
        };
        MotionUpdate {
            number,
            axes,
            state: known,
        }
    }

    /// Waits `pause`, then until a motion is in progress; returns whether to continue.
    pub(super) fn wait(&self, pause: Duration) -> bool {
        let over = |state: &mut State| !state.over;
        let waited = self.changed.wait_timeout_while(self.lock(), pause, over);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let idle = |state: &mut State| !state.over && state.moving.is_empty();
        let waited = self.changed.wait_while(state, idle);
        !waited.unwrap_or_else(PoisonError::into_inner).over
    }

    /// Ends the watching.
    pub(super) fn end(&self) {
        self.lock().over = true;
        self.changed.notify_all();
    }

    fn end_motion(&self, state: &mut State, number: u64, end: MotionEnd) {
        if let Some(motion) = state.moving.remove(&number) {
            let news = MotionUpdate {
                number,
                axes: motion.axes,
                state: MotionState::Ended(end),
            };
            self.remember(state, news);
        }
    }

    /// Keeps an end, and announces it.
    fn remember(&self, state: &mut State, news: MotionUpdate) {
        state.order.push_back(news.number);
        state.ended.insert(news.number, news.clone());
        if state.order.len() > MAX_REMEMBERED_MOTIONS
            && let Some(oldest) = state.order.pop_front()
        {
            state.ended.remove(&oldest);
        }
        if let Err(mpsc::error::TrySendError::Full(_)) = self.announcements.try_send(news) {
            tracing::warn!("motion completion not announced: readers are too slow");
        }
    }
}

fn failed(reason: &str) -> MotionEnd {
    MotionEnd::Failed {
        reason: reason.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(axes: &[usize]) -> Option<Motion> {
        let axes: Vec<AxisIndex> = axes.iter().map(|&axis| axis.into()).collect();
        let modes = Some(vec![Mode::Position; axes.len()]);
        Some(Motion {
            axes,
            modes,
            targets: None,
        })
    }

    fn begin(motions: &MotionTracker, axes: &[usize]) -> StartedCommand {
        let axes: Vec<AxisIndex> = axes.iter().map(|&axis| axis.into()).collect();
        motions.begin(motions.number(), axes.into_iter())
    }

    /// Starts a motion and gives its number.
    fn moving(motions: &MotionTracker, axes: &[usize]) -> u64 {
        let begun = begin(motions, axes);
        let number = begun.number;
        motions.passed(begun, Some(AxisEffect::Move), motion(axes));
        number
    }

    fn state(motions: &MotionTracker, number: u64) -> MotionState {
        motions.motion_state(number).state
    }

    #[test]
    fn a_finish_that_was_asked_before_a_newer_order_does_not_count() {
        let (motions, _announced) = MotionTracker::new(3);
        let first = moving(&motions, &[0, 1]);
        let asked = motions.asked();
        let begun = begin(&motions, &[1]);
        motions.ended(&asked[0], MotionEnd::Done);
        assert_eq!(state(&motions, first), MotionState::Moving);
        // While the device executes the newer command it is not even queried.
        assert!(motions.asked().is_empty());
        let second = begun.number;
        motions.passed(begun, Some(AxisEffect::Move), motion(&[1]));
        motions.ended(&asked[0], MotionEnd::Done);
        let over = MotionEnd::Superseded { by: second };
        assert_eq!(state(&motions, first), MotionState::Ended(over));
        assert_eq!(state(&motions, second), MotionState::Moving);
        motions.ended(&motions.asked()[0], MotionEnd::Done);
        assert_eq!(state(&motions, second), MotionState::Ended(MotionEnd::Done));
    }

    #[test]
    fn a_refused_order_ends_nothing() {
        let (motions, _announced) = MotionTracker::new(3);
        let first = moving(&motions, &[0]);
        let begun = begin(&motions, &[0, 0]);
        motions.passed(begun, None, None);
        assert_eq!(state(&motions, first), MotionState::Moving);
        motions.ended(&motions.asked()[0], MotionEnd::Done);
        assert_eq!(state(&motions, first), MotionState::Ended(MotionEnd::Done));
    }

    #[test]
    fn each_end_is_announced_once_and_the_rest_goes_on() {
        let (motions, mut announced) = MotionTracker::new(4);
        let touches = [
            (AxisEffect::Stops, MotionEnd::Stopped),
            (AxisEffect::Breaks("it broke"), failed("it broke")),
            (
                AxisEffect::Modes(vec![Mode::Idle]),
                failed("the control mode was changed"),
            ),
        ];
        let other = moving(&motions, &[1, 2, 3]);
        for (touch, end) in touches {
            let number = moving(&motions, &[0]);
            motions.passed(begin(&motions, &[0]), Some(touch), None);
            let news = announced.try_recv().expect("it is announced");
            assert_eq!((news.number, news.axes), (number, vec![0.into()]));
            assert_eq!(news.state, MotionState::Ended(end));
            assert!(announced.try_recv().is_err());
        }
        let number = moving(&motions, &[0]);
        let same = AxisEffect::Modes(vec![Mode::Position]);
        motions.passed(begin(&motions, &[0]), Some(same), None);
        assert_eq!(state(&motions, number), MotionState::Moving);
        assert_eq!(state(&motions, other), MotionState::Moving);
    }

    #[test]
    fn two_orders_at_once_leave_no_motion_that_might_be_the_others() {
        let (motions, _announced) = MotionTracker::new(2);
        let one = begin(&motions, &[0]);
        let two = begin(&motions, &[0]);
        let (first, second) = (one.number, two.number);
        motions.passed(one, Some(AxisEffect::Move), motion(&[0]));
        motions.passed(two, Some(AxisEffect::Modes(vec![Mode::Idle])), None);
        let MotionState::Ended(MotionEnd::Failed { .. }) = state(&motions, first) else {
            panic!("{:?}", state(&motions, first));
        };
        assert_eq!(state(&motions, second), MotionState::Unknown);
    }

    #[test]
    fn another_run_knows_none_of_these_numbers() {
        let (before, _announced) = MotionTracker::new(1);
        let (after, _announced) = MotionTracker::new(1);
        let number = moving(&before, &[0]);
        assert_eq!(state(&after, number), MotionState::Unknown);
        assert_ne!(
            before.number() / NUMBERS_PER_RUN,
            after.number() / NUMBERS_PER_RUN
        );
        assert!(number < 1 << 53, "a float64 holds it exactly");
    }

    #[test]
    fn old_ends_are_forgotten() {
        let (motions, _announced) = MotionTracker::new(1);
        let first = moving(&motions, &[0]);
        for _ in 0..MAX_REMEMBERED_MOTIONS + 1 {
            moving(&motions, &[0]);
        }
        assert_eq!(state(&motions, first), MotionState::Unknown);
    }
}
