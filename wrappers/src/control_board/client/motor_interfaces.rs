//! Motors, forces, control loops, and further interfaces.

use std::time::{Duration, Instant};

use yarp_devices::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, CalibrationParameters, ControlCalibration,
    CurrentControl, DeviceError, EncoderReading, Fault, Impedance, ImpedanceControl,
    ImpedanceLimits, Interaction, InteractionMode, JointBrake, JointFault, Limits, Motor,
    MotorEncoders, MotorTorqueParameters, Pid, PidControl, PidInfo, PidKind, PidValue,
    PositionControl, PwmControl, RemoteCalibrator, RemoteVariables, TorqueControl, VariableValue,
};
use yarp_wire::{Value, Vocab32, WireVersion};

use super::super::messages::{
    Action, Get, Quantity, Query, Range, Selection, Set, Setting, float, kind_of, read_flag,
    read_gains, read_pid_info, read_variable,
};
use super::RemoteControlBoard;
use super::board_requests::{codes, numbers, pair};

/// Timeout of parking.
const HOMING_TIMEOUT: Duration = Duration::from_secs(120);
const POLL_INTERVAL: Duration = Duration::from_millis(50);

type Outcome<T> = Result<T, DeviceError>;

impl TorqueControl for RemoteControlBoard {
    /// Sent without waiting: a refusal of the board is not reported.
    fn set_reference_torques(&self, axes: Axes<'_>, torques: &[f64]) -> Outcome<()> {
        self.set(Setting::Torque, "torques", axes, torques)
    }

    fn reference_torques(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.values(Quantity::ReferenceTorque, axes)
    }

    /// From the newest state.
    fn torques(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.newest("torque", axes, |data| &data.torques)
    }

    fn torque_ranges(&self, axes: Axes<'_>) -> Outcome<Vec<Limits>> {
        self.ranges(Range::Torque, axes)
    }

    fn motor_torque_parameters(&self, axis: AxisIndex) -> Outcome<MotorTorqueParameters> {
        self.about(Query::MotorParameters, axis)?.read(|values| {
            // Up to 3.6 there are four, later nine.
            let mut all = [0.0; 9];
            for (slot, value) in all.iter_mut().zip(values) {
                *slot = float(value)?;
            }
            let enough = values.len() == 4 || values.len() == 9;
            enough.then(|| MotorTorqueParameters::from_array(all))
        })
    }

    /// A board up to 3.6 takes four numbers, and gets them if the others are 0.
    fn set_motor_torque_parameters(
        &self,
        axis: AxisIndex,
        parameters: MotorTorqueParameters,
    ) -> Outcome<()> {
        Axes::One(axis).check(self.axes)?;
        let numbers = parameters.to_array();
        for number in numbers {
            self.check_finite(axis.into(), "motor torque parameter", &[number])?;
        }
        let outcome = self.order(Set::MotorParameters(axis, parameters, 9));
        let old =
            self.wire_version() == WireVersion::V3 && numbers[4..].iter().all(|one| *one == 0.0);
        match outcome {
            Err(DeviceError::Refused { .. }) if old => {
                self.order(Set::MotorParameters(axis, parameters, 4))
            }
            other => other,
        }
    }
}

impl CurrentControl for RemoteControlBoard {
    /// From the newest state.
    fn currents(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.newest("current", axes, |data| &data.currents)
    }

    fn current_ranges(&self, axes: Axes<'_>) -> Outcome<Vec<Limits>> {
        self.ranges(Range::Current, axes)
    }

    /// Sent and not waited for, but for one joint of a board of 4.0.
    fn set_reference_currents(&self, axes: Axes<'_>, currents: &[f64]) -> Outcome<()> {
        self.set(Setting::Current, "currents", axes, currents)
    }

    fn reference_currents(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.values(Quantity::ReferenceCurrent, axes)
    }
}

impl PwmControl for RemoteControlBoard {
    /// From the newest state.
    fn duty_cycles(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.newest("duty cycle", axes, |data| &data.duty_cycles)
    }

    /// Sent and not waited for, but for one joint of a board of 4.0.
    fn set_reference_duty_cycles(&self, axes: Axes<'_>, duty_cycles: &[f64]) -> Outcome<()> {
        self.set(Setting::DutyCycle, "duty cycles", axes, duty_cycles)
    }

    fn reference_duty_cycles(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.values(Quantity::ReferenceDutyCycle, axes)
    }
}

impl InteractionMode for RemoteControlBoard {
    /// From the newest state.
    fn interactions(&self, axes: Axes<'_>) -> Outcome<Vec<Interaction>> {
        self.newest("interaction mode", axes, |data| &data.interaction_modes)
    }

    fn set_interactions(&self, axes: Axes<'_>, interactions: &[Interaction]) -> Outcome<()> {
        axes.check_command(self.axes, "interaction modes", interactions.len())?;
        if interactions.is_empty() {
            return Ok(());
        }
        let selection = Selection::from(axes);
        self.order(Set::Interactions(selection, interactions.to_vec()))
    }
}

impl ImpedanceControl for RemoteControlBoard {
    fn impedance(&self, axis: AxisIndex) -> Outcome<Impedance> {
        self.about(Query::Impedance, axis)?.read(|values| {
            let (stiffness, damping) = pair(values)?;
            Some(Impedance { stiffness, damping })
        })
    }

    fn set_impedance(&self, axis: AxisIndex, impedance: Impedance) -> Outcome<()> {
        Axes::One(axis).check(self.axes)?;
        self.check_finite(axis.into(), "stiffness", &[impedance.stiffness])?;
        self.check_finite(axis.into(), "damping", &[impedance.damping])?;
        self.order(Set::Impedance(axis, impedance))
    }

    fn impedance_offset(&self, axis: AxisIndex) -> Outcome<f64> {
        self.value(Quantity::ImpedanceOffset, axis)
    }

    fn set_impedance_offset(&self, axis: AxisIndex, offset: f64) -> Outcome<()> {
        self.set_value(Setting::ImpedanceOffset, "impedance offset", axis, offset)
    }

    fn impedance_limits(&self, axis: AxisIndex) -> Outcome<ImpedanceLimits> {
        self.about(Query::ImpedanceLimits, axis)?.read(|values| {
            let range = |values| pair(values).map(|(min, max)| Limits::new(min, max));
            Some(ImpedanceLimits {
                stiffness: range(values)?,
                damping: range(values.get(2..)?)?,
            })
        })
    }
}

impl PidControl for RemoteControlBoard {
    /// [`DeviceError::NotSupported`] from 3.x, which has no query for it.
    fn available_pids(&self, axis: AxisIndex) -> Outcome<Vec<PidKind>> {
        self.asking_4("listing control loops")?;
        let kind = |code| kind_of(Vocab32::from_code(code), WireVersion::V4);
        self.about(Query::AvailablePids, axis)?
            .read(|values| codes(values.first()?, kind))
    }

    fn pids(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<Pid>> {
        self.about_each(Query::Pids(kind), axes, |values, selection| {
            each_of(values.first()?, selection, read_gains)
        })
    }

    /// [`DeviceError::NotSupported`] from 3.x, which has no query for it.
    fn pid_info(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<PidInfo>> {
        self.asking_4("asking what gains mean")?;
        self.about_each(Query::PidInfo(kind), axes, |values, selection| {
            each_of(values.first()?, selection, read_pid_info)
        })
    }

    fn set_pids(&self, kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> Outcome<()> {
        axes.check_command(self.axes, "pids", pids.len())?;
        if pids.is_empty() {
            return Ok(());
        }
        let spelling = Query::Pids(kind).spelling();
        let selections = spelling
            .words
            .sayable(axes, self.axes, "set the gains of", false)?;
        for selection in selections {
            self.order(Set::Pids(kind, selection, pids.to_vec()))?;
        }
        Ok(())
    }

    fn pid_values(&self, kind: PidKind, value: PidValue, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.values(Quantity::Pid(kind, value), axes)
    }

    fn set_pid_values(
        &self,
        kind: PidKind,
        value: PidValue,
        axes: Axes<'_>,
        values: &[f64],
    ) -> Outcome<()> {
        self.set(Setting::Pid(kind, value), "values", axes, values)
    }

    fn pids_enabled(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<bool>> {
        self.about_each(Query::PidEnabled(kind), axes, |values, _| {
            Some(vec![read_flag(values.first()?)?])
        })
    }

    fn enable_pids(&self, kind: PidKind, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
        match enabled {
            true => self.act(Action::EnablePids(kind), "close loops of", axes),
            false => self.act(Action::DisablePids(kind), "open loops of", axes),
        }
    }

    fn reset_pids(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<()> {
        self.act(Action::ResetPids(kind), "reset loops of", axes)
    }
}

impl MotorEncoders for RemoteControlBoard {
    /// From the newest state; its time is the board's one time for all joints.
    fn motor_readings(&self, axes: Axes<'_>) -> Outcome<Vec<EncoderReading>> {
        axes.check(self.axes)?;
        self.link()
            .latest
            .read("motor encoder reading", |data, time| {
                let positions = data.motor_positions.of(self.axes)?;
                let speeds = data.motor_velocities.of(self.axes);
                let accelerations = data.motor_accelerations.of(self.axes);
                let known = |values: Option<&[f64]>, motor: usize| {
                    values.map_or(f64::NAN, |values| values[motor])
                };
                let readings = axes.iter(self.axes).map(|axis| EncoderReading {
                    position: positions[axis.index()],
                    speed: known(speeds, axis.index()),
                    acceleration: known(accelerations, axis.index()),
                    time,
                });
                Some(readings.collect())
            })
    }

    fn set_motor_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Outcome<()> {
        self.set(Setting::MotorEncoder, "motor positions", axes, positions)
    }

    fn reset_motor_encoders(&self, axes: Axes<'_>) -> Outcome<()> {
        self.act(
            Action::ResetMotorEncoders,
            "reset the motor encoders of",
            axes,
        )
    }

    fn counts_per_revolution(&self, axis: AxisIndex) -> Outcome<f64> {
        self.value(Quantity::MotorCounts, axis)
    }

    fn set_counts_per_revolution(&self, axis: AxisIndex, counts: f64) -> Outcome<()> {
        self.set_value(Setting::MotorCounts, "counts per revolution", axis, counts)
    }
}

impl Motor for RemoteControlBoard {
    fn temperatures(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.values(Quantity::Temperature, axes)
    }

    fn temperature_limit(&self, axis: AxisIndex) -> Outcome<f64> {
        self.value(Quantity::TemperatureLimit, axis)
    }

    fn set_temperature_limit(&self, axis: AxisIndex, limit: f64) -> Outcome<()> {
        self.set_value(Setting::TemperatureLimit, "temperature limit", axis, limit)
    }

    fn gearbox_ratio(&self, axis: AxisIndex) -> Outcome<f64> {
        self.value(Quantity::GearboxRatio, axis)
    }

    fn set_gearbox_ratio(&self, axis: AxisIndex, ratio: f64) -> Outcome<()> {
        self.set_value(Setting::GearboxRatio, "gearbox ratio", axis, ratio)
    }
}

impl AmplifierControl for RemoteControlBoard {
    fn enable_amplifiers(&self, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
        match enabled {
            true => self.act(Action::EnableAmplifiers, "switch on", axes),
            false => self.act(Action::DisableAmplifiers, "switch off", axes),
        }
    }

    fn amplifier_status(&self, axes: Axes<'_>) -> Outcome<Vec<i32>> {
        let total = self.axes;
        self.about_each(Query::AmplifierStatus, axes, |values, selection| {
            let status = numbers(values.first()?, selection, total)?;
            Some(status.into_iter().map(|code| code as i32).collect())
        })
    }

    fn amplifier_limit(&self, limit: AmplifierLimit, axis: AxisIndex) -> Outcome<f64> {
        self.value(Quantity::Amplifier(limit), axis)
    }

    fn set_amplifier_limit(
        &self,
        limit: AmplifierLimit,
        axis: AxisIndex,
        value: f64,
    ) -> Outcome<()> {
        self.set_value(Setting::Amplifier(limit), "amplifier limit", axis, value)
    }

    fn amplifier_duty_cycle(&self, axis: AxisIndex) -> Outcome<f64> {
        self.value(Quantity::AmplifierDutyCycle, axis)
    }

    fn supply_voltage(&self, axis: AxisIndex) -> Outcome<f64> {
        self.value(Quantity::SupplyVoltage, axis)
    }
}

impl ControlCalibration for RemoteControlBoard {
    fn calibrate_axis(&self, axis: AxisIndex, method: u32, parameters: [f64; 3]) -> Outcome<()> {
        Axes::One(axis).check(self.axes)?;
        for number in parameters {
            self.check_finite(axis.into(), "calibration parameter", &[number])?;
        }
        self.order(Set::CalibrateAxis(axis, method, parameters))
    }

    /// 3.x has messages for four parameters and no zero: if any other is not 0 the call fails with
    /// [`DeviceError::NotSupported`].
    fn set_calibration_parameters(
        &self,
        axis: AxisIndex,
        calibration: CalibrationParameters,
    ) -> Outcome<()> {
        Axes::One(axis).check(self.axes)?;
        for number in calibration.parameters.into_iter().chain([calibration.zero]) {
            self.check_finite(axis.into(), "calibration parameter", &[number])?;
        }
        self.order(Set::CalibrationParameters(axis, calibration))
    }

    fn calibration_done(&self, axis: AxisIndex) -> Outcome<bool> {
        self.about(Query::CalibrationDone, axis)?
            .read(|values| read_flag(values.first()?))
    }

    fn calibrate_robot(&self) -> Outcome<()> {
        self.board(Action::CalibrateRobot)
    }

    /// Waits here, by asking: a board that waits would not answer for so long.
    fn park_robot(&self, wait: bool) -> Outcome<()> {
        self.board(Action::ParkRobot)?;
        let deadline = Instant::now() + HOMING_TIMEOUT;
        while wait && !self.motion_done(Axes::All)? && Instant::now() < deadline {
            std::thread::sleep(POLL_INTERVAL);
        }
        Ok(())
    }

    fn abort_calibration(&self) -> Outcome<()> {
        self.board(Action::AbortCalibration)
    }

    fn abort_park(&self) -> Outcome<()> {
        self.board(Action::AbortPark)
    }
}

impl RemoteCalibrator for RemoteControlBoard {
    fn calibrator_present(&self) -> Outcome<bool> {
        self.ask(Get::About(Query::CalibratorPresent, Selection::All))?
            .read(|values| read_flag(values.first()?))
    }

    fn calibrate(&self, axes: Axes<'_>) -> Outcome<()> {
        self.act(Action::Calibrate, "calibrate", axes)
    }

    fn home(&self, axes: Axes<'_>) -> Outcome<()> {
        self.act(Action::Home, "send home", axes)
    }

    fn park(&self, axes: Axes<'_>) -> Outcome<()> {
        self.act(Action::Park, "park", axes)
    }

    fn quit_calibration(&self) -> Outcome<()> {
        self.board(Action::QuitCalibration)
    }

    fn quit_park(&self) -> Outcome<()> {
        self.board(Action::QuitPark)
    }
}

impl RemoteVariables for RemoteControlBoard {
    fn variables(&self) -> Outcome<Vec<String>> {
        self.ask(Get::About(Query::Variables, Selection::All))?
            .read(|values| {
                let mut list = values.first()?.as_list()?;
                // 4.0 puts the list into a list.
                if let Some(inner) = list.get(0).and_then(Value::as_list) {
                    list = inner;
                }
                Some(list.iter().map(Value::to_plain_string).collect())
            })
    }

    fn variable(&self, name: &str) -> Outcome<Vec<VariableValue>> {
        self.ask(Get::Variable(name.to_owned()))?
            .read(|values| read_variable(values.first()?.as_list()?.as_slice()))
    }

    fn set_variable(&self, name: &str, value: &[VariableValue]) -> Outcome<()> {
        self.order(Set::Variable(name.to_owned(), value.to_vec()))
    }
}

impl JointFault for RemoteControlBoard {
    fn last_fault(&self, axis: AxisIndex) -> Outcome<Fault> {
        self.about(Query::Fault, axis)?.read(|values| {
            let [code, message, ..] = values else {
                return None;
            };
            Some(Fault {
                code: code.as_i32()?,
                message: message.to_plain_string(),
            })
        })
    }
}

impl JointBrake for RemoteControlBoard {
    fn is_braked(&self, axis: AxisIndex) -> Outcome<bool> {
        self.about(Query::Braked, axis)?
            .read(|values| read_flag(values.first()?))
    }

    fn set_manual_brake(&self, axis: AxisIndex, active: bool) -> Outcome<()> {
        Axes::One(axis).check(self.axes)?;
        self.order(Set::ManualBrake(axis, active))
    }

    fn auto_brake(&self, axis: AxisIndex) -> Outcome<bool> {
        self.about(Query::AutoBrake, axis)?
            .read(|values| read_flag(values.first()?))
    }

    fn set_auto_brake(&self, axis: AxisIndex, enabled: bool) -> Outcome<()> {
        Axes::One(axis).check(self.axes)?;
        self.order(Set::AutoBrake(axis, enabled))
    }
}

impl RemoteControlBoard {
    fn value(&self, quantity: Quantity, axis: AxisIndex) -> Outcome<f64> {
        let values = self.values(quantity, axis.into())?;
        Ok(values.into_iter().next().unwrap_or(f64::NAN))
    }

    fn set_value(
        &self,
        setting: Setting,
        what: &'static str,
        axis: AxisIndex,
        value: f64,
    ) -> Outcome<()> {
        self.set(setting, what, axis.into(), &[value])
    }

    fn ranges(&self, range: Range, axes: Axes<'_>) -> Outcome<Vec<Limits>> {
        let total = self.axes;
        self.about_each(Query::Range(range), axes, |values, selection| {
            let [smallest, largest, ..] = values else {
                return None;
            };
            let smallest = numbers(smallest, selection, total)?.into_iter();
            let largest = numbers(largest, selection, total)?;
            let pairs = smallest.zip(largest);
            Some(pairs.map(|(min, max)| Limits::new(min, max)).collect())
        })
    }

    /// Orders something of the board as a whole.
    fn board(&self, action: Action) -> Outcome<()> {
        self.order(Set::Act(action, Selection::All))
    }
}

/// Encodes the values of a selection: one by itself, several in a list.
fn each_of<T>(
    answer: &Value,
    selection: &Selection,
    read: impl Fn(&Value) -> Option<T>,
) -> Option<Vec<T>> {
    match selection {
        Selection::One(_) => Some(vec![read(answer)?]),
        _ => answer.as_list()?.iter().map(read).collect(),
    }
}
