//! Executes commands on the device.

use yarp_devices::{Axes, AxisIndex, Mode, MotorTorqueParameters};

use super::super::messages::{Action, Range, Set, Setting};
use super::request_handler::{Refusal, RequestHandler};

impl RequestHandler {
    /// Executes a command. The device checks counts, axes and values before anything moves.
    pub(super) fn order(&self, set: &Set) -> Result<(), Refusal> {
        match set {
            Set::Values(setting, selection, values) => {
                self.set(*setting, selection.axes(), values)?;
            }
            Set::Act(action, selection) => self.act(*action, selection.axes())?,
            Set::Limits(range, axis, limits) => match range {
                Range::Position => self.limits()?.set_position_limits(*axis, *limits)?,
                Range::Velocity => self.limits()?.set_velocity_limits(*axis, *limits)?,
                Range::Torque | Range::Current => {
                    return Err(Refusal::NoInterface("way to set this range"));
                }
            },
            Set::ControlModes(selection, modes) => {
                self.modes()?.set_control_modes(selection.axes(), modes)?;
            }
            Set::Interactions(selection, interactions) => {
                let axes = selection.axes();
                self.interaction()?.set_interactions(axes, interactions)?;
            }
            Set::Pids(kind, selection, pids) => {
                self.pids()?.set_pids(*kind, selection.axes(), pids)?;
            }
            Set::Impedance(axis, impedance) => {
                self.impedance()?.set_impedance(*axis, *impedance)?;
            }
            Set::MotorParameters(axis, parameters, count) => {
                let torque = self.torque()?;
                let mut all = torque.motor_torque_parameters(*axis)?.to_array();
                let said = parameters.to_array().into_iter().take(*count);
                all.iter_mut().zip(said).for_each(|(slot, new)| *slot = new);
                let parameters = MotorTorqueParameters::from_array(all);
                torque.set_motor_torque_parameters(*axis, parameters)?;
            }
            Set::CalibrateAxis(axis, method, parameters) => {
                let calibration = self.calibration()?;
                calibration.calibrate_axis(*axis, *method, *parameters)?;
            }
            Set::CalibrationParameters(axis, parameters) => {
                let calibration = self.calibration()?;
                calibration.set_calibration_parameters(*axis, *parameters)?;
            }
            Set::Variable(name, value) => self.variables()?.set_variable(name, value)?,
            Set::ManualBrake(axis, active) => self.brakes()?.set_manual_brake(*axis, *active)?,
            Set::AutoBrake(axis, enabled) => self.brakes()?.set_auto_brake(*axis, *enabled)?,
        }
        Ok(())
    }

    fn set(&self, setting: Setting, axes: Axes<'_>, values: &[f64]) -> Result<(), Refusal> {
        match setting {
            Setting::Position => self.position()?.position_move(axes, values)?,
            Setting::Distance => self.position()?.relative_move(axes, values)?,
            Setting::ReferenceSpeed => self.position()?.set_reference_speeds(axes, values)?,
            Setting::ReferenceAcceleration => {
                self.motion()?.set_reference_accelerations(axes, values)?;
            }
            Setting::Velocity => self.velocity()?.velocity_move(axes, values)?,
            Setting::Encoder => self.encoders()?.set_encoders(axes, values)?,
            Setting::DirectPosition => {
                self.position_direct()?.set_direct_positions(axes, values)?;
            }
            Setting::DirectVelocity => {
                self.velocity_direct()?
                    .set_direct_velocities(axes, values)?;
            }
            Setting::Torque => self.torque()?.set_reference_torques(axes, values)?,
            Setting::Current => self.current()?.set_reference_currents(axes, values)?,
            Setting::DutyCycle => self.pwm()?.set_reference_duty_cycles(axes, values)?,
            Setting::MotorEncoder => self.motor_encoders()?.set_motor_encoders(axes, values)?,
            Setting::Pid(kind, value) => {
                self.pids()?.set_pid_values(kind, value, axes, values)?;
            }
            Setting::MotorCounts
            | Setting::TemperatureLimit
            | Setting::GearboxRatio
            | Setting::Amplifier(_)
            | Setting::ImpedanceOffset => {
                axes.check_command(self.axes(), "values", values.len())?;
                for (axis, value) in axes.iter(self.axes()).zip(values) {
                    self.set_one(setting, axis, *value)?;
                }
            }
        }
        Ok(())
    }

    /// Sets quantities that devices take for one axis at a time.
    fn set_one(&self, setting: Setting, axis: AxisIndex, value: f64) -> Result<(), Refusal> {
        match setting {
            Setting::MotorCounts => {
                self.motor_encoders()?
                    .set_counts_per_revolution(axis, value)?;
            }
            Setting::TemperatureLimit => self.motor()?.set_temperature_limit(axis, value)?,
            Setting::GearboxRatio => self.motor()?.set_gearbox_ratio(axis, value)?,
            Setting::Amplifier(limit) => {
                self.amplifiers()?.set_amplifier_limit(limit, axis, value)?;
            }
            _ => self.impedance()?.set_impedance_offset(axis, value)?,
        }
        Ok(())
    }

    fn act(&self, action: Action, axes: Axes<'_>) -> Result<(), Refusal> {
        match action {
            Action::Stop => self.motion()?.stop(axes)?,
            Action::ResetEncoders => self.encoders()?.reset_encoders(axes)?,
            Action::ResetMotorEncoders => self.motor_encoders()?.reset_motor_encoders(axes)?,
            Action::EnableAmplifiers => self.amplifiers()?.enable_amplifiers(axes, true)?,
            Action::DisableAmplifiers => self.amplifiers()?.enable_amplifiers(axes, false)?,
            Action::ResetPids(kind) => self.pids()?.reset_pids(kind, axes)?,
            Action::EnablePids(kind) => self.pids()?.enable_pids(kind, axes, true)?,
            Action::DisablePids(kind) => self.pids()?.enable_pids(kind, axes, false)?,
            Action::TorqueMode => {
                let modes = vec![Mode::Torque; self.axes()];
                self.modes()?.set_control_modes(Axes::All, &modes)?;
            }
            Action::Calibrate => self.calibrator()?.calibrate(axes)?,
            Action::Home => self.calibrator()?.home(axes)?,
            Action::Park => self.calibrator()?.park(axes)?,
            Action::QuitCalibration => self.calibrator()?.quit_calibration()?,
            Action::QuitPark => self.calibrator()?.quit_park()?,
            Action::CalibrateRobot => self.calibration()?.calibrate_robot()?,
            // Never waited for: that would hold up the client, and the connection with it.
            Action::ParkRobot => self.calibration()?.park_robot(false)?,
            Action::AbortCalibration => self.calibration()?.abort_calibration()?,
            Action::AbortPark => self.calibration()?.abort_park()?,
        }
        Ok(())
    }
}
