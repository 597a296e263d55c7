//! Orders, and the thread that carries them out.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use nalgebra::Vector3;

use super::arm_adapter::ArmAdapter;
use super::cartesian_settings::{Reach, Settings};
use super::tool_motion::{Followed, Motion, PEAK_TO_MEAN_SPEED, Progress};
use crate::clock;
use crate::kinematics::{Chain, Joints, Pose, Task};
use crate::periodic_timer::{MissedCycles, PeriodicTimer};
use crate::{CartesianEvent, CartesianInfo, Device, DeviceError};

/// Stock's default.
const PERIOD: Duration = Duration::from_millis(10);
/// The protocol version that clients query.
const SERVER_VERSION: &str = "2.0";
/// Maximum number of queued events for a receiver that does not read.
const MAX_QUEUED_EVENTS: usize = 256;
/// Maximum number of stored contexts: a client that keeps storing does not fill the memory.
const MAX_CONTEXTS: usize = 1000;

/// Options of a controller.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CartesianOptions {
    period: Duration,
    part_type: String,
    allow_posture_changes: bool,
}

impl Default for CartesianOptions {
    fn default() -> Self {
        Self {
            period: PERIOD,
            part_type: "wam".to_owned(),
            allow_posture_changes: false,
        }
    }
}

impl CartesianOptions {
    /// A step every 10 ms, for an arm of the kind `wam`.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the interval between positions sent to the arm (stock: `ControllerPeriod`).
    pub fn period(mut self, period: Duration) -> Self {
        self.period = period;
        self
    }

    /// Allows motions that turn joints farther than
    /// [`MAX_JOINT_CHANGE_PER_STEP`](crate::trajectory::MAX_JOINT_CHANGE_PER_STEP) for each step of the way, and short
    /// motions that leave the straight line. Otherwise such a target is refused.
    pub fn allow_posture_changes(mut self, allow: bool) -> Self {
        self.allow_posture_changes = allow;
        self
    }

    /// Sets the kind of arm (stock: `KinematicType`).
    pub fn part_type(mut self, part_type: impl Into<String>) -> Self {
        self.part_type = part_type.into();
        self
    }
}

/// Moves the tool of an arm with `N` joints.
///
/// Its thread moves the arm only during a motion. Dropping it ends the motion; the arm holds.
///
/// ```
/// use std::sync::Arc;
/// use std::time::Duration;
/// use yarp_devices::cartesian::{CartesianController, CartesianOptions};
/// use yarp_devices::wam::{SimulatedWam, WamModel};
/// use yarp_devices::{CartesianControl, Target};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let arm = Arc::new(SimulatedWam::new());
/// let chain = WamModel::<7>::new().chain;
/// let controller = CartesianController::start(arm, chain, CartesianOptions::new())?;
/// controller.go_to(Target::Position([0.4, 0.1, 0.4]), Some(0.5))?;
/// assert!(controller.wait_motion_done(Duration::from_millis(10), Duration::from_secs(60))?);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct CartesianController<const N: usize> {
    pub(super) shared: Arc<Shared<N>>,
    thread: Option<JoinHandle<()>>,
}

pub(super) struct Shared<const N: usize> {
    pub(super) arm: ArmAdapter<N>,
    /// The arm without tip, within the limits of chain and device.
    pub(super) chain: Chain<N>,
    pub(super) info: CartesianInfo,
    allow_posture_changes: bool,
    state: Mutex<State<N>>,
    ending: AtomicBool,
}

impl<const N: usize> std::fmt::Debug for Shared<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shared")
            .field("info", &self.info)
            .finish_non_exhaustive()
    }
}

/// State shared by callers and the thread.
#[derive(Debug)]
pub(super) struct State<const N: usize> {
    pub(super) settings: Settings<N>,
    contexts: BTreeMap<i32, Settings<N>>,
    next_context: i32,
    pub(super) motion: Option<Motion<N>>,
    /// Solution for the last target; before the first target, the pose at which the arm was when it was first read.
    desired: Option<(Pose, Joints<N>)>,
    /// The last command sent to the arm.
    commanded: Option<Joints<N>>,
    pub(super) checkpoints: Vec<f64>,
    listeners: Vec<SyncSender<CartesianEvent>>,
}

impl<const N: usize> CartesianController<N> {
    /// Starts the thread of a controller; the arm stays at rest, and need not be connected yet.
    ///
    /// * `chain`: the geometry of the arm; its tool is the frame at which the tip begins.
    /// * Errors: [`DeviceError::NotSupported`] if the device has no encoders, control modes, limits or direct
    ///   positions, [`DeviceError::WrongCount`] if it does not have `N` axes, [`DeviceError::Start`].
    pub fn start(
        device: Arc<dyn Device>,
        chain: Chain<N>,
        options: CartesianOptions,
    ) -> Result<Self, DeviceError> {
        let arm = ArmAdapter::new(device)?;
        let limits = arm.limits(chain.limits())?;
        let chain = chain.with_limits(limits);
        let settings = Settings::new(limits);
        let shared = Arc::new(Shared {
            info: CartesianInfo {
                server_version: SERVER_VERSION.to_owned(),
                part: "arm".to_owned(),
                part_version: "1.0".to_owned(),
                part_type: options.part_type,
            },
            state: Mutex::new(State {
                contexts: BTreeMap::from([(0, settings.clone())]),
                next_context: 1,
                settings,
                motion: None,
                desired: None,
                commanded: None,
                checkpoints: Vec::new(),
                listeners: Vec::new(),
            }),
            arm,
            chain,
            allow_posture_changes: options.allow_posture_changes,
            ending: AtomicBool::new(false),
        });
        let theirs = shared.clone();
        let thread = thread::Builder::new()
            .name("cartesian-control".into())
            .spawn(move || theirs.run(options.period))
            .map_err(|source| DeviceError::Start {
                what: "the thread of the cartesian controller",
                source,
            })?;
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }
}

impl<const N: usize> Drop for CartesianController<N> {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            if thread.join().is_err() {
                tracing::error!("the thread of the cartesian controller had panicked");
            }
        }
        if let Err(error) = self.shared.stop() {
            tracing::warn!(%error, "the arm was not stopped; it goes where it was sent last");
        }
        let time = clock::now();
        self.shared.lock().tell(CartesianEvent::Closing { time });
    }
}

impl<const N: usize> Device for CartesianController<N> {
    crate::offers! { cartesian_control: CartesianControl }
}

impl<const N: usize> Shared<N> {
    pub(super) fn lock(&self) -> MutexGuard<'_, State<N>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self, period: Duration) {
        let mut timer = PeriodicTimer::new(Instant::now(), period, MissedCycles::Restart);
        while timer.wait(|| self.ending.load(Ordering::Acquire)) {
            // After a pause of the machine a motion continues from where it was: it does not jump.
            self.lock().cycle(self, period.as_secs_f64());
        }
    }

    /// Returns the start of a motion: the last command for an arm that moves or tracks, else the measured positions.
    pub(super) fn stand(&self) -> Result<Joints<N>, DeviceError> {
        let told = {
            let state = self.lock();
            match &state.motion {
                Some(motion) => Some(motion.commanded),
                None if state.settings.reference => state.commanded,
                None => None,
            }
        };
        told.map_or_else(|| Ok(self.arm.measured()?.joints), Ok)
    }

    /// Returns the goal of the last target; before the first one, the present pose.
    pub(super) fn desired(&self) -> Result<(Pose, Joints<N>), DeviceError> {
        if let Some(desired) = self.lock().desired {
            return Ok(desired);
        }
        let joints = self.arm.measured()?.joints;
        let here = (self.chain.forward(&joints), joints);
        Ok(*self.lock().desired.get_or_insert(here))
    }

    /// Goes to a target; refuses one that is out of reach.
    pub(super) fn go(
        &self,
        target: Pose,
        task: Task,
        time: Option<f64>,
    ) -> Result<(), DeviceError> {
        let settings = self.lock().settings.clone();
        // Without the lock: the arm does not wait for that.
        let start = self.stand()?;
        let chain = settings.chain(&self.chain, &start);
        let max_velocities = self.arm.max_velocities()?;
        match settings.follow(&chain, &target, task, &start, &max_velocities) {
            Ok(way) => {
                let wish = time.filter(|&time| time > 0.0).unwrap_or(settings.time);
                // Slow enough that every joint keeps up, so that the tool stays on the line.
                let time = wish.max(PEAK_TO_MEAN_SPEED * way.time);
                self.go_to_joints(
                    settings,
                    way.joints,
                    (target, task),
                    Some((way.task, way.places)),
                    Some(time),
                )
            }
            Err(refused) => {
                let reach = settings.reach(&chain, &target, task, &start);
                let [x, y, z] = target.translation.vector.into();
                let unsuitable = |expected| DeviceError::Unsuitable {
                    what: "target",
                    asked: format!("({x:.3} {y:.3} {z:.3}) m"),
                    expected,
                };
                if let Some((distance, angle)) = reach.missed_by {
                    return Err(unsuitable(format!(
                        "one within reach: the tool stays {distance:.3} m and {:.1} deg away from it",
                        angle.to_degrees()
                    )));
                }
                if !self.allow_posture_changes && !refused.permits(&start, &reach.joints) {
                    return Err(unsuitable(format!(
                        "one straight ahead in the posture of the arm: {refused}; move the joints to another posture first, or allow changes of posture"
                    )));
                }
                self.go_to_joints(settings, reach.joints, (target, task), None, time)
            }
        }
    }

    /// Returns the joint positions for a target, near the start of the motion to it.
    fn solve(
        &self,
        settings: &Settings<N>,
        target: &Pose,
        task: Task,
    ) -> Result<Reach<N>, DeviceError> {
        // Without the lock: the arm does not wait for that.
        let start = self.stand()?;
        Ok(settings.reach(&settings.chain(&self.chain, &start), target, task, &start))
    }

    /// Goes to the joint positions that were computed for a target.
    fn go_to_joints(
        &self,
        settings: Settings<N>,
        goal: Joints<N>,
        (target, task): (Pose, Task),
        followed: Option<Followed<N>>,
        time: Option<f64>,
    ) -> Result<(), DeviceError> {
        let start = self.stand()?;
        let mut state = self.lock();
        // A step may have been taken in between.
        let start = state
            .motion
            .as_ref()
            .map_or(start, |motion| motion.commanded);
        let chain = settings.chain(&self.chain, &goal);
        let duration = time.filter(|&time| time > 0.0).unwrap_or(settings.time);
        self.arm.engage(&settings.dof)?;
        let desired = (chain.forward(&goal), goal);
        let before = state.motion.take();
        let motion = Motion::to(
            &self.arm,
            settings,
            chain,
            (start, goal),
            (target, task, followed),
            duration,
            before.as_ref(),
        );
        state.motion = Some(motion?);
        state.desired = Some(desired);
        Ok(())
    }

    /// Ends the motion; an arm that lags behind its last command stops too.
    pub(super) fn stop(&self) -> Result<(), DeviceError> {
        let mut state = self.lock();
        match state.end() {
            Some(motion) => self.arm.stop(&motion.settings.dof),
            None => Ok(()),
        }
    }

    /// Moves at a velocity; none ends the motion.
    pub(super) fn move_at(
        &self,
        linear: Vector3<f64>,
        angular: Vector3<f64>,
    ) -> Result<(), DeviceError> {
        if linear.norm() == 0.0 && angular.norm() == 0.0 {
            return self.stop();
        }
        let start = self.stand()?;
        let mut state = self.lock();
        let settings = state.settings.clone();
        let chain = settings.chain(&self.chain, &start);
        self.arm.engage(&settings.dof)?;
        let motion = Motion::at(&self.arm, settings, chain, start, (linear, angular))?;
        state.motion = Some(motion);
        Ok(())
    }

    /// Changes settings; a held target is approached again, as near as the new settings allow.
    pub(super) fn change(&self, change: impl FnOnce(&mut Settings<N>)) -> Result<(), DeviceError> {
        let kept = {
            let mut state = self.lock();
            change(&mut state.settings);
            let motion = state.motion.as_ref().filter(|motion| motion.holds());
            motion.and_then(|motion| motion.target)
        };
        match kept {
            Some((target, task)) => {
                let settings = self.lock().settings.clone();
                let goal = self.solve(&settings, &target, task)?.joints;
                self.go_to_joints(settings, goal, (target, task), None, None)
            }
            None => Ok(()),
        }
    }
}

impl<const N: usize> State<N> {
    fn cycle(&mut self, shared: &Shared<N>, passed: f64) {
        let Some(motion) = &mut self.motion else {
            return;
        };
        let progress = motion.cycle(&shared.arm, passed);
        self.commanded = Some(motion.commanded);
        let keeps = self.settings.tracking;
        match progress {
            Ok(progress) => {
                self.announce(progress);
                if self.motion.as_ref().is_some_and(Motion::holds) && !keeps {
                    self.motion = None;
                }
            }
            Err(reason) => {
                tracing::warn!(error = %reason, "the motion of the tool ends");
                drop(self.end());
            }
        }
    }

    fn announce(&mut self, progress: Progress) {
        let time = clock::now();
        if progress.onset {
            self.tell(CartesianEvent::Onset { time });
        }
        if let Some((before, now)) = progress.covered {
            let covered = |checkpoint: f64| before < checkpoint && checkpoint <= now;
            let reached: Vec<f64> = self
                .checkpoints
                .iter()
                .copied()
                .filter(|&at| covered(at))
                .collect();
            for checkpoint in reached {
                self.tell(CartesianEvent::Ongoing { time, checkpoint });
            }
        }
        if progress.there {
            self.tell(CartesianEvent::Done { time });
        }
    }

    /// Returns whether no motion is in progress.
    pub(super) fn is_done(&self) -> bool {
        self.motion.as_ref().is_none_or(Motion::holds)
    }

    /// Ends the current motion and returns it.
    fn end(&mut self) -> Option<Motion<N>> {
        let ended = self.motion.take().filter(|motion| !motion.holds());
        if ended.is_some() {
            let time = clock::now();
            self.tell(CartesianEvent::Done { time });
        }
        ended
    }

    /// Notifies listeners; full queues miss the event, closed ones are removed.
    fn tell(&mut self, event: CartesianEvent) {
        self.listeners.retain(|listener| {
            !matches!(listener.try_send(event), Err(TrySendError::Disconnected(_)))
        });
    }

    pub(super) fn listen(&mut self) -> Receiver<CartesianEvent> {
        let (sender, receiver) = sync_channel(MAX_QUEUED_EVENTS);
        self.listeners.push(sender);
        receiver
    }

    pub(super) fn store(&mut self) -> Result<i32, DeviceError> {
        if self.contexts.len() >= MAX_CONTEXTS {
            return Err(DeviceError::Unsuitable {
                what: "one more context",
                asked: self.next_context.to_string(),
                expected: format!("at most {MAX_CONTEXTS}; delete some"),
            });
        }
        let id = self.next_context;
        self.next_context += 1;
        self.contexts.insert(id, self.settings.clone());
        Ok(id)
    }

    pub(super) fn stored(&self, id: i32) -> Result<Settings<N>, DeviceError> {
        let found = self.contexts.get(&id).cloned();
        found.ok_or_else(|| DeviceError::Unsuitable {
            what: "context",
            asked: id.to_string(),
            expected: "one that was stored".to_owned(),
        })
    }

    pub(super) fn forget(&mut self, ids: &[i32]) -> Result<(), DeviceError> {
        for &id in ids {
            self.stored(id)?;
        }
        for id in ids.iter().filter(|&&id| id != 0) {
            self.contexts.remove(id);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CartesianControl;
    use crate::wam::{SimulatedWam, WamModel};

    fn controller() -> CartesianController<7> {
        let arm = Arc::new(SimulatedWam::new());
        let chain = WamModel::<7>::new().chain;
        CartesianController::start(arm, chain, CartesianOptions::new()).expect("it starts")
    }

    /// `docs/limits.md`: 1000, of which context 0 is one.
    #[test]
    fn a_client_that_keeps_storing_contexts_is_refused_until_it_deletes_some() {
        let controller = controller();
        let ids: Vec<i32> = (1..1000)
            .map(|_| controller.store_context().expect("there is room"))
            .collect();
        let refused = controller.store_context().unwrap_err().to_string();
        assert!(refused.contains("at most 1000"), "{refused}");
        controller.delete_contexts(&ids[..1]).unwrap();
        controller.store_context().expect("there is room again");
        controller.store_context().unwrap_err();
    }

    /// `docs/limits.md`: 256.
    #[test]
    fn a_listener_that_does_not_read_misses_the_newest_events() {
        let controller = controller();
        let events = controller.shared.lock().listen();
        for time in 0..300 {
            let time = f64::from(time);
            controller
                .shared
                .lock()
                .tell(CartesianEvent::Onset { time });
        }
        let times: Vec<f64> = events
            .try_iter()
            .map(|event| match event {
                CartesianEvent::Onset { time } => time,
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!((times.len(), times.last()), (256, Some(&255.0)));
        // It is still a listener.
        let done = CartesianEvent::Done { time: 300.0 };
        controller.shared.lock().tell(done);
        assert_eq!(events.try_iter().collect::<Vec<_>>(), [done]);
    }
}
