//! The device behind the recorded control board conversations, as far as they show it.
//!
//! Stock's `fakeMotionControl` of seven axes: it accepts every command and reports that its motion
//! is never done. Positions do not change here; those of the recording are set. Everything that the
//! recordings do not query is delegated to a simulated arm.

use std::sync::{Mutex, MutexGuard, PoisonError};

use yarp_devices::wam::SimulatedWam;
use yarp_devices::{
    Axes, AxisIndex, AxisInfo, ControlCalibration, ControlLimits, ControlMode, CurrentControl,
    Device, DeviceError, EncoderReading, Encoders, ImpedanceControl, InteractionMode, JointBrake,
    JointFault, JointType, Limits, Mode, MotionControl, MotorEncoders, Pid, PositionControl,
    PwmControl, VelocityControl, VelocityDirect,
};

/// A board whose axes do not move and accept every command.
#[derive(Debug)]
pub struct RecordedBoard {
    positions: Vec<f64>,
    pub(crate) largest_torque: f64,
    pub(crate) arm: SimulatedWam,
    state: Mutex<State>,
}

#[derive(Debug)]
pub(crate) struct State {
    pub(crate) pids: Vec<Pid>,
    modes: Vec<Mode>,
    targets: Vec<f64>,
    speeds: Vec<f64>,
    accelerations: Vec<f64>,
    velocities: Vec<f64>,
}

impl RecordedBoard {
    /// Creates a board whose axes are at `positions`.
    pub fn at(positions: Vec<f64>) -> Self {
        let axes = positions.len();
        Self {
            largest_torque: 0.0,
            arm: SimulatedWam::new(),
            state: Mutex::new(State {
                pids: vec![Pid::default(); axes],
                modes: vec![Mode::Position; axes],
                targets: positions.clone(),
                speeds: vec![0.0; axes],
                accelerations: vec![0.0; axes],
                velocities: vec![0.0; axes],
            }),
            positions,
        }
    }

    /// Sets a range of torques, as recorded from 4.0.
    pub fn with_torques(mut self, largest: f64) -> Self {
        self.largest_torque = largest;
        self
    }

    /// Returns the velocities last commanded.
    pub fn velocities(&self) -> Vec<f64> {
        self.state().velocities.clone()
    }

    pub(crate) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(
        &self,
        axes: Axes<'_>,
        values: &[f64],
        field: impl Fn(&mut State) -> &mut Vec<f64>,
    ) -> Result<(), DeviceError> {
        axes.check_command(self.axes(), "values", values.len())?;
        let mut state = self.state();
        for (axis, value) in axes.iter(self.axes()).zip(values) {
            field(&mut state)[axis.index()] = *value;
        }
        Ok(())
    }

    fn get(
        &self,
        axes: Axes<'_>,
        field: impl Fn(&State) -> &Vec<f64>,
    ) -> Result<Vec<f64>, DeviceError> {
        axes.check(self.axes())?;
        let state = self.state();
        Ok(axes
            .iter(self.axes())
            .map(|axis| field(&state)[axis.index()])
            .collect())
    }
}

impl Device for RecordedBoard {
    yarp_devices::offers! {
        axis_info: AxisInfo,
        position_control: PositionControl,
        velocity_control: VelocityControl,
        encoders: Encoders,
        control_mode: ControlMode,
        control_limits: ControlLimits,
        pid_control: PidControl,
        torque_control: TorqueControl,
        amplifier_control: AmplifierControl,
        motor: Motor,
        position_direct: PositionDirect,
    }

    fn velocity_direct(&self) -> Option<&dyn VelocityDirect> {
        Some(&self.arm)
    }

    fn current_control(&self) -> Option<&dyn CurrentControl> {
        Some(&self.arm)
    }

    fn pwm_control(&self) -> Option<&dyn PwmControl> {
        Some(&self.arm)
    }

    fn interaction_mode(&self) -> Option<&dyn InteractionMode> {
        Some(&self.arm)
    }

    fn impedance_control(&self) -> Option<&dyn ImpedanceControl> {
        Some(&self.arm)
    }

    fn motor_encoders(&self) -> Option<&dyn MotorEncoders> {
        Some(&self.arm)
    }

    fn control_calibration(&self) -> Option<&dyn ControlCalibration> {
        Some(&self.arm)
    }

    fn joint_fault(&self) -> Option<&dyn JointFault> {
        Some(&self.arm)
    }

    fn joint_brake(&self) -> Option<&dyn JointBrake> {
        Some(&self.arm)
    }
}

impl AxisInfo for RecordedBoard {
    fn axes(&self) -> usize {
        self.positions.len()
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        Axes::One(axis).check(self.axes())?;
        Ok(format!("joint{axis}"))
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        Axes::One(axis).check(self.axes())?;
        Ok(JointType::Revolute)
    }
}

impl MotionControl for RecordedBoard {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(self.axes())
    }

    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError> {
        self.put(axes, accelerations, |state| &mut state.accelerations)
    }

    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.get(axes, |state| &state.accelerations)
    }
}

impl PositionControl for RecordedBoard {
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        self.put(axes, targets, |state| &mut state.targets)
    }

    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        axes.check_command(self.axes(), "values", distances.len())
    }

    fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        axes.check(self.axes()).map(|()| false)
    }

    fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.get(axes, |state| &state.targets)
    }

    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Result<(), DeviceError> {
        self.put(axes, speeds, |state| &mut state.speeds)
    }

    fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.get(axes, |state| &state.speeds)
    }
}

impl VelocityControl for RecordedBoard {
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.put(axes, velocities, |state| &mut state.velocities)
    }

    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.get(axes, |state| &state.velocities)
    }
}

impl Encoders for RecordedBoard {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        axes.check_count(self.axes(), "readings", out.len())?;
        for (axis, reading) in axes.iter(self.axes()).zip(out) {
            *reading = EncoderReading {
                position: self.positions[axis.index()],
                ..EncoderReading::default()
            };
        }
        Ok(())
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        axes.check_command(self.axes(), "positions", positions.len())
    }
}

impl ControlMode for RecordedBoard {
    fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        Axes::One(axis).check(self.axes())?;
        Ok(vec![Mode::Position, Mode::Velocity, Mode::PositionDirect])
    }

    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        axes.check_count(self.axes(), "modes", out.len())?;
        let state = self.state();
        for (axis, mode) in axes.iter(self.axes()).zip(out) {
            *mode = state.modes[axis.index()];
        }
        Ok(())
    }

    fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        axes.check_command(self.axes(), "modes", modes.len())?;
        let mut state = self.state();
        for (axis, mode) in axes.iter(self.axes()).zip(modes) {
            state.modes[axis.index()] = *mode;
        }
        Ok(())
    }
}

impl ControlLimits for RecordedBoard {
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        Axes::One(axis).check(self.axes())?;
        Ok(Limits::new(0.0, 100.0))
    }

    fn set_position_limits(&self, axis: AxisIndex, _limits: Limits) -> Result<(), DeviceError> {
        Axes::One(axis).check(self.axes())
    }

    fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        Axes::One(axis).check(self.axes())?;
        // 4.0 reports a negative minimum velocity.
        let smallest = if self.largest_torque > 0.0 {
            -50.0
        } else {
            0.0
        };
        Ok(Limits::new(smallest, 50.0))
    }

    fn set_velocity_limits(&self, axis: AxisIndex, _limits: Limits) -> Result<(), DeviceError> {
        Axes::One(axis).check(self.axes())
    }
}
