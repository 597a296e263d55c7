//! The driver behind the device interfaces.

use std::time::Instant;

use super::driver_state::{Goal, LinkState, State};
use super::{EmbeddedWam, Request};
use crate::embedded::protocol::Kind;
use crate::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointType, Limits, Mode, MotionControl, PositionControl, PositionDirect,
    RemoteCalibrator,
};

impl Device for EmbeddedWam {
    crate::offers! {
        axis_info: AxisInfo,
        position_control: PositionControl,
        position_direct: PositionDirect,
        encoders: Encoders,
        control_mode: ControlMode,
        control_limits: ControlLimits,
        remote_calibrator: RemoteCalibrator,
        remote_variables: RemoteVariables,
    }
}

/// A move, and the mode that it needs.
const POSITION_MOVE: (&str, Mode) = ("position move", Mode::Position);
const DIRECT_POSITION: (&str, Mode) = ("direct position", Mode::PositionDirect);
const MODES: [Mode; 2] = [Mode::Position, Mode::PositionDirect];

/// Returns the error for calls that the protocol does not support.
pub(super) fn wordless<T>(what: &str) -> Result<T, DeviceError> {
    Err(DeviceError::NotSupported {
        what: format!("{what}, for which the protocol of the embedded PC has no message,"),
    })
}

impl EmbeddedWam {
    fn total(&self) -> usize {
        self.shared.options.joints.len()
    }
}

impl State {
    /// The mode of a joint of the arm.
    fn mode(&self, joint: AxisIndex) -> Mode {
        match self.link.state {
            LinkState::Down => Mode::HardwareFault,
            LinkState::Idle => Mode::Idle,
            LinkState::Up if self.direct[joint.index()] => Mode::PositionDirect,
            LinkState::Up => Mode::Position,
        }
    }

    /// The newest readings, if they can be trusted.
    fn fresh_readings(&self, limit: std::time::Duration) -> Result<&[EncoderReading], DeviceError> {
        let what = "encoder reading";
        let Some(read_at) = self.read_at else {
            return Err(DeviceError::NoDataYet { what });
        };
        let age = Instant::now().saturating_duration_since(read_at);
        if age > limit {
            return Err(DeviceError::Stale { what, age, limit });
        }
        Ok(&self.readings)
    }

    /// Returns the commanded position of each joint, or the measured one without a command; inside its limits.
    fn goals(&self, total: usize) -> Vec<f64> {
        let goal = |joint: usize| {
            let goal = match &self.targets {
                Some(targets) => targets[joint],
                None => self.readings[joint].position,
            };
            match self.limits.position_limits(joint.into()) {
                // At rest at a limit, an encoder may read a count more.
                Ok(limits) => limits.clamp(goal),
                Err(_) => goal,
            }
        };
        (0..total.min(self.readings.len())).map(goal).collect()
    }
}

impl AxisInfo for EmbeddedWam {
    fn axes(&self) -> usize {
        self.total()
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        self.shared.lock().limits.axis_name(axis).map(str::to_owned)
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        self.shared.lock().limits.joint_type(axis)
    }
}

impl MotionControl for EmbeddedWam {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(self.total())?;
        let goals = {
            let state = self.shared.lock();
            state.check_up("stopping (moj)")?;
            if !state.is_moving() {
                return Ok(());
            }
            let mut goals = state.goals(self.total());
            for axis in axes.iter(self.total()) {
                let here = state.readings[axis.index()].position;
                goals[axis.index()] = state.limits.position_limits(axis)?.clamp(here);
            }
            goals
        };
        self.move_joints(goals)
    }

    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError> {
        axes.check_command(self.total(), "accelerations", accelerations.len())?;
        wordless("setting accelerations")
    }

    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(self.total())?;
        wordless("telling accelerations")
    }
}

impl EmbeddedWam {
    /// Sends all joints to these addresses, degrees, which were checked.
    fn move_joints(&self, goals: Vec<f64>) -> Result<(), DeviceError> {
        let angles = goals.iter().map(|goal| goal.to_radians()).collect();
        self.ask(Request::MoveJoints(angles), Goal::Joints(goals))
            .map(drop)
    }

    /// Checks a move in a mode and adds the joints that it does not name.
    fn move_some(
        &self,
        (command, needed): (&'static str, Mode),
        axes: Axes<'_>,
        values: &[f64],
        place: impl Fn(&State, AxisIndex, f64) -> f64,
    ) -> Result<(), DeviceError> {
        axes.check_command(self.total(), "positions", values.len())?;
        let goals = {
            let state = self.shared.lock();
            state.check_up(Kind::MoveJoints.step())?;
            let mut named = axes.iter(self.total());
            if let Some(joint) = named.find(|&joint| state.mode(joint) != needed) {
                return Err(DeviceError::WrongMode {
                    joint,
                    command,
                    mode: state.mode(joint),
                    needed,
                });
            }
            state.fresh_readings(self.shared.options.max_state_age)?;
            let mut goals = state.goals(self.total());
            for (joint, &value) in axes.iter(self.total()).zip(values) {
                let asked = place(&state, joint, value);
                let limits = state.limits.position_limits(joint)?;
                limits.check(joint, "position", asked, "deg")?;
                goals[joint.index()] = asked;
            }
            goals
        };
        if values.is_empty() {
            return Ok(());
        }
        self.move_joints(goals)
    }
}

impl PositionControl for EmbeddedWam {
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        self.move_some(POSITION_MOVE, axes, targets, |_, _, target| target)
    }

    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        self.move_some(POSITION_MOVE, axes, distances, |state, joint, distance| {
            state.readings[joint.index()].position + distance
        })
    }

    fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        axes.check(self.total())?;
        let state = self.shared.lock();
        state.check_up("asking whether the motion is done")?;
        Ok(!state.is_moving())
    }

    fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(self.total())?;
        let state = self.shared.lock();
        state.check_up("asking for target positions")?;
        let goals = state.goals(self.total());
        Ok(axes
            .iter(self.total())
            .map(|axis| goals[axis.index()])
            .collect())
    }

    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Result<(), DeviceError> {
        axes.check_command(self.total(), "speeds", speeds.len())?;
        wordless("setting speeds")
    }

    fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(self.total())?;
        wordless("telling speeds")
    }
}

impl PositionDirect for EmbeddedWam {
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.move_some(DIRECT_POSITION, axes, positions, |_, _, place| place)
    }

    fn direct_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.target_positions(axes)
    }
}

impl Encoders for EmbeddedWam {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        axes.check(self.total())?;
        axes.check_count(self.total(), "slots for readings", out.len())?;
        let state = self.shared.lock();
        let readings = state.fresh_readings(self.shared.options.max_state_age)?;
        for (slot, axis) in out.iter_mut().zip(axes.iter(self.total())) {
            *slot = readings[axis.index()];
        }
        Ok(())
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        axes.check_command(self.total(), "encoder positions", positions.len())?;
        wordless("setting encoders")
    }
}

impl ControlMode for EmbeddedWam {
    fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        Axes::One(axis).check(self.total())?;
        Ok(MODES.to_vec())
    }

    /// Those of positions; idle as long as the arm is without gravity compensation and after a fault ended a move; a
    /// hardware fault without a connection. The protocol does not report a fault at rest: the next move is refused.
    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        axes.check(self.total())?;
        axes.check_count(self.total(), "slots for modes", out.len())?;
        let state = self.shared.lock();
        for (slot, axis) in out.iter_mut().zip(axes.iter(self.total())) {
            *slot = state.mode(axis);
        }
        Ok(())
    }

    /// The modes of positions alone, which switch gravity compensation on for the whole arm.
    fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        axes.check_command(self.total(), "modes", modes.len())?;
        let mut asked = axes.iter(self.total()).zip(modes);
        if let Some((joint, &mode)) = asked.find(|(_, mode)| !MODES.contains(mode)) {
            return Err(DeviceError::NoSuchMode { joint, mode });
        }
        if modes.is_empty() {
            return Ok(());
        }
        if self.link().state != LinkState::Up {
            self.switch_gravity_on()?;
        }
        let mut state = self.shared.lock();
        state.check_up("setting control modes")?;
        for (axis, &mode) in axes.iter(self.total()).zip(modes) {
            state.direct[axis.index()] = mode == Mode::PositionDirect;
        }
        Ok(())
    }
}

impl ControlLimits for EmbeddedWam {
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.shared.lock().limits.position_limits(axis)
    }

    /// Limits are stored and enforced by the driver: the protocol has no message for limits, and the arm has its own.
    fn set_position_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        Axes::One(axis).check(self.total())?;
        let mut state = self.shared.lock();
        if state.is_moving() {
            return Err(DeviceError::Moving {
                joint: axis,
                what: "change its limits",
            });
        }
        let here = state.fresh_readings(self.shared.options.max_state_age)?[axis.index()].position;
        let built = &self.shared.options.joints[axis.index()].limits;
        state.limits.place(axis, built.clamp(here))?;
        state.limits.set_position_limits(axis, limits)
    }

    fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.shared.lock().limits.velocity_limits(axis)
    }

    fn set_velocity_limits(&self, axis: AxisIndex, _: Limits) -> Result<(), DeviceError> {
        Axes::One(axis).check(self.total())?;
        wordless("setting velocity limits")
    }
}

/// Homing alone (`hom`), of the whole arm.
impl RemoteCalibrator for EmbeddedWam {
    fn calibrator_present(&self) -> Result<bool, DeviceError> {
        Ok(true)
    }

    fn calibrate(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(self.total())?;
        wordless("calibrating")
    }

    fn home(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(self.total())?;
        match axes {
            Axes::All => self.move_home(),
            _ => wordless("homing some of the joints"),
        }
    }

    fn park(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(self.total())?;
        wordless("parking")
    }

    fn quit_calibration(&self) -> Result<(), DeviceError> {
        wordless("ending a calibration")
    }

    fn quit_park(&self) -> Result<(), DeviceError> {
        wordless("ending parking")
    }
}
