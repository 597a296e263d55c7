//! The driver: the arm as a device, at the host's end of the connection.

mod cartesian_pose;
mod driver_interfaces;
mod driver_session;
mod driver_state;
mod driver_variables;
mod pending_requests;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tracing::info;

pub use self::cartesian_pose::CartesianPose;
use self::driver_session::{End, Session};
use self::driver_state::{Goal, Shared};
pub use self::driver_state::{LinkState, LinkStatus};
use self::pending_requests::PendingRequest;
use super::backoff;
use super::link_error::{LinkError, LinkErrorKind};
use super::link_setup::{LinkAddresses, LinkConnector, LinkMode, join};
use super::protocol::{MAX_JOINTS, Reply, Request};
use crate::DeviceError;
use crate::fake::AxisParameters;
use crate::periodic_timer::CycleStatistics;

/// Options of a driver.
#[derive(Clone, Debug)]
pub struct DriverOptions {
    /// The end that listens, and the addresses. In the thesis the driver listens.
    pub link_mode: LinkMode,
    /// Interval between readings of the joints: 20 ms in the thesis.
    pub period: Duration,
    /// Timeout of an acknowledgement; after it the connection counts as broken.
    pub timeout: Duration,
    /// Maximum age of a reading that is returned to callers.
    pub max_state_age: Duration,
    /// The pause after a connection that failed; it doubles with each that fails in a row.
    pub initial_backoff: Duration,
    /// The longest such pause.
    pub max_backoff: Duration,
    /// True if gravity compensation is switched on (`gra`) as soon as a connection exists; otherwise setting position
    /// mode does it.
    pub gravity: bool,
    /// The joints of the arm, base to tool: the protocol transmits neither names nor limits.
    pub joints: Vec<AxisParameters>,
}

impl DriverOptions {
    /// The thesis's numbers, for a WAM with seven joints.
    pub fn new(link_mode: LinkMode) -> Self {
        Self {
            link_mode,
            period: Duration::from_millis(20),
            timeout: Duration::from_secs(1),
            max_state_age: Duration::from_millis(500),
            initial_backoff: Duration::from_millis(50),
            max_backoff: Duration::from_secs(1),
            gravity: true,
            joints: crate::wam::parameters().to_vec(),
        }
    }
}

/// An arm behind the protocol of its embedded PC, as a device.
///
/// * A thread of its own owns the connections, reads the joints at a fixed rate and connects again by itself, with
///   longer and longer pauses. [`link`](Self::link) returns the state of the connection.
/// * Calls that need the arm wait for its acknowledgement, at most some times the timeout of the options, and fail at
///   once while there is no connection. An error names the step that failed. When the connection breaks the arm holds
///   by itself, and no earlier request is executed later.
/// * It offers axis info, encoders, position control, direct positions, control modes, limits, homing and variables.
///   Calls that the protocol does not support are refused: speeds and accelerations, modes other than those of
///   positions, setting encoders.
/// * Each direct position is a move (`moj`) that replaces the previous one: the arm follows at its own speed and
///   acceleration. A move of the whole arm, home or to a pose, puts all joints back into position mode.
/// * One message moves all joints. A joint that is not named in a command continues to its target, or stays.
/// * [`stop`](crate::MotionControl::stop) sends the arm to its last measured position: it slows down and returns
///   there.
/// * Velocities and accelerations are difference quotients of the angles.
/// * The arm reports the end of a move as a whole, so [`motion_done`](crate::PositionControl::motion_done) of any
///   joint waits for all.
/// * Dropping it sends `shu`, closes the connections and joins the thread.
#[derive(Debug)]
pub struct EmbeddedWam {
    shared: Arc<Shared>,
    addresses: LinkAddresses,
    thread: Option<JoinHandle<()>>,
}

impl EmbeddedWam {
    /// Starts a driver; it need not have a connection yet.
    ///
    /// Errors: [`DeviceError::Start`] if the ports to listen at are taken, or the machine has no thread left;
    /// [`DeviceError::NotSupported`] for an arm with more than seven joints or none.
    pub fn start(options: DriverOptions) -> Result<Self, DeviceError> {
        if !(1..=MAX_JOINTS).contains(&options.joints.len()) {
            return Err(DeviceError::NotSupported {
                what: format!("an arm with {} joints", options.joints.len()),
            });
        }
        let failed = |what| move |source| DeviceError::Start { what, source };
        let (connector, addresses) =
            LinkConnector::start(options.link_mode).map_err(failed("the sockets of the driver"))?;
        let shared = Arc::new(Shared::new(options));
        let theirs = Arc::clone(&shared);
        let thread = thread::Builder::new()
            .name("embedded-wam".into())
            .spawn(move || theirs.run(&connector))
            .map_err(failed("the thread of the driver"))?;
        info!(arm = %addresses.arm, packets = %addresses.packets, "driver of the embedded arm started");
        Ok(Self {
            shared,
            addresses,
            thread: Some(thread),
        })
    }

    /// Returns the addresses at which it listens, or to which it connects.
    pub fn addresses(&self) -> LinkAddresses {
        self.addresses
    }

    /// Returns the state of the connection.
    pub fn link(&self) -> LinkStatus {
        self.shared.lock().link.clone()
    }

    /// Returns the statistics of reading, over all connections.
    pub fn timing(&self) -> CycleStatistics {
        self.shared.lock().timing
    }

    /// Reads the pose of the tool (`gcp`).
    ///
    /// Errors: [`DeviceError::Remote`], [`DeviceError::Refused`].
    pub fn pose(&self) -> Result<CartesianPose, DeviceError> {
        match self.ask(Request::Pose, Goal::Unknown)? {
            Reply::Pose(pose) => Ok(CartesianPose::from_wire(pose)),
            _ => Err(DeviceError::NoDataYet { what: "pose" }),
        }
    }

    /// Starts moving the tool to a pose (`moc`) and returns when the arm has taken the command.
    ///
    /// Errors: [`DeviceError::NotFinite`], [`DeviceError::Remote`], [`DeviceError::Refused`] when the arm cannot reach it.
    pub fn move_to(&self, pose: CartesianPose) -> Result<(), DeviceError> {
        pose.check()?;
        self.shared.lock().direct.fill(false);
        self.ask(Request::MovePose(pose.to_wire()), Goal::Unknown)
            .map(drop)
    }

    /// Starts moving all joints home (`hom`) and returns when the arm has taken the command.
    ///
    /// Errors: [`DeviceError::Remote`], [`DeviceError::Refused`].
    pub fn move_home(&self) -> Result<(), DeviceError> {
        self.shared.lock().direct.fill(false);
        self.ask(Request::Home, Goal::Home).map(drop)
    }

    /// Switches gravity compensation on (`gra`): the arm holds its position and accepts moves.
    ///
    /// Errors: [`DeviceError::Remote`], [`DeviceError::Refused`].
    pub fn switch_gravity_on(&self) -> Result<(), DeviceError> {
        self.ask(Request::Gravity, Goal::Unknown).map(drop)
    }

    /// Passes a request to the thread and waits for its outcome.
    fn ask(&self, request: Request, goal: Goal) -> Result<Reply, DeviceError> {
        let kind = request.kind();
        let (order, answer) = PendingRequest::new(request, goal);
        let abandoned = Arc::clone(&order.abandoned);
        {
            let mut state = self.shared.lock();
            state.check_up(kind.step())?;
            if let Some(older) = state.pending.put(order) {
                older.fail_as_replaced(&state.link.peer);
            }
        }
        self.wake();
        // Everything before it in the pending may take its own time; one that takes too long breaks the connection.
        let timeout = self.shared.options.timeout * 5;
        answer.recv_timeout(timeout).unwrap_or_else(|_| {
            abandoned.store(true, Ordering::Release);
            let state = self.shared.lock();
            Err(state.link.failed(&LinkError {
                step: format!("{}, waiting for its turn", kind.step()),
                cause: LinkErrorKind::Silent(timeout),
            }))
        })
    }

    fn wake(&self) {
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
    }
}

impl Drop for EmbeddedWam {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            join(thread, "the thread of the embedded arm's driver");
        }
    }
}

impl Shared {
    /// The life of the thread: connect, serve, and again.
    fn run(&self, connector: &LinkConnector) {
        let options = &self.options;
        let new_pauses = || backoff::backoff(options.initial_backoff, options.max_backoff);
        let mut pauses = new_pauses();
        while !self.ending.load(Ordering::Acquire) {
            let error = match connector.connect(&self.ending) {
                Ok(None) => break,
                Ok(Some(pair)) => {
                    let (opened, end) = Session::run(self, connector, pair);
                    if opened {
                        pauses = new_pauses();
                    }
                    match end {
                        End::Asked => break,
                        End::Lost(error) => error,
                    }
                }
                Err(error) => LinkError {
                    step: "connecting".to_owned(),
                    cause: LinkErrorKind::io(&error, options.timeout),
                },
            };
            self.lose(&error);
            backoff::wait(&mut pauses, &self.ending);
        }
        self.lock().close(&LinkError {
            step: "going on".to_owned(),
            cause: LinkErrorKind::Closed,
        });
    }

    fn lose(&self, error: &LinkError) {
        let mut state = self.lock();
        state.lose(error);
        state.link.failures += 1;
    }
}
