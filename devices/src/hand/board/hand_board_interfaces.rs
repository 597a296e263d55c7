//! The interfaces of a control board, as far as the hand supports them.

use super::{AXES, HandBoard, Readiness, State};
use crate::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointType, Limits, Mode, MotionControl, PositionControl, VelocityControl,
};

/// Modes of an axis.
const MODES: [Mode; 3] = [Mode::Idle, Mode::Position, Mode::Velocity];

impl State {
    /// Checks that the hand accepts motor commands.
    fn check_ready(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(AXES)?;
        let (by, remedy) = match self.readiness {
            Readiness::Ready => return Ok(()),
            Readiness::NotInitialised => ("a hand that is not initialised", "initialise it"),
            Readiness::Lost => ("a line that broke", "look at the cable and the supply"),
        };
        match axes.iter(AXES).next() {
            Some(joint) => Err(DeviceError::Held { joint, by, remedy }),
            None => Ok(()),
        }
    }
}

impl Device for HandBoard {
    crate::offers! {
        axis_info: AxisInfo,
        position_control: PositionControl,
        velocity_control: VelocityControl,
        encoders: Encoders,
        control_mode: ControlMode,
        control_limits: ControlLimits,
        hand: Hand,
        grasp: Grasp,
    }
}

impl AxisInfo for HandBoard {
    fn axes(&self) -> usize {
        AXES
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        self.state().set_points.axis_name(axis).map(str::to_owned)
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        self.state().set_points.joint_type(axis)
    }
}

impl MotionControl for HandBoard {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.state().set_points.stop(axes)
    }

    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError> {
        let mut state = self.state();
        state
            .set_points
            .set_reference_accelerations(axes, accelerations)
    }

    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.state().set_points.reference_accelerations(axes)
    }
}

impl PositionControl for HandBoard {
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        let mut state = self.state();
        state.check_ready(axes)?;
        state.set_points.position_move(axes, targets)
    }

    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        let mut state = self.state();
        state.check_ready(axes)?;
        state.set_points.relative_move(axes, distances)
    }

    fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        let state = self.state();
        let arrived = state.set_points.motion_done(axes)?;
        let there = |axis: AxisIndex| state.measured[axis.index()].there;
        Ok(arrived && !state.at_work && axes.iter(AXES).all(there))
    }

    fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.state().set_points.target_positions(axes)
    }

    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Result<(), DeviceError> {
        self.state().set_points.set_reference_speeds(axes, speeds)
    }

    fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.state().set_points.reference_speeds(axes)
    }
}

impl VelocityControl for HandBoard {
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        let mut state = self.state();
        state.check_ready(axes)?;
        state.set_points.velocity_move(axes, velocities)
    }

    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.state().set_points.reference_velocities(axes)
    }
}

/// Positions come with each round of RealTime; while the hand carries out a command of its own language they stay as
/// they were, with their time.
impl Encoders for HandBoard {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        axes.check(AXES)?;
        axes.check_count(AXES, "slots for readings", out.len())?;
        let state = self.state();
        let what = "encoder reading";
        let time = state.time.ok_or(DeviceError::NoDataYet { what })?;
        for (slot, axis) in out.iter_mut().zip(axes.iter(AXES)) {
            let measured = state.measured[axis.index()];
            *slot = EncoderReading {
                position: measured.position,
                speed: measured.speed,
                acceleration: 0.0,
                time,
            };
        }
        Ok(())
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        axes.check_command(AXES, "encoder positions", positions.len())?;
        Err(DeviceError::NotSupported {
            what: "setting encoders of a hand, which counts from its open stops,".to_owned(),
        })
    }
}

impl ControlMode for HandBoard {
    fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        Axes::One(axis).check(AXES)?;
        Ok(MODES.to_vec())
    }

    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        let state = self.state();
        state.set_points.read_control_modes(axes, out)?;
        match state.readiness {
            Readiness::Ready => {}
            Readiness::NotInitialised => out.fill(Mode::NotConfigured),
            Readiness::Lost => out.fill(Mode::HardwareFault),
        }
        Ok(())
    }

    fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        axes.check_command(AXES, "modes", modes.len())?;
        let settable = |mode| MODES.contains(&mode) || mode == Mode::ForceIdle;
        let unknown = axes
            .iter(AXES)
            .zip(modes)
            .find(|(_, mode)| !settable(**mode));
        if let Some((joint, &mode)) = unknown {
            return Err(DeviceError::NoSuchMode { joint, mode });
        }
        let mut state = self.state();
        state.check_ready(axes)?;
        state.set_points.set_control_modes(axes, modes)
    }
}

impl ControlLimits for HandBoard {
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.state().set_points.position_limits(axis)
    }

    fn set_position_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.state().set_points.set_position_limits(axis, limits)
    }

    fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.state().set_points.velocity_limits(axis)
    }

    fn set_velocity_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.state().set_points.set_velocity_limits(axis, limits)
    }
}
