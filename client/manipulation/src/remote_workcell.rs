//! Arm and hand on the network.

use std::panic::resume_unwind;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nalgebra::{Point3, SVector};
use yarp_client::devices::{Encoders, PositionDirect};
use yarp_client::{Axes, ControlMode, Hand, Mode, RemoteClock, Robot};
use yarp_devices::kinematics::Joints;
use yarp_devices::{DeviceError, Hand as _};

use crate::workcell::{Workcell, WorkcellError};

/// Maximum wait until the states of the arm show that it takes set points.
const PREPARED_TIMEOUT: Duration = Duration::from_secs(2);
/// Interval between two looks at a state.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Time without a new state of the arm after which a motion waits for one, on the robot's clock: set points that run ahead of an
/// arm that cannot be seen would let it jump.
const MAX_STATE_AGE: Duration = Duration::from_millis(60);
/// Advice for an arm that is not to be moved by a program.
const REMEDY: &str = "when it is safe, end the emergency stop or activate the arm at its safety module, then start again";

/// Counts of a finger and of the spread per degree.
const COUNTS: [f64; 4] = [125.0, 125.0, 125.0, 17.5];

/// Modes of joints that take set points, or have stopped by themselves: a stalled joint holds in position mode.
const STOPPED_ITSELF: [Mode; 2] = [Mode::PositionDirect, Mode::Position];

type ContainerView = Box<dyn FnMut() -> Vec<Point3<f64>> + Send>;

/// An arm and a hand that are found by their names.
pub struct RemoteWorkcell {
    arm: Robot,
    hand: Arc<Hand>,
    /// The commands that the hand carries out while the arm moves.
    started: Option<JoinHandle<Result<(), DeviceError>>>,
    names: [String; 2],
    /// Seconds of the robot in a second of this machine.
    speed: f64,
    /// The robot's own clock: a simulation may be slower than it was asked to be.
    clock: Option<RemoteClock>,
    due: Instant,
    /// Time of the newest state of the arm, as it tells, and when it was first seen.
    state: (f64, Instant),
    container_view: Option<ContainerView>,
}

impl std::fmt::Debug for RemoteWorkcell {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RemoteWorkcell")
            .field("names", &self.names)
            .field("speed", &self.speed)
            .finish_non_exhaustive()
    }
}

impl RemoteWorkcell {
    /// Returns the workcell of an arm and a hand.
    ///
    /// `speed`: seconds of the robot in a second here; 1 for a real one, more for a simulation that runs faster.
    pub fn new(arm: Robot, hand: Hand, names: [&str; 2], speed: f64) -> Self {
        Self {
            arm,
            hand: Arc::new(hand),
            started: None,
            names: names.map(str::to_owned),
            speed,
            clock: None,
            due: Instant::now(),
            state: (0.0, Instant::now()),
            container_view: None,
        }
    }

    /// Returns the same workcell with depth sensors above the containers: `look` returns what they see, see
    /// [`Workcell::look_into_containers`].
    pub fn with_container_view(
        mut self,
        look: impl FnMut() -> Vec<Point3<f64>> + Send + 'static,
    ) -> Self {
        self.container_view = Some(Box::new(look));
        self
    }

    /// Returns the same workcell with a clock that shows the time of the robot, whose `speed` does not matter then.
    pub fn with_clock(mut self, clock: RemoteClock) -> Self {
        self.due = clock.instant();
        self.state.1 = self.due;
        self.clock = Some(clock);
        self
    }

    /// Checks that all joints take set points, by the newest state: nobody answers a set point.
    fn check_mode(&self) -> Result<(), DeviceError> {
        let modes = self.arm.control_modes(Axes::All)?;
        let needed = Mode::PositionDirect;
        match modes.iter().position(|mode| *mode != needed) {
            Some(joint) => Err(DeviceError::WrongMode {
                joint: joint.into(),
                command: "direct position",
                mode: modes[joint],
                needed,
            }),
            None => Ok(()),
        }
    }

    fn now(&self) -> Instant {
        self.clock
            .as_ref()
            .map_or_else(Instant::now, RemoteClock::instant)
    }

    /// Waits for a state of the arm that is not too old.
    ///
    /// Errors: the arm's programs have stopped publishing.
    fn wait_for_state(&mut self) -> Result<(), WorkcellError> {
        loop {
            let readings = self.arm("read the joints", self.arm.encoder_readings(Axes::All))?;
            let newest = readings.iter().map(|reading| reading.time);
            let newest = newest.fold(f64::MIN, f64::max);
            let now = self.now();
            if newest != self.state.0 {
                self.state = (newest, now);
            }
            if now.saturating_duration_since(self.state.1) <= MAX_STATE_AGE {
                return Ok(());
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    fn arm<R>(
        &self,
        action: &'static str,
        outcome: Result<R, DeviceError>,
    ) -> Result<R, WorkcellError> {
        outcome.map_err(|source| WorkcellError {
            device: self.names[0].clone(),
            action,
            source: Box::new(source),
        })
    }

    fn hand<R>(
        &self,
        action: &'static str,
        outcome: Result<R, DeviceError>,
    ) -> Result<R, WorkcellError> {
        outcome.map_err(|source| WorkcellError {
            device: self.names[1].clone(),
            action,
            source: Box::new(source),
        })
    }
}

/// Sends the hand a command, and waits for its end.
fn send(hand: &Hand, line: &str) -> Result<String, DeviceError> {
    match hand.send_command(line) {
        // Something blocked the motion.
        Err(error) if yarp_client::ports::error_chain(&error).contains("position not reached") => {
            Ok(String::new())
        }
        other => other,
    }
}

impl Workcell for RemoteWorkcell {
    fn prepare(&mut self) -> Result<(), WorkcellError> {
        let modes = [Mode::PositionDirect; 7];
        self.arm(
            "set the mode",
            self.arm.set_control_modes(Axes::All, &modes),
        )?;
        // A state that is older than the reply shows the mode before.
        let deadline = Instant::now() + PREPARED_TIMEOUT;
        loop {
            let taking = self.check_mode();
            if taking.is_ok() || Instant::now() >= deadline {
                return self.arm("set the mode", taking);
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    fn resume(&mut self) -> Result<(), WorkcellError> {
        let modes = self.arm("read the modes", self.arm.control_modes(Axes::All))?;
        let off = modes.iter().position(|mode| !STOPPED_ITSELF.contains(mode));
        match off {
            Some(joint) => {
                let by = match modes[joint] {
                    Mode::HardwareFault => "a hardware fault",
                    _ => "an emergency stop or another program",
                };
                let held = DeviceError::Held {
                    joint: joint.into(),
                    by,
                    remedy: REMEDY,
                };
                self.arm("command a posture", Err(held))
            }
            None => self.prepare(),
        }
    }

    fn joints(&mut self) -> Result<Joints<7>, WorkcellError> {
        let degrees = self.arm("read the joints", self.arm.positions())?;
        match <[f64; 7]>::try_from(degrees) {
            Ok(degrees) => Ok(Joints::<7>::from(degrees.map(f64::to_radians))),
            Err(other) => self.arm(
                "read the joints",
                Err(DeviceError::Unsuitable {
                    what: "the number of joints of the arm",
                    asked: other.len().to_string(),
                    expected: "7".to_owned(),
                }),
            ),
        }
    }

    fn command(&mut self, joints: &Joints<7>) -> Result<(), WorkcellError> {
        self.arm("command a posture", self.check_mode())?;
        let degrees: SVector<f64, 7> = joints.map(f64::to_degrees);
        let sent = self.arm.set_direct_positions(Axes::All, degrees.as_slice());
        self.arm("command a posture", sent)
    }

    fn wait(&mut self, seconds: f64) -> Result<f64, WorkcellError> {
        // Seconds of the robot in one of the clock.
        let pace = self.clock.as_ref().map_or(self.speed, |_| 1.0);
        let interval = Duration::from_secs_f64((seconds / pace).max(0.0));
        let now = self.now();
        // Late waits do not pile up.
        self.due = (self.due + interval).max(now);
        match &self.clock {
            Some(clock) => self.arm("wait", clock.sleep_until(self.due))?,
            None => std::thread::sleep(self.due - now),
        }
        self.wait_for_state()?;
        let passed = self.now().saturating_duration_since(now).as_secs_f64();
        Ok(passed * pace)
    }

    fn command_hand(&mut self, line: &str) -> Result<String, WorkcellError> {
        self.finish_hand()?;
        let sent = send(&self.hand, line);
        self.due = self.now();
        self.hand("command the hand", sent)
    }

    fn start_hand(&mut self, lines: &[String]) -> Result<(), WorkcellError> {
        self.finish_hand()?;
        let (hand, lines) = (Arc::clone(&self.hand), lines.to_vec());
        let carry_out = move || {
            lines
                .iter()
                .try_for_each(|line| send(&hand, line).map(drop))
        };
        let thread = std::thread::Builder::new().name("hand-commands".into());
        let started = thread
            .spawn(carry_out)
            .map_err(|source| DeviceError::Start {
                what: "the thread of the hand's commands",
                source,
            });
        self.started = Some(self.hand("command the hand", started)?);
        Ok(())
    }

    fn finish_hand(&mut self) -> Result<(), WorkcellError> {
        let Some(started) = self.started.take() else {
            return Ok(());
        };
        // The client of the hand bounds each call.
        let ended = started.join().unwrap_or_else(|panic| resume_unwind(panic));
        self.due = self.now();
        self.hand("command the hand", ended)
    }

    fn fingers(&mut self) -> Result<[f64; 4], WorkcellError> {
        let degrees = self.hand("read the fingers", self.hand.finger_positions())?;
        Ok(std::array::from_fn(|motor| degrees[motor] * COUNTS[motor]))
    }

    fn look_into_containers(&mut self) -> Result<Vec<Point3<f64>>, WorkcellError> {
        let points = self.container_view.as_mut().map(|look| look());
        self.due = self.now();
        Ok(points.unwrap_or_default())
    }

    fn hold(&mut self) -> Result<(), WorkcellError> {
        let joints = self.joints()?;
        self.command(&joints)
    }
}
