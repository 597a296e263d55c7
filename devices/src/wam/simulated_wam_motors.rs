//! The list of interfaces of the simulated arm, and those for its motors.

use std::thread;
use std::time::{Duration, Instant};

use super::SimulatedWam;
use crate::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, CalibrationParameters, ControlCalibration,
    ControlDebug, CurrentControl, Device, DeviceError, EncoderReading, Fault, Impedance,
    ImpedanceControl, ImpedanceLimits, Interaction, InteractionMode, JointBrake, JointFault,
    Limits, MotionControl, Motor, MotorEncoders, MotorTorqueParameters, Pid, PidControl, PidInfo,
    PidKind, PidValue, PositionControl, PositionDirect, PwmControl, RemoteCalibrator,
    RemoteVariables, TorqueControl, VariableValue, VelocityDirect, VirtualSensor,
};

/// Longer than any way home takes.
const HOMING_TIMEOUT: Duration = Duration::from_secs(120);
const POLL_INTERVAL: Duration = Duration::from_millis(5);

impl Device for SimulatedWam {
    crate::offers! {
        axis_info: AxisInfo,
        position_control: PositionControl,
        velocity_control: VelocityControl,
        encoders: Encoders,
        control_mode: ControlMode,
        control_limits: ControlLimits,
        position_direct: PositionDirect,
        velocity_direct: VelocityDirect,
        torque_control: TorqueControl,
        current_control: CurrentControl,
        pwm_control: PwmControl,
        interaction_mode: InteractionMode,
        impedance_control: ImpedanceControl,
        pid_control: PidControl,
        motor_encoders: MotorEncoders,
        motor: Motor,
        amplifier_control: AmplifierControl,
        control_calibration: ControlCalibration,
        remote_calibrator: RemoteCalibrator,
        remote_variables: RemoteVariables,
        control_debug: ControlDebug,
        joint_fault: JointFault,
        joint_brake: JointBrake,
        virtual_sensor: VirtualSensor,
    }
}

impl VirtualSensor for SimulatedWam {
    fn virtual_channels(&self) -> usize {
        self.arm().model.axes()
    }

    fn set_virtual_measures(&self, values: &[f64]) -> Result<(), DeviceError> {
        self.arm().model.set_virtual_measures(values)
    }
}

/// Implements methods by those of the model that have their names.
macro_rules! as_the_model_does {
    ($($trait:ident { $($name:ident($($argument:ident: $type:ty),*) -> $answer:ty;)* })*) => {$(
        impl $trait for SimulatedWam {
            $(fn $name(&self, $($argument: $type),*) -> Result<$answer, DeviceError> {
                self.arm().model.$name($($argument),*)
            })*
        }
    )*};
}

as_the_model_does! {
    PositionDirect {
        set_direct_positions(axes: Axes<'_>, positions: &[f64]) -> ();
        direct_positions(axes: Axes<'_>) -> Vec<f64>;
    }
    VelocityDirect {
        set_direct_velocities(axes: Axes<'_>, velocities: &[f64]) -> ();
        direct_velocities(axes: Axes<'_>) -> Vec<f64>;
    }
    TorqueControl {
        set_reference_torques(axes: Axes<'_>, torques: &[f64]) -> ();
        reference_torques(axes: Axes<'_>) -> Vec<f64>;
        torques(axes: Axes<'_>) -> Vec<f64>;
        torque_ranges(axes: Axes<'_>) -> Vec<Limits>;
        motor_torque_parameters(axis: AxisIndex) -> MotorTorqueParameters;
        set_motor_torque_parameters(axis: AxisIndex, parameters: MotorTorqueParameters) -> ();
    }
    CurrentControl {
        currents(axes: Axes<'_>) -> Vec<f64>;
        current_ranges(axes: Axes<'_>) -> Vec<Limits>;
        set_reference_currents(axes: Axes<'_>, currents: &[f64]) -> ();
        reference_currents(axes: Axes<'_>) -> Vec<f64>;
    }
    PwmControl {
        duty_cycles(axes: Axes<'_>) -> Vec<f64>;
        set_reference_duty_cycles(axes: Axes<'_>, duty_cycles: &[f64]) -> ();
        reference_duty_cycles(axes: Axes<'_>) -> Vec<f64>;
    }
    InteractionMode {
        interactions(axes: Axes<'_>) -> Vec<Interaction>;
        set_interactions(axes: Axes<'_>, interactions: &[Interaction]) -> ();
    }
    ImpedanceControl {
        impedance(axis: AxisIndex) -> Impedance;
        set_impedance(axis: AxisIndex, impedance: Impedance) -> ();
        impedance_offset(axis: AxisIndex) -> f64;
        set_impedance_offset(axis: AxisIndex, offset: f64) -> ();
        impedance_limits(axis: AxisIndex) -> ImpedanceLimits;
    }
    PidControl {
        available_pids(axis: AxisIndex) -> Vec<PidKind>;
        pids(kind: PidKind, axes: Axes<'_>) -> Vec<Pid>;
        pid_info(kind: PidKind, axes: Axes<'_>) -> Vec<PidInfo>;
        set_pids(kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> ();
        pid_values(kind: PidKind, value: PidValue, axes: Axes<'_>) -> Vec<f64>;
        set_pid_values(kind: PidKind, value: PidValue, axes: Axes<'_>, values: &[f64]) -> ();
        pids_enabled(kind: PidKind, axes: Axes<'_>) -> Vec<bool>;
        enable_pids(kind: PidKind, axes: Axes<'_>, enabled: bool) -> ();
        reset_pids(kind: PidKind, axes: Axes<'_>) -> ();
    }
    Motor {
        temperatures(axes: Axes<'_>) -> Vec<f64>;
        temperature_limit(axis: AxisIndex) -> f64;
        set_temperature_limit(axis: AxisIndex, limit: f64) -> ();
        gearbox_ratio(axis: AxisIndex) -> f64;
        set_gearbox_ratio(axis: AxisIndex, ratio: f64) -> ();
    }
    AmplifierControl {
        enable_amplifiers(axes: Axes<'_>, enabled: bool) -> ();
        amplifier_status(axes: Axes<'_>) -> Vec<i32>;
        amplifier_limit(limit: AmplifierLimit, axis: AxisIndex) -> f64;
        set_amplifier_limit(limit: AmplifierLimit, axis: AxisIndex, value: f64) -> ();
        amplifier_duty_cycle(axis: AxisIndex) -> f64;
        supply_voltage(axis: AxisIndex) -> f64;
    }
    RemoteVariables {
        variables() -> Vec<String>;
        variable(name: &str) -> Vec<VariableValue>;
        set_variable(name: &str, value: &[VariableValue]) -> ();
    }
    ControlDebug {
        save_boot_memory() -> ();
        load_boot_memory() -> ();
    }
    JointFault {
        last_fault(axis: AxisIndex) -> Fault;
    }
    JointBrake {
        is_braked(axis: AxisIndex) -> bool;
        set_manual_brake(axis: AxisIndex, active: bool) -> ();
        auto_brake(axis: AxisIndex) -> bool;
        set_auto_brake(axis: AxisIndex, enabled: bool) -> ();
    }
}

impl MotorEncoders for SimulatedWam {
    fn motor_readings(&self, axes: Axes<'_>) -> Result<Vec<EncoderReading>, DeviceError> {
        let arm = self.arm();
        let mut readings = arm.model.motor_readings(axes)?;
        readings
            .iter_mut()
            .for_each(|reading| reading.time = arm.time);
        Ok(readings)
    }

    fn set_motor_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.arm().model.set_motor_encoders(axes, positions)
    }

    fn counts_per_revolution(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        self.arm().model.counts_per_revolution(axis)
    }

    fn set_counts_per_revolution(&self, axis: AxisIndex, counts: f64) -> Result<(), DeviceError> {
        self.arm().model.set_counts_per_revolution(axis, counts)
    }
}

impl ControlCalibration for SimulatedWam {
    fn calibrate_axis(
        &self,
        axis: AxisIndex,
        method: u32,
        parameters: [f64; 3],
    ) -> Result<(), DeviceError> {
        self.arm().model.calibrate_axis(axis, method, parameters)
    }

    fn set_calibration_parameters(
        &self,
        axis: AxisIndex,
        parameters: CalibrationParameters,
    ) -> Result<(), DeviceError> {
        self.arm()
            .model
            .set_calibration_parameters(axis, parameters)
    }

    fn calibration_done(&self, axis: AxisIndex) -> Result<bool, DeviceError> {
        self.arm().model.calibration_done(axis)
    }

    fn calibrate_robot(&self) -> Result<(), DeviceError> {
        self.calibrate(Axes::All)
    }

    fn park_robot(&self, wait: bool) -> Result<(), DeviceError> {
        self.park(Axes::All)?;
        let deadline = Instant::now() + HOMING_TIMEOUT;
        while wait && !self.motion_done(Axes::All)? && Instant::now() < deadline {
            thread::sleep(POLL_INTERVAL);
        }
        Ok(())
    }

    /// A calibration of exact encoders ends at once, so there is none to abort.
    fn abort_calibration(&self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn abort_park(&self) -> Result<(), DeviceError> {
        self.stop(Axes::All)
    }
}

impl RemoteCalibrator for SimulatedWam {
    fn calibrator_present(&self) -> Result<bool, DeviceError> {
        Ok(true)
    }

    fn calibrate(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.arm().model.calibrate(axes)
    }

    fn home(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.arm().model.home(axes)
    }

    /// Home is also the parking position.
    fn park(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.home(axes)
    }

    fn quit_calibration(&self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn quit_park(&self) -> Result<(), DeviceError> {
        self.stop(Axes::All)
    }
}
