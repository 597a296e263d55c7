//! Executes requests on the arm: radians and poses outside, a [`Device`] in degrees inside.

use std::sync::Arc;
use std::time::Instant;

use nalgebra::{IsometryMatrix3, Translation3};

use super::line_follower::{LINE_PERIOD, LineFollower};
use super::node_motion_completion::{Ended, Motion};
use crate::embedded::protocol::{POSE, Reply, Request};
use crate::kinematics::{EulerXyz, Joints, Pose, Solver, SolverOptions, Task};
use crate::trajectory::{StraightLine, StraightLineOptions};
use crate::wam::WamModel;
use crate::{
    Axes, ControlLimits, ControlMode, Device, DeviceError, EncoderReading, Encoders, Mode,
    PositionControl,
};

/// Tolerance of limits for targets, because of rounding between radians and degrees.
const LIMIT_TOLERANCE: f64 = 1e-9;

/// Reasons why a request is answered `q`.
#[derive(Debug, thiserror::Error)]
pub(super) enum Refusal {
    #[error(transparent)]
    Device(#[from] DeviceError),
    #[error("joint {joint} is in {mode} mode, moves need gravity compensation: send `gra` first")]
    NotHeld { joint: usize, mode: Mode },
    #[error("joint {joint} is in a fault; press idle and activate on the pendant")]
    Fault { joint: usize },
    #[error("the pose has a number that is not finite")]
    NotFinite,
    #[error(
        "no joint angles bring the tool there: the nearest is {millimetres:.1} mm and {degrees:.2} degrees off"
    )]
    OutOfReach { millimetres: f64, degrees: f64 },
    #[error("no joint angles bring the tool there: the nearest is {millimetres:.1} mm off")]
    PlaceOutOfReach { millimetres: f64 },
    #[error(transparent)]
    Line(Box<dyn std::error::Error + Send + Sync>),
    #[error("too many queries for the end of one move")]
    TooManyQueries,
}

/// The arm, and the move it makes.
pub(super) struct Arm<const N: usize> {
    device: Arc<dyn Device>,
    model: WamModel<N>,
    /// From where the arm is, to the nearest posture.
    near: Solver<N>,
    /// To any posture, where that is allowed.
    far: Solver<N>,
    moves: CartesianMoves,
    line: LineFollower<N>,
    /// The part of a pose that the tool is moved to.
    task: Task,
    /// Posture that lines keep, rad: that in which the first of them began, since something else moved the arm.
    posture: Option<Joints<N>>,
    motion: Motion,
}

/// Moves of the tool that a server makes (`moc`).
#[derive(Clone, Copy, Debug, Default)]
pub struct CartesianMoves {
    /// Speeds of the tool on its line, and the change of the joints that it may need.
    pub line: StraightLineOptions,
    /// Moves the joints to the posture nearest to the present one where the tool cannot follow a straight line to the
    /// pose. The tool then leaves the line, and joints may turn far.
    pub allow_posture_changes: bool,
}

/// An arm that a session serves, with any number of joints.
pub(super) trait ServedArm: Send {
    /// Returns the number of joints.
    fn joints(&self) -> usize;

    /// Idle: without gravity compensation, as an arm is before the first `gra`. A fault stays one.
    fn rest(&self) -> Result<(), DeviceError>;

    /// Stops the current move. The joints hold; idle ones stay idle.
    fn hold(&mut self);

    /// Executes a request; returns the reply, or the reason for `q`.
    fn obey(&mut self, request: &Request) -> Result<Reply, Refusal>;

    /// Looks whether the move has ended. A move that was replaced ends at once.
    fn look(&mut self) -> Option<Ended>;
}

/// Returns the arm of a device with the joints of a WAM.
///
/// Errors: [`DeviceError::NotSupported`] for a device with other joints, or without encoders, position control and modes.
pub(super) fn served_arm(
    device: Arc<dyn Device>,
    moves: CartesianMoves,
) -> Result<Box<dyn ServedArm>, DeviceError> {
    match device.axis_info().map_or(0, |info| info.axes()) {
        4 => Ok(Box::new(Arm::new(
            device,
            WamModel::<4>::new(),
            Task::Position,
            moves,
        )?)),
        7 => Ok(Box::new(Arm::new(
            device,
            WamModel::<7>::new(),
            Task::Pose,
            moves,
        )?)),
        axes => Err(lacks(&format!("four or seven joints (this has {axes})"))),
    }
}

fn lacks(what: &str) -> DeviceError {
    DeviceError::NotSupported {
        what: format!("serving an arm without {what}"),
    }
}

impl<const N: usize> Arm<N> {
    fn new(
        device: Arc<dyn Device>,
        model: WamModel<N>,
        task: Task,
        moves: CartesianMoves,
    ) -> Result<Self, DeviceError> {
        device.encoders().ok_or_else(|| lacks("encoders"))?;
        device
            .control_mode()
            .ok_or_else(|| lacks("control modes"))?;
        device
            .control_limits()
            .ok_or_else(|| lacks("control limits"))?;
        device
            .position_control()
            .ok_or_else(|| lacks("position control"))?;
        let far = SolverOptions {
            task,
            ..SolverOptions::default()
        };
        let near = SolverOptions { attempts: 1, ..far };
        Ok(Self {
            near: Solver::with_options(model.chain.clone(), near),
            far: Solver::with_options(model.chain.clone(), far),
            line: LineFollower::start(Arc::clone(&device), model.chain.clone())?,
            moves,
            task,
            model,
            device,
            posture: None,
            motion: Motion::default(),
        })
    }

    // Checked in `new`.
    fn position(&self) -> &dyn PositionControl {
        self.device.position_control().expect("looked for in new")
    }

    fn modes(&self) -> &dyn ControlMode {
        self.device.control_mode().expect("looked for in new")
    }

    fn limits(&self) -> &dyn ControlLimits {
        self.device.control_limits().expect("looked for in new")
    }

    fn encoders(&self) -> &dyn Encoders {
        self.device.encoders().expect("looked for in new")
    }

    /// Checks that the joints are held, or follow a line of this server.
    fn check_held(&self) -> Result<(), Refusal> {
        let on_line = self.line.is_running();
        for (joint, mode) in self.control_modes()?.into_iter().enumerate() {
            match mode {
                Mode::Position => {}
                Mode::PositionDirect if on_line => {}
                Mode::HardwareFault => return Err(Refusal::Fault { joint }),
                mode => return Err(Refusal::NotHeld { joint, mode }),
            }
        }
        Ok(())
    }

    fn go(&mut self, mut targets: Vec<f64>) -> Result<Reply, Refusal> {
        self.check_held()?;
        for (joint, target) in targets.iter_mut().enumerate() {
            let limits = self.limits().position_limits(joint.into())?;
            let inside = limits.clamp(*target);
            if (inside - *target).abs() < LIMIT_TOLERANCE {
                *target = inside;
            }
            limits.check(joint.into(), "position", *target, "deg")?;
        }
        // The newer move wins.
        self.line.end()?;
        self.posture = None;
        self.position().position_move(Axes::All, &targets)?;
        self.motion.begin();
        Ok(Reply::Done)
    }

    /// Moves the tool on a straight line, in the posture that the arm has; to the place of the pose alone with four joints.
    fn move_tool(&mut self, pose: &[f64; POSE]) -> Result<Reply, Refusal> {
        let [x, y, z, roll, pitch, yaw] = *pose;
        if pose.iter().any(|number| !number.is_finite()) {
            return Err(Refusal::NotFinite);
        }
        self.check_held()?;
        let start = match self.line.commanded() {
            Some(commanded) => commanded,
            None => self.angles()?,
        };
        let rotation = match self.task {
            // It turns as the way to the place has it.
            Task::Position => self.model.chain.forward(&start).rotation,
            _ => EulerXyz::new(roll, pitch, yaw).rotation(),
        };
        let target = IsometryMatrix3::from_parts(Translation3::new(x, y, z), rotation);
        let options = &self.moves.line;
        let posture = self.posture.unwrap_or(start);
        match StraightLine::plan_near(&self.near, &start, &target, &posture, options, LINE_PERIOD) {
            Ok(line) => {
                // A running joint move would go on as soon as the line ends.
                self.position().stop(Axes::All)?;
                self.line.begin(line, start)?;
                self.posture = Some(posture);
                self.motion.begin();
                Ok(Reply::Done)
            }
            Err(_) if self.moves.allow_posture_changes => {
                let angles = self.nearest_posture(&target, &start)?;
                self.go(angles.iter().map(|angle| angle.to_degrees()).collect())
            }
            Err(refused) => Err(Refusal::Line(Box::new(refused))),
        }
    }

    fn nearest_posture(&self, target: &Pose, start: &Joints<N>) -> Result<Joints<N>, Refusal> {
        let found = self.far.solve_nearest(target, start);
        let found = found.map_err(|unsolved| {
            let millimetres = unsolved.nearest.position_error * 1e3;
            match self.task {
                Task::Position => Refusal::PlaceOutOfReach { millimetres },
                _ => Refusal::OutOfReach {
                    millimetres,
                    degrees: unsolved.nearest.angle_error.to_degrees(),
                },
            }
        })?;
        Ok(found.joints)
    }

    fn pose(&self) -> Result<[f64; POSE], DeviceError> {
        let tool = self.model.chain.forward(&self.angles()?);
        let place = tool.translation.vector;
        let turn = EulerXyz::from_rotation(&tool.rotation);
        Ok([place.x, place.y, place.z, turn.roll, turn.pitch, turn.yaw])
    }

    fn angles(&self) -> Result<Joints<N>, DeviceError> {
        let angles = self
            .readings()?
            .map(|reading| reading.position.to_radians());
        Ok(Joints::from(angles))
    }

    fn readings(&self) -> Result<[EncoderReading; N], DeviceError> {
        let mut readings = [EncoderReading::default(); N];
        self.encoders().read_encoders(Axes::All, &mut readings)?;
        Ok(readings)
    }

    fn control_modes(&self) -> Result<[Mode; N], DeviceError> {
        let mut modes = [Mode::UNKNOWN; N];
        self.modes().read_control_modes(Axes::All, &mut modes)?;
        Ok(modes)
    }

    /// The first joint in a fault, if one is.
    fn fault(&self) -> Result<Option<usize>, DeviceError> {
        let modes = self.control_modes()?;
        Ok(modes.iter().position(|mode| *mode == Mode::HardwareFault))
    }
}

impl<const N: usize> ServedArm for Arm<N> {
    fn joints(&self) -> usize {
        N
    }

    fn rest(&self) -> Result<(), DeviceError> {
        if self.fault()?.is_some() {
            return Ok(());
        }
        self.modes().set_control_modes(Axes::All, &[Mode::Idle; N])
    }

    fn hold(&mut self) {
        self.motion.drop_pending_queries();
        if !self.motion.is_running() {
            return;
        }
        let ended = self.line.end();
        if let Err(error) = ended.and_then(|()| self.position().stop(Axes::All)) {
            tracing::error!(%error, "the arm could not be stopped");
        }
        self.motion.begin();
    }

    fn obey(&mut self, request: &Request) -> Result<Reply, Refusal> {
        match request {
            Request::Joints => Ok(Reply::Joints(
                self.readings()?
                    .map(|reading| reading.position.to_radians())
                    .to_vec(),
            )),
            Request::Pose => Ok(Reply::Pose(self.pose()?)),
            Request::MoveJoints(angles) => {
                let targets = angles.iter().map(|angle| angle.to_degrees()).collect();
                self.go(targets)
            }
            Request::MovePose(pose) => self.move_tool(pose),
            Request::Home => {
                let home = self.model.home;
                self.go(home.iter().map(|angle| angle.to_degrees()).collect())
            }
            Request::Gravity => {
                self.posture = None;
                self.modes()
                    .set_control_modes(Axes::All, &[Mode::Position; N])?;
                Ok(Reply::Done)
            }
            Request::TellFinish => {
                if self.motion.ask() {
                    Ok(Reply::Done)
                } else {
                    Err(Refusal::TooManyQueries)
                }
            }
            Request::Shutdown => Ok(Reply::Done),
        }
    }

    fn look(&mut self) -> Option<Ended> {
        if !self.motion.is_running() {
            return self.motion.look(Instant::now(), true);
        }
        let state = || {
            let fault = self.fault()?;
            let fastest = self
                .readings()?
                .iter()
                .fold(0.0_f64, |fastest, reading| fastest.max(reading.speed.abs()));
            let arrived = !self.line.is_running() && self.position().motion_done(Axes::All)?;
            Ok::<_, DeviceError>((fault, arrived, fastest))
        };
        match state() {
            Ok((Some(joint), ..)) => Some(self.motion.fail(&format!("fault at joint {joint}"))),
            Ok((None, arrived, fastest)) => {
                if let Some(failure) = self.line.take_failure() {
                    return Some(self.motion.fail(&failure.to_string()));
                }
                let still = arrived && Motion::is_still(fastest.to_radians());
                self.motion.look(Instant::now(), still)
            }
            Err(error) => Some(self.motion.fail(&error.to_string())),
        }
    }
}
