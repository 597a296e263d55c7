//! The hand as a control board of four axes: `finger_1`, `finger_2`, `finger_3`, `spread`.
//!
//! A dedicated thread keeps the hand in RealTime mode: each round it sends the motors their speeds and gets their
//! positions, some sixty times a second at 9600 bits per second. Paths come from the same [`AxesModel`] as those of
//! the simulated arm. A grasp, or any other command of the hand's own language, interrupts that until it has ended.

mod hand_board_interfaces;
mod position_servo;

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tracing::{info, warn};

use self::position_servo::PositionServo;
use super::gcl::{Feedback, FirmwareVersion, Layout, MotorLayout, MotorSet, Reply, Status};
use super::gcl_connection::GclConnection;
use super::hand_error::HandError;
use super::serial_driver::BarrettHand;
use crate::clock;
use crate::fake::{AxesModel, AxisParameters};
use crate::guard::{Guarded, GuardedOptions, RateLimits};
use crate::{Axes, DeviceError, JointType, Limits};

/// Number of axes.
const AXES: usize = 4;
/// Interval between checks for a hand that is absent or not initialised.
const RETRY_INTERVAL: Duration = Duration::from_millis(100);
/// Interval between checks for the end of an abort.
const ABORT_POLL_INTERVAL: Duration = Duration::from_millis(1);
/// Timeout of a command in the hand's own language, including the commands before it.
const COMMAND_TIMEOUT: Duration = Duration::from_secs(120);

/// A hand as a control board, and as a hand.
///
/// * Axes count from 0: fingers 1 to 3 (degrees of the inner link), then the spread (degrees of one finger). Modes:
///   idle, position, velocity. A finger that is blocked for 0.3 s stays there, and that becomes its target.
/// * Until the hand is initialised its axes are in `NotConfigured` mode, and moves are refused; a line that broke puts
///   them into `HardwareFault`. When the line is back the axes are idle: **no move is resumed**.
/// * [`Hand`](crate::Hand) and [`Grasp`](crate::Grasp) stop moves in progress.
/// * The hand itself has no watchdog in RealTime mode: if this process is frozen, fingers continue at their speed
///   until they are blocked.
///
/// ```no_run
/// use yarp_devices::hand::{BarrettHand, HandBoard, HandOptions};
/// use yarp_devices::{Hand, PositionControl};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let board = HandBoard::start(BarrettHand::open(HandOptions::new("/dev/ttyUSB0"))?)?;
/// board.initialise()?;
/// board.position_move(yarp_devices::Axes::One(0.into()), &[45.0])?;
/// # Ok(())
/// # }
/// ```
pub struct HandBoard {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    hand: BarrettHand,
    state: Mutex<State>,
    /// There is a job, or the end has come.
    news: Condvar,
    ending: AtomicBool,
}

struct State {
    set_points: AxesModel,
    readiness: Readiness,
    /// Measured positions and speeds, degrees and per second.
    measured: [Measured; AXES],
    /// Seconds since the start of 1970; `None` before the first.
    time: Option<f64>,
    /// The next commands to execute.
    job: Option<QueuedCommands>,
    /// True while the hand executes commands.
    running: bool,
    /// True while a caller waits for the end of commands.
    at_work: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    position: f64,
    speed: f64,
    /// True if it follows its set point closely.
    there: bool,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Readiness {
    Ready,
    NotInitialised,
    Lost,
}

/// Lines of the hand's language, and where their answers go.
struct QueuedCommands {
    lines: Vec<String>,
    answers: SyncSender<Result<Vec<Reply>, HandError>>,
}

/// The answer to a job, which goes out when it is dropped.
struct ReplyOnDrop<'s> {
    shared: &'s Shared,
    to: SyncSender<Result<Vec<Reply>, HandError>>,
    outcome: Option<Result<Vec<Reply>, HandError>>,
}

impl Drop for ReplyOnDrop<'_> {
    fn drop(&mut self) {
        self.shared.state().at_work = false;
        if let Some(outcome) = self.outcome.take() {
            // The caller may have stopped waiting.
            let _ = self.to.try_send(outcome);
        }
    }
}

impl HandBoard {
    /// Takes over a hand.
    ///
    /// Errors: [`DeviceError::Start`] when the machine has no thread left.
    pub fn start(hand: BarrettHand) -> Result<Self, DeviceError> {
        let shared = Arc::new(Shared {
            hand,
            state: Mutex::new(State {
                set_points: AxesModel::new(parameters()),
                readiness: Readiness::NotInitialised,
                measured: Default::default(),
                time: None,
                job: None,
                running: false,
                at_work: false,
            }),
            news: Condvar::new(),
            ending: AtomicBool::new(false),
        });
        let theirs = Arc::clone(&shared);
        let thread = thread::Builder::new()
            .name("hand-board".into())
            .spawn(move || theirs.run())
            .map_err(|source| DeviceError::Start {
                what: "the control thread of the hand",
                source,
            })?;
        info!(path = shared.hand.path(), "hand served as four axes");
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Puts the guards of programs in front of the hand: its limits, the end of velocities without a new command, and the
    /// software stop, which ends grasps too.
    ///
    /// Rates have no guard: the axes themselves keep to their largest speeds.
    ///
    /// Errors: those of [`Guarded::around`].
    pub fn guarded(self) -> Result<Guarded, DeviceError> {
        let options = GuardedOptions {
            rate_limits: RateLimits::default(),
            ..GuardedOptions::of_device(&self)?
        };
        Guarded::around(Arc::new(self), options)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.shared.state()
    }
}

impl Drop for HandBoard {
    /// Stops the motors.
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        self.shared.news.notify_all();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the control thread of the hand had panicked");
        }
    }
}

impl fmt::Debug for HandBoard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HandBoard")
            .field("hand", &self.shared.hand)
            .finish_non_exhaustive()
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_ending(&self) -> bool {
        self.ending.load(Ordering::Acquire)
    }

    fn run(&self) {
        while !self.is_ending() {
            let answer = self.work();
            match self.realtime(answer) {
                Ok(()) => {}
                Err(error) => {
                    self.tell(&error);
                    let state = self.state();
                    if state.job.is_none() && !self.is_ending() {
                        drop(self.news.wait_timeout(state, RETRY_INTERVAL));
                    }
                }
            }
        }
    }

    /// Executes commands in the hand's own language.
    fn work(&self) -> Option<ReplyOnDrop<'_>> {
        let job = {
            let mut state = self.state();
            let job = state.job.take()?;
            state.running = true;
            job
        };
        let outcome = self.hand.run(&job.lines);
        {
            let mut state = self.state();
            state.running = false;
            // A late abort must not affect other callers.
            self.hand.set_abort(false);
        }
        if let Err(error) = &outcome
            && error.is_loss()
        {
            self.tell(error);
        }
        Some(ReplyOnDrop {
            shared: self,
            to: job.answers,
            outcome: Some(outcome),
        })
    }

    /// Stays in RealTime mode until there is something else to do. The reply is sent once the axes accept commands
    /// again, or cannot.
    fn realtime(&self, answer: Option<ReplyOnDrop<'_>>) -> Result<(), HandError> {
        let version = self.hand.firmware_version()?;
        let mut session = self.hand.realtime(layout(version))?;
        let feedback = session.ask()?;
        let mut follower = PositionServo::new(&feedback, Instant::now());
        self.begin(&mut follower, &feedback);
        drop(answer);
        loop {
            let speeds = {
                let mut state = self.state();
                if self.is_ending() || state.job.is_some() {
                    break;
                }
                follower.speeds(&mut state.set_points, Instant::now())
            };
            let feedback = session.control(&speeds)?;
            let mut state = self.state();
            let set_points = &mut state.set_points;
            let measured = follower.measure(&feedback, set_points, Instant::now());
            state.measured = measured;
            state.time = Some(clock::now());
        }
        session.end()
    }

    /// The motors answer: set points begin where they are.
    fn begin(&self, follower: &mut PositionServo, feedback: &Feedback) {
        let mut guard = self.state();
        let state = &mut *guard;
        let before = std::mem::replace(&mut state.readiness, Readiness::Ready);
        follower.place(&mut state.set_points);
        state.measured = follower.measure(feedback, &mut state.set_points, Instant::now());
        state.time = Some(clock::now());
        if before == Readiness::Lost {
            let idle = [crate::Mode::Idle; AXES];
            let set = state.set_points.set_control_modes(Axes::All, &idle);
            debug_assert!(set.is_ok(), "all axes can be idle");
            info!(
                path = self.hand.path(),
                "the hand is back, its axes are idle"
            );
        }
    }

    fn tell(&self, error: &HandError) {
        let uninitialised = error.status() == Some(Status::NOT_INITIALISED);
        let mut state = self.state();
        let readiness = match (uninitialised, state.readiness) {
            (true, Readiness::Lost) => Readiness::Lost,
            (true, _) => Readiness::NotInitialised,
            (false, _) => Readiness::Lost,
        };
        if state.readiness != readiness {
            warn!(path = self.hand.path(), %error, "the hand accepts no commands");
        }
        state.readiness = readiness;
    }
}

impl GclConnection for HandBoard {
    fn peer(&self) -> &str {
        self.shared.hand.path()
    }

    fn run(&self, lines: &[String]) -> Result<Vec<Reply>, HandError> {
        let (answers, answer) = sync_channel(1);
        {
            let mut state = self.state();
            if state.at_work {
                let doing = "another command".to_owned();
                return Err(HandError::Busy { doing });
            }
            state.at_work = true;
            let lines = lines.to_vec();
            state.job = Some(QueuedCommands { lines, answers });
        }
        self.shared.news.notify_all();
        let deadline = COMMAND_TIMEOUT * (lines.len().max(1) as u32);
        match answer.recv_timeout(deadline) {
            Ok(outcome) => outcome,
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                Err(HandError::NoPrompt {
                    command: lines.join(", "),
                    waited: deadline,
                    got: String::new(),
                })
            }
        }
    }

    fn abort(&self) -> Result<(), HandError> {
        {
            let mut state = self.state();
            // Where they are now: a jump, which ends the motion, and not a path to rest.
            let here = state.measured.map(|measured| measured.position);
            for (axis, position) in here.into_iter().enumerate() {
                let placed = state.set_points.place(axis.into(), position);
                debug_assert!(placed.is_ok(), "there are four axes");
            }
            if let Some(job) = state.job.take() {
                state.at_work = false;
                let command = job.lines.join(", ");
                // The caller may have stopped waiting.
                let _ = job.answers.try_send(Err(HandError::Aborted { command }));
            }
            if !state.running {
                return Ok(());
            }
            // With the state held, so that it is for this job and no other.
            self.shared.hand.set_abort(true);
        }
        let deadline = Instant::now() + COMMAND_TIMEOUT;
        while self.shared.hand.is_abort_set() {
            if Instant::now() > deadline {
                let doing = "a command that does not end".to_owned();
                return Err(HandError::Busy { doing });
            }
            thread::sleep(ABORT_POLL_INTERVAL);
        }
        Ok(())
    }

    fn is_connected(&self) -> bool {
        GclConnection::is_connected(&self.shared.hand)
    }
}

/// Speeds out, in whole units with every firmware, and positions in.
fn layout(version: FirmwareVersion) -> Layout {
    let motor = MotorLayout {
        speed: Some(version.speed_fraction()),
        position: true,
        ..MotorLayout::default()
    };
    Layout::same(MotorSet::ALL, motor)
}

/// Returns the parameters of the axes: ranges of the data sheet, speeds up to the maximum of a block.
fn parameters() -> [AxisParameters; AXES] {
    let names = ["finger_1", "finger_2", "finger_3", "spread"];
    std::array::from_fn(|axis| {
        let spread = axis == 3;
        AxisParameters {
            name: names[axis].to_owned(),
            joint_type: JointType::Revolute,
            limits: Limits::new(0.0, if spread { 180.0 } else { 140.0 }),
            max_speed: if spread { 360.0 } else { 100.0 },
            max_acceleration: if spread { 3600.0 } else { 1000.0 },
            reference_speed: if spread { 120.0 } else { 60.0 },
            reference_acceleration: if spread { 600.0 } else { 300.0 },
            home: 0.0,
        }
    })
}
