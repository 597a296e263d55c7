//! Sends an arm along a planned line of its tool.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::kinematics::{Chain, Joints};
use crate::periodic_timer::{MissedCycles, PeriodicTimer};
use crate::trajectory::StraightLine;
use crate::{
    Axes, ControlLimits, ControlMode, Device, DeviceError, EncoderReading, Encoders, Mode,
    PositionDirect,
};

/// Interval between positions that are sent to the arm, as of the Cartesian controller.
pub(super) const LINE_PERIOD: Duration = Duration::from_millis(10);
/// An arm gets no further positions while its tool is farther than this from the last one, m: as of the Cartesian
/// controller, which says why.
const MAX_LAG: f64 = 0.015;
/// Maximum number of periods in a row that the line waits for an arm: 2 s.
const MAX_WAITING_PERIODS: u32 = 200;

/// Follows one line at a time, on a thread of its own.
///
/// The joints are in [`Mode::PositionDirect`] on the line, and in [`Mode::Position`] after it. A line ends for good
/// when the arm refuses a position, does not follow, or is taken into another mode.
pub(super) struct LineFollower<const N: usize> {
    shared: Arc<Shared<N>>,
    thread: Option<JoinHandle<()>>,
}

struct Shared<const N: usize> {
    device: Arc<dyn Device>,
    chain: Chain<N>,
    state: Mutex<State<N>>,
    woken: Condvar,
}

struct State<const N: usize> {
    line: Option<StraightLine<N>>,
    /// The last position sent, rad.
    commanded: Joints<N>,
    waiting: u32,
    failure: Option<DeviceError>,
    ending: bool,
}

/// Reasons why the arm is not moved along the line in this period.
enum Step {
    Sent,
    Waits,
    Arrived,
}

impl<const N: usize> LineFollower<N> {
    /// Starts the thread.
    ///
    /// Errors: [`DeviceError::Start`].
    pub(super) fn start(device: Arc<dyn Device>, chain: Chain<N>) -> Result<Self, DeviceError> {
        let shared = Arc::new(Shared {
            device,
            chain,
            state: Mutex::new(State {
                line: None,
                commanded: Joints::zeros(),
                waiting: 0,
                failure: None,
                ending: false,
            }),
            woken: Condvar::new(),
        });
        let theirs = Arc::clone(&shared);
        let thread = thread::Builder::new()
            .name("wam-node-line".into())
            .spawn(move || theirs.run())
            .map_err(|source| DeviceError::Start {
                what: "the thread of straight lines",
                source,
            })?;
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Begins a line planned from `start`, which replaces the one before.
    ///
    /// Errors: [`DeviceError::NotSupported`] without direct positions, or those of the change of mode.
    pub(super) fn begin(&self, line: StraightLine<N>, start: Joints<N>) -> Result<(), DeviceError> {
        let mut state = self.shared.lock();
        self.shared.direct()?;
        state.line = None;
        self.shared.set_mode(Mode::PositionDirect)?;
        state.line = Some(line);
        state.commanded = start;
        state.failure = None;
        state.waiting = 0;
        self.shared.woken.notify_all();
        Ok(())
    }

    /// Ends the line; the arm holds, in position mode.
    ///
    /// Errors: those of the change of mode.
    pub(super) fn end(&self) -> Result<(), DeviceError> {
        match self.shared.lock().line.take() {
            Some(_) => self.shared.set_mode(Mode::Position),
            None => Ok(()),
        }
    }

    /// Returns the last position that was sent on the line under way, rad.
    pub(super) fn commanded(&self) -> Option<Joints<N>> {
        let state = self.shared.lock();
        state.line.as_ref().map(|_| state.commanded)
    }

    /// Returns why the last line was not followed to its end, once.
    pub(super) fn take_failure(&self) -> Option<DeviceError> {
        self.shared.lock().failure.take()
    }

    pub(super) fn is_running(&self) -> bool {
        self.shared.lock().line.is_some()
    }
}

impl<const N: usize> Drop for LineFollower<N> {
    fn drop(&mut self) {
        self.shared.lock().ending = true;
        self.shared.woken.notify_all();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread of straight lines had panicked");
        }
    }
}

impl<const N: usize> Shared<N> {
    fn lock(&self) -> MutexGuard<'_, State<N>> {
        // Each field is whole between any two calls.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self) {
        loop {
            let mut state = self.lock();
            while state.line.is_none() && !state.ending {
                state = self
                    .woken
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner);
            }
            if state.ending {
                return;
            }
            drop(state);
            // After a pause of the machine the line continues from where it was.
            let mut timer = PeriodicTimer::new(Instant::now(), LINE_PERIOD, MissedCycles::Restart);
            while timer.wait(|| {
                let state = self.lock();
                state.ending || state.line.is_none()
            }) {
                self.cycle();
            }
        }
    }

    fn cycle(&self) {
        let mut state = self.lock();
        if state.line.is_none() {
            return;
        }
        let step = self.step(&mut state);
        let ended = match step {
            Ok(Step::Sent) => {
                state.waiting = 0;
                return;
            }
            Ok(Step::Waits) if state.waiting < MAX_WAITING_PERIODS => {
                state.waiting += 1;
                return;
            }
            Ok(Step::Waits) => Err(DeviceError::Unsuitable {
                what: "line of the tool",
                asked: "the next position".to_owned(),
                expected: format!("an arm that follows; its tool stays {MAX_LAG} m behind"),
            }),
            Ok(Step::Arrived) => Ok(()),
            Err(error) => Err(error),
        };
        state.line = None;
        let held = self.set_mode(Mode::Position);
        if let Err(error) = ended.and(held) {
            tracing::warn!(%error, "the arm left the line of its tool");
            state.failure = Some(error);
        }
    }

    fn step(&self, state: &mut State<N>) -> Result<Step, DeviceError> {
        let place = |joints: &Joints<N>| self.chain.forward(joints).translation.vector;
        let lag = (place(&self.measured()?) - place(&state.commanded)).norm();
        if lag > MAX_LAG {
            return Ok(Step::Waits);
        }
        let Some(next) = state.line.as_mut().and_then(StraightLine::next_joints) else {
            return Ok(Step::Arrived);
        };
        let limits = self.limits()?;
        let mut positions = [0.0; N];
        for (joint, position) in positions.iter_mut().enumerate() {
            // Never beyond the limits of the device by a rounding.
            let own = limits.position_limits(joint.into())?;
            *position = own.clamp(next[joint].to_degrees());
        }
        self.direct()?.set_direct_positions(Axes::All, &positions)?;
        state.commanded = next;
        Ok(Step::Sent)
    }

    fn measured(&self) -> Result<Joints<N>, DeviceError> {
        let mut readings = [EncoderReading::default(); N];
        self.encoders()?.read_encoders(Axes::All, &mut readings)?;
        Ok(Joints::from_fn(|joint, _| {
            readings[joint].position.to_radians()
        }))
    }

    fn set_mode(&self, mode: Mode) -> Result<(), DeviceError> {
        self.modes()?.set_control_modes(Axes::All, &[mode; N])
    }

    fn direct(&self) -> Result<&dyn PositionDirect, DeviceError> {
        offered(self.device.position_direct(), "following straight lines")
    }

    fn modes(&self) -> Result<&dyn ControlMode, DeviceError> {
        offered(self.device.control_mode(), "control modes")
    }

    fn encoders(&self) -> Result<&dyn Encoders, DeviceError> {
        offered(self.device.encoders(), "encoders")
    }

    fn limits(&self) -> Result<&dyn ControlLimits, DeviceError> {
        offered(self.device.control_limits(), "control limits")
    }
}

fn offered<T>(interface: Option<T>, what: &str) -> Result<T, DeviceError> {
    interface.ok_or_else(|| DeviceError::NotSupported {
        what: what.to_owned(),
    })
}
