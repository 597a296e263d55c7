//! Executes requests on the arm: radians and poses outside, a [`Device`] in degrees inside.

use std::sync::Arc;
use std::time::Instant;

use nalgebra::{IsometryMatrix3, Translation3};

use super::motion_completion::{Ended, Motion};
use crate::embedded::protocol::{POSE, Reply, Request};
use crate::kinematics::{EulerXyz, Joints, Solver};
use crate::wam::{AXES, WamModel};
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
    #[error("too many queries for the end of one move")]
    TooManyQueries,
}

/// The arm, and the move it makes.
pub(super) struct Arm {
    device: Arc<dyn Device>,
    model: WamModel<AXES>,
    solver: Solver<AXES>,
    pub(super) motion: Motion,
}

impl Arm {
    pub(super) fn new(device: Arc<dyn Device>) -> Result<Self, DeviceError> {
        let lacks = |what: &str| DeviceError::NotSupported {
            what: format!("serving an arm without {what}"),
        };
        let axes = device.axis_info().map_or(0, |info| info.axes());
        if axes != AXES {
            return Err(lacks(&format!("seven joints (this has {axes})")));
        }
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
        let model = WamModel::<AXES>::new();
        Ok(Self {
            solver: Solver::new(model.chain.clone()),
            model,
            device,
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

    /// Idle: without gravity compensation, as an arm is before the first `gra`. A fault stays one.
    pub(super) fn rest(&self) -> Result<(), DeviceError> {
        if self.fault()?.is_some() {
            return Ok(());
        }
        self.modes()
            .set_control_modes(Axes::All, &[Mode::Idle; AXES])
    }

    /// Stops the current move. The joints hold; idle ones stay idle.
    pub(super) fn hold(&mut self) {
        self.motion.drop_pending_queries();
        if !self.motion.is_running() {
            return;
        }
        if let Err(error) = self.position().stop(Axes::All) {
            tracing::error!(%error, "the arm could not be stopped");
        }
        self.motion.begin();
    }

    /// Executes a request; returns the reply, or the reason for `q`.
    pub(super) fn obey(&mut self, request: &Request) -> Result<Reply, Refusal> {
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
            Request::MovePose(pose) => {
                let angles = self.solve(pose)?;
                self.go(angles.iter().map(|angle| angle.to_degrees()).collect())
            }
            Request::Home => {
                let home = self.model.home;
                self.go(home.iter().map(|angle| angle.to_degrees()).collect())
            }
            Request::Gravity => {
                self.modes()
                    .set_control_modes(Axes::All, &[Mode::Position; AXES])?;
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

    fn go(&mut self, mut targets: Vec<f64>) -> Result<Reply, Refusal> {
        for (joint, mode) in self.control_modes()?.into_iter().enumerate() {
            match mode {
                Mode::Position => {}
                Mode::HardwareFault => return Err(Refusal::Fault { joint }),
                mode => return Err(Refusal::NotHeld { joint, mode }),
            }
        }
        for (joint, target) in targets.iter_mut().enumerate() {
            let limits = self.limits().position_limits(joint.into())?;
            let inside = limits.clamp(*target);
            if (inside - *target).abs() < LIMIT_TOLERANCE {
                *target = inside;
            }
        }
        self.position().position_move(Axes::All, &targets)?;
        self.motion.begin();
        Ok(Reply::Done)
    }

    fn solve(&self, pose: &[f64; POSE]) -> Result<Joints<AXES>, Refusal> {
        let [x, y, z, roll, pitch, yaw] = *pose;
        if pose.iter().any(|number| !number.is_finite()) {
            return Err(Refusal::NotFinite);
        }
        let target = IsometryMatrix3::from_parts(
            Translation3::new(x, y, z),
            EulerXyz::new(roll, pitch, yaw).rotation(),
        );
        let found = self.solver.solve(&target, &self.angles()?);
        let found = found.map_err(|unsolved| Refusal::OutOfReach {
            millimetres: unsolved.nearest.position_error * 1e3,
            degrees: unsolved.nearest.angle_error.to_degrees(),
        })?;
        Ok(found.joints)
    }

    fn pose(&self) -> Result<[f64; POSE], DeviceError> {
        let tool = self.model.chain.forward(&self.angles()?);
        let place = tool.translation.vector;
        let turn = EulerXyz::from_rotation(&tool.rotation);
        Ok([place.x, place.y, place.z, turn.roll, turn.pitch, turn.yaw])
    }

    fn angles(&self) -> Result<Joints<AXES>, DeviceError> {
        let angles = self
            .readings()?
            .map(|reading| reading.position.to_radians());
        Ok(Joints::from(angles))
    }

    fn readings(&self) -> Result<[EncoderReading; AXES], DeviceError> {
        let mut readings = [EncoderReading::default(); AXES];
        self.encoders().read_encoders(Axes::All, &mut readings)?;
        Ok(readings)
    }

    fn control_modes(&self) -> Result<[Mode; AXES], DeviceError> {
        let mut modes = [Mode::UNKNOWN; AXES];
        self.modes().read_control_modes(Axes::All, &mut modes)?;
        Ok(modes)
    }

    /// The first joint in a fault, if one is.
    fn fault(&self) -> Result<Option<usize>, DeviceError> {
        let modes = self.control_modes()?;
        Ok(modes.iter().position(|mode| *mode == Mode::HardwareFault))
    }

    /// Looks whether the move has ended. A move that was replaced ends at once.
    pub(super) fn look(&mut self) -> Option<Ended> {
        if !self.motion.is_running() {
            return self.motion.look(Instant::now(), true);
        }
        let state = || {
            let fault = self.fault()?;
            let fastest = self
                .readings()?
                .iter()
                .fold(0.0_f64, |fastest, reading| fastest.max(reading.speed.abs()));
            let arrived = self.position().motion_done(Axes::All)?;
            Ok::<_, DeviceError>((fault, arrived, fastest))
        };
        match state() {
            Ok((Some(joint), ..)) => Some(self.motion.fail(&format!("fault at joint {joint}"))),
            Ok((None, arrived, fastest)) => {
                let still = arrived && Motion::is_still(fastest.to_radians());
                self.motion.look(Instant::now(), still)
            }
            Err(error) => Some(self.motion.fail(&error.to_string())),
        }
    }
}
