//! The calls of the interfaces of motors and forces, and of further interfaces.
//!
//! Each is as the method of the same name in [`iface`](crate::iface).
#![allow(missing_docs, reason = "documented where the interfaces are")]

use super::AxesModel;
use super::axis_motor::{
    COUNTS, GEARBOX_RATIO_RANGE, IMPEDANCE_LIMITS, Loop, ROOM_TEMPERATURE, SUPPLY_VOLTAGE,
};
use super::simulated_axis::Axis;
use crate::{
    AmplifierLimit, Axes, AxisIndex, CalibrationParameters, DeviceError, EncoderReading, Fault,
    Impedance, ImpedanceLimits, Interaction, Limits, Mode, MotorTorqueParameters, Pid, PidInfo,
    PidKind, PidUnits, PidValue, VariableValue,
};

/// Pulls down what moves: per second, one for each axis.
const FRICTION: &str = "friction";
/// Description of the device, in words.
const DESCRIPTION: &str = "description";
/// Range of friction, per second.
const FRICTION_RANGE: Limits = Limits::new(0.01, 1e3);

/// Maximum number of parts of the value of a stored variable, those of lists included.
const MAX_STORED_PARTS: usize = 1000;

type Outcome<T> = Result<T, DeviceError>;

impl AxesModel {
    pub fn set_direct_positions(&mut self, axes: Axes<'_>, positions: &[f64]) -> Outcome<()> {
        self.command(
            axes,
            "positions",
            positions,
            Axis::check_direct_position,
            Axis::direct_position,
        )
    }

    pub fn direct_positions(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.of(axes, Axis::target)
    }

    pub fn set_direct_velocities(&mut self, axes: Axes<'_>, velocities: &[f64]) -> Outcome<()> {
        self.command(
            axes,
            "velocities",
            velocities,
            Axis::check_direct_velocity,
            Axis::direct_velocity,
        )
    }

    pub fn direct_velocities(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.of(axes, Axis::velocity)
    }

    pub fn set_reference_torques(&mut self, axes: Axes<'_>, torques: &[f64]) -> Outcome<()> {
        self.push(Mode::Torque, "torques", axes, torques)
    }

    pub fn reference_torques(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.of(axes, |axis| axis.effort(Mode::Torque))
    }

    pub fn torques(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.of(axes, Axis::torque)
    }

    /// Same as [`VirtualSensor::set_virtual_measures`](crate::VirtualSensor::set_virtual_measures).
    pub fn set_virtual_measures(&mut self, values: &[f64]) -> Outcome<()> {
        let total = self.axes();
        if values.len() > total {
            return Err(DeviceError::WrongCount {
                what: "measured torques",
                expected: total,
                got: values.len(),
            });
        }
        for (number, value) in values.iter().enumerate() {
            self.axis(number.into())?
                .check_finite("measured torque", *value)?;
        }
        for (number, value) in values.iter().enumerate() {
            self.axis_mut(number.into())?.set_virtual_torque(*value);
        }
        Ok(())
    }

    pub fn torque_ranges(&self, axes: Axes<'_>) -> Outcome<Vec<Limits>> {
        self.of(axes, |axis| symmetric(axis.largest_torque()))
    }

    pub fn motor_torque_parameters(&self, axis: AxisIndex) -> Outcome<MotorTorqueParameters> {
        Ok(self.axis(axis)?.motor().torque_parameters)
    }

    pub fn set_motor_torque_parameters(
        &mut self,
        axis: AxisIndex,
        parameters: MotorTorqueParameters,
    ) -> Outcome<()> {
        let axis = self.axis_mut(axis)?;
        for number in parameters.to_array() {
            axis.check_finite("motor torque parameter", number)?;
        }
        axis.motor_mut().torque_parameters = parameters;
        Ok(())
    }

    pub fn set_reference_currents(&mut self, axes: Axes<'_>, currents: &[f64]) -> Outcome<()> {
        self.push(Mode::Current, "currents", axes, currents)
    }

    pub fn reference_currents(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.of(axes, |axis| axis.effort(Mode::Current))
    }

    pub fn currents(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.of(axes, Axis::current)
    }

    pub fn current_ranges(&self, axes: Axes<'_>) -> Outcome<Vec<Limits>> {
        self.of(axes, |axis| symmetric(axis.largest_current()))
    }

    pub fn set_reference_duty_cycles(&mut self, axes: Axes<'_>, percent: &[f64]) -> Outcome<()> {
        self.push(Mode::Pwm, "duty cycles", axes, percent)
    }

    pub fn reference_duty_cycles(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.of(axes, |axis| axis.effort(Mode::Pwm))
    }

    pub fn duty_cycles(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.of(axes, Axis::duty_cycle)
    }

    pub fn interactions(&self, axes: Axes<'_>) -> Outcome<Vec<Interaction>> {
        self.of(axes, |axis| axis.motor().interaction)
    }

    pub fn set_interactions(&mut self, axes: Axes<'_>, asked: &[Interaction]) -> Outcome<()> {
        let known = |_: &Axis, interaction| match interaction {
            Interaction::Unknown(_) => Err(DeviceError::NotSupported {
                what: "an interaction mode that is neither stiff nor compliant".to_owned(),
            }),
            _ => Ok(()),
        };
        self.command(
            axes,
            "interaction modes",
            asked,
            known,
            |axis, interaction| {
                axis.motor_mut().interaction = interaction;
            },
        )
    }

    pub fn impedance(&self, axis: AxisIndex) -> Outcome<Impedance> {
        Ok(self.axis(axis)?.motor().impedance)
    }

    pub fn set_impedance(&mut self, axis: AxisIndex, asked: Impedance) -> Outcome<()> {
        let axis = self.axis_mut(axis)?;
        let Impedance { stiffness, damping } = asked;
        axis.check_allowed("stiffness", stiffness, IMPEDANCE_LIMITS.stiffness, "Nm/deg")?;
        axis.check_allowed("damping", damping, IMPEDANCE_LIMITS.damping, "Nm s/deg")?;
        axis.motor_mut().impedance = asked;
        Ok(())
    }

    pub fn impedance_offset(&self, axis: AxisIndex) -> Outcome<f64> {
        Ok(self.axis(axis)?.motor().impedance_offset)
    }

    pub fn set_impedance_offset(&mut self, axis: AxisIndex, offset: f64) -> Outcome<()> {
        let axis = self.axis_mut(axis)?;
        let allowed = symmetric(axis.largest_torque());
        axis.check_allowed("impedance offset", offset, allowed, "Nm")?;
        axis.motor_mut().impedance_offset = offset;
        Ok(())
    }

    pub fn impedance_limits(&self, axis: AxisIndex) -> Outcome<ImpedanceLimits> {
        self.axis(axis).map(|_| IMPEDANCE_LIMITS)
    }

    pub fn available_pids(&self, axis: AxisIndex) -> Outcome<Vec<PidKind>> {
        self.axis(axis).map(|_| PIDS.to_vec())
    }

    pub fn pids(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<Pid>> {
        let place = place(kind)?;
        self.of(axes, |axis| axis.motor().loops[place].pid)
    }

    pub fn pid_info(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<PidInfo>> {
        place(kind)?;
        self.of(axes, |axis| {
            let (quantity, unit) = match kind {
                PidKind::Position => ("position", axis.unit("")),
                PidKind::Velocity => ("velocity", axis.unit("/s")),
                PidKind::Torque => ("torque", axis.torque_unit()),
                _ => ("current", "A"),
            };
            PidInfo {
                description: format!(
                    "simulated loop of {quantity}: its gains do not move the joint"
                ),
                input: format!("{quantity}, {unit}"),
                output: "duty cycle, %".to_owned(),
                units: PidUnits {
                    offset: "%".to_owned(),
                    stiction_up: "%".to_owned(),
                    stiction_down: "%".to_owned(),
                    kff: "%".to_owned(),
                    ..PidUnits::plain(unit, "%")
                },
            }
        })
    }

    pub fn set_pids(&mut self, kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> Outcome<()> {
        let place = place(kind)?;
        let check = |axis: &Axis, pid: Pid| {
            let numbers = [
                pid.kp,
                pid.kd,
                pid.ki,
                pid.max_integral,
                pid.scale,
                pid.max_output,
                pid.offset,
                pid.stiction_up,
                pid.stiction_down,
                pid.kff,
            ];
            numbers
                .into_iter()
                .try_for_each(|number| axis.check_finite("gain", number))
        };
        self.command(axes, "pids", pids, check, |axis, pid| {
            axis.motor_mut().loops[place].pid = pid;
        })
    }

    pub fn pid_values(&self, kind: PidKind, value: PidValue, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        let place = place(kind)?;
        self.of(axes, |axis| {
            let one = &axis.motor().loops[place];
            let (steered, measured) = steering(axis, kind);
            let reference = one.reference.unwrap_or(steered);
            let error = reference - measured;
            match value {
                PidValue::Reference => reference,
                PidValue::ErrorLimit => one.error_limit,
                PidValue::Error => error,
                PidValue::Output => {
                    let output = one.pid.kp * error + one.pid.offset + one.feedforward;
                    symmetric(one.pid.max_output.abs()).clamp(output)
                }
                PidValue::Offset => one.pid.offset,
                PidValue::Feedforward => one.feedforward,
            }
        })
    }

    pub fn set_pid_values(
        &mut self,
        kind: PidKind,
        value: PidValue,
        axes: Axes<'_>,
        values: &[f64],
    ) -> Outcome<()> {
        let place = place(kind)?;
        if matches!(value, PidValue::Error | PidValue::Output) {
            return Err(DeviceError::NotSupported {
                what: "setting the error or the output of a control loop".to_owned(),
            });
        }
        let check = |axis: &Axis, number| axis.check_finite("value of a control loop", number);
        self.command(axes, "values", values, check, |axis, number| {
            let one = &mut axis.motor_mut().loops[place];
            match value {
                PidValue::Reference => one.reference = Some(number),
                PidValue::ErrorLimit => one.error_limit = number,
                PidValue::Offset => one.pid.offset = number,
                _ => one.feedforward = number,
            }
        })
    }

    pub fn pids_enabled(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<bool>> {
        let place = place(kind)?;
        self.of(axes, |axis| axis.motor().loops[place].enabled)
    }

    pub fn enable_pids(&mut self, kind: PidKind, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
        self.each_loop(kind, axes, |one| one.enabled = enabled)
    }

    pub fn reset_pids(&mut self, kind: PidKind, axes: Axes<'_>) -> Outcome<()> {
        self.each_loop(kind, axes, |one| one.reference = None)
    }

    pub fn motor_readings(&self, axes: Axes<'_>) -> Outcome<Vec<EncoderReading>> {
        self.of(axes, |axis| {
            let (state, motor) = (axis.state(), axis.motor());
            EncoderReading {
                position: state.position * motor.gearbox_ratio + motor.offset,
                speed: state.velocity * motor.gearbox_ratio,
                acceleration: state.acceleration * motor.gearbox_ratio,
                time: 0.0,
            }
        })
    }

    pub fn set_motor_encoders(&mut self, axes: Axes<'_>, positions: &[f64]) -> Outcome<()> {
        let check = |axis: &Axis, position| axis.check_finite("motor position", position);
        self.command(
            axes,
            "motor positions",
            positions,
            check,
            |axis, position| {
                let joint = axis.state().position;
                let motor = axis.motor_mut();
                motor.offset = position - joint * motor.gearbox_ratio;
            },
        )
    }

    pub fn counts_per_revolution(&self, axis: AxisIndex) -> Outcome<f64> {
        Ok(self.axis(axis)?.motor().counts)
    }

    pub fn set_counts_per_revolution(&mut self, axis: AxisIndex, counts: f64) -> Outcome<()> {
        let axis = self.axis_mut(axis)?;
        axis.check_allowed("counts per revolution", counts, COUNTS, "counts")?;
        axis.motor_mut().counts = counts;
        Ok(())
    }

    pub fn temperatures(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.of(axes, |_| ROOM_TEMPERATURE)
    }

    pub fn temperature_limit(&self, axis: AxisIndex) -> Outcome<f64> {
        Ok(self.axis(axis)?.motor().temperature_limit)
    }

    pub fn set_temperature_limit(&mut self, axis: AxisIndex, limit: f64) -> Outcome<()> {
        let axis = self.axis_mut(axis)?;
        axis.check_finite("temperature limit", limit)?;
        axis.motor_mut().temperature_limit = limit;
        Ok(())
    }

    pub fn gearbox_ratio(&self, axis: AxisIndex) -> Outcome<f64> {
        Ok(self.axis(axis)?.motor().gearbox_ratio)
    }

    pub fn set_gearbox_ratio(&mut self, axis: AxisIndex, ratio: f64) -> Outcome<()> {
        let axis = self.axis_mut(axis)?;
        axis.check_allowed("gearbox ratio", ratio, GEARBOX_RATIO_RANGE, "turns")?;
        axis.motor_mut().gearbox_ratio = ratio;
        Ok(())
    }

    pub fn enable_amplifiers(&mut self, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
        self.each(axes, |axis| axis.set_amplifier(enabled))
    }

    pub fn amplifier_status(&self, axes: Axes<'_>) -> Outcome<Vec<i32>> {
        self.of(axes, |axis| i32::from(axis.motor().amplifier_on))
    }

    pub fn amplifier_limit(&self, limit: AmplifierLimit, axis: AxisIndex) -> Outcome<f64> {
        Ok(self.axis(axis)?.motor().amplifier_limits[limit as usize])
    }

    pub fn set_amplifier_limit(
        &mut self,
        limit: AmplifierLimit,
        axis: AxisIndex,
        value: f64,
    ) -> Outcome<()> {
        let axis = self.axis_mut(axis)?;
        let (largest, unit) = match limit {
            AmplifierLimit::DutyCycle => (100.0, "%"),
            _ => (axis.largest_current(), "A"),
        };
        let allowed = Limits::new(0.0, largest);
        axis.check_allowed("amplifier limit", value, allowed, unit)?;
        axis.motor_mut().amplifier_limits[limit as usize] = value;
        Ok(())
    }

    pub fn amplifier_duty_cycle(&self, axis: AxisIndex) -> Outcome<f64> {
        Ok(self.axis(axis)?.duty_cycle())
    }

    pub fn supply_voltage(&self, axis: AxisIndex) -> Outcome<f64> {
        self.axis(axis).map(|_| SUPPLY_VOLTAGE)
    }

    /// The encoders are exact, so a calibration only checks that the joint is at rest.
    pub fn calibrate(&mut self, axes: Axes<'_>) -> Outcome<()> {
        for axis in self.selected(axes)? {
            axis.check_at_rest("calibrate it")?;
        }
        Ok(())
    }

    pub fn calibrate_axis(
        &mut self,
        axis: AxisIndex,
        method: u32,
        parameters: [f64; 3],
    ) -> Outcome<()> {
        let [first, second, third] = parameters;
        let calibration = CalibrationParameters {
            method,
            parameters: [first, second, third, 0.0, 0.0],
            zero: 0.0,
        };
        self.calibrate(axis.into())?;
        self.set_calibration_parameters(axis, calibration)
    }

    pub fn set_calibration_parameters(
        &mut self,
        axis: AxisIndex,
        calibration: CalibrationParameters,
    ) -> Outcome<()> {
        let axis = self.axis_mut(axis)?;
        for number in calibration.parameters.into_iter().chain([calibration.zero]) {
            axis.check_finite("calibration parameter", number)?;
        }
        axis.motor_mut().calibration = calibration;
        Ok(())
    }

    pub fn calibration_done(&self, axis: AxisIndex) -> Outcome<bool> {
        self.axis(axis).map(|_| true)
    }

    /// Sends joints to their home positions, which is also where they are parked.
    pub fn home(&mut self, axes: Axes<'_>) -> Outcome<()> {
        let homes = self.of(axes, |axis| axis.built().home)?;
        self.position_move(axes, &homes)
    }

    pub fn last_fault(&self, axis: AxisIndex) -> Outcome<Fault> {
        self.axis(axis).map(|_| Fault {
            code: 0,
            message: "no fault".to_owned(),
        })
    }

    pub fn is_braked(&self, axis: AxisIndex) -> Outcome<bool> {
        Ok(self.axis(axis)?.is_braked())
    }

    pub fn set_manual_brake(&mut self, axis: AxisIndex, active: bool) -> Outcome<()> {
        self.axis_mut(axis)?.set_manual_brake(active);
        Ok(())
    }

    pub fn auto_brake(&self, axis: AxisIndex) -> Outcome<bool> {
        Ok(self.axis(axis)?.motor().auto_brake)
    }

    pub fn set_auto_brake(&mut self, axis: AxisIndex, enabled: bool) -> Outcome<()> {
        self.axis_mut(axis)?.motor_mut().auto_brake = enabled;
        Ok(())
    }

    /// Adds variables that can be read and set, empty at first. They do not change how the axes move.
    pub fn store_variables(&mut self, names: impl IntoIterator<Item = String>) {
        let names = names.into_iter().map(|name| (name, Vec::new()));
        self.stored.extend(names);
    }

    pub fn variables(&self) -> Outcome<Vec<String>> {
        let mut names = [DESCRIPTION, FRICTION].map(str::to_owned).to_vec();
        names.extend(self.stored.iter().map(|(name, _)| name.clone()));
        Ok(names)
    }

    pub fn variable(&self, name: &str) -> Outcome<Vec<VariableValue>> {
        match name {
            DESCRIPTION => Ok(vec![VariableValue::Text("simulated axes".to_owned())]),
            FRICTION => self.of(Axes::All, |axis| VariableValue::Number(axis.friction())),
            _ => match self.stored.iter().find(|(stored, _)| stored == name) {
                Some((_, value)) => Ok(value.clone()),
                None => Err(no_variable(name)),
            },
        }
    }

    pub fn set_variable(&mut self, name: &str, value: &[VariableValue]) -> Outcome<()> {
        if name == FRICTION {
            return self.set_frictions(value);
        }
        let stored = self.stored.iter_mut().find(|(stored, _)| stored == name);
        let (_, stored) = stored.ok_or_else(|| no_variable(name))?;
        let parts = count(value);
        if parts > MAX_STORED_PARTS {
            return Err(DeviceError::Unsuitable {
                what: "the value of a variable",
                asked: format!("{parts} parts"),
                expected: format!("at most {MAX_STORED_PARTS}"),
            });
        }
        *stored = value.to_vec();
        Ok(())
    }

    fn set_frictions(&mut self, value: &[VariableValue]) -> Outcome<()> {
        let numbers: Vec<f64> = value.iter().filter_map(VariableValue::as_number).collect();
        if numbers.len() != value.len() {
            return Err(DeviceError::NotSupported {
                what: format!("a `{FRICTION}` that is no number"),
            });
        }
        let check =
            |axis: &Axis, friction| axis.check_allowed(FRICTION, friction, FRICTION_RANGE, "1/s");
        self.command(Axes::All, "frictions", &numbers, check, Axis::set_friction)
    }

    fn of<T>(&self, axes: Axes<'_>, read: impl Fn(&Axis) -> T) -> Outcome<Vec<T>> {
        Ok(self.selected(axes)?.map(read).collect())
    }

    fn each(&mut self, axes: Axes<'_>, act: impl Fn(&mut Axis)) -> Outcome<()> {
        axes.check(self.axes())?;
        for axis in axes.iter(self.axes()) {
            act(self.axis_mut(axis)?);
        }
        Ok(())
    }

    fn each_loop(&mut self, kind: PidKind, axes: Axes<'_>, act: impl Fn(&mut Loop)) -> Outcome<()> {
        let place = place(kind)?;
        self.each(axes, |axis| act(&mut axis.motor_mut().loops[place]))
    }

    fn push(
        &mut self,
        mode: Mode,
        what: &'static str,
        axes: Axes<'_>,
        efforts: &[f64],
    ) -> Outcome<()> {
        self.command(
            axes,
            what,
            efforts,
            |axis, effort| axis.check_effort(mode, effort),
            |axis, effort| axis.set_effort(mode, effort),
        )
    }
}

const PIDS: [PidKind; 4] = [
    PidKind::Position,
    PidKind::Velocity,
    PidKind::Torque,
    PidKind::Current,
];

fn place(kind: PidKind) -> Outcome<usize> {
    let place = PIDS.iter().position(|known| *known == kind);
    place.ok_or_else(|| DeviceError::NotSupported {
        what: "a control loop of this kind".to_owned(),
    })
}

/// Returns the reference and the measurement of a loop.
fn steering(axis: &Axis, kind: PidKind) -> (f64, f64) {
    let state = axis.state();
    match kind {
        PidKind::Position => (axis.target(), state.position),
        PidKind::Velocity => (axis.velocity(), state.velocity),
        PidKind::Torque => (axis.effort(Mode::Torque), axis.torque()),
        _ => (axis.effort(Mode::Current), axis.current()),
    }
}

fn symmetric(largest: f64) -> Limits {
    Limits::new(-largest, largest)
}

fn count(value: &[VariableValue]) -> usize {
    let parts = value.iter().map(|part| match part {
        VariableValue::List(parts) => 1 + count(parts),
        _ => 1,
    });
    parts.sum()
}

fn no_variable(name: &str) -> DeviceError {
    DeviceError::NotSupported {
        what: format!("setting or asking for a variable `{name}`"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shoulder() -> AxesModel {
        AxesModel::new(crate::wam::parameters().into_iter().take(1))
    }

    #[test]
    fn the_output_of_a_loop_is_within_its_largest() {
        let mut model = shoulder();
        for (offset, output) in [(250.0, 100.0), (-250.0, -100.0), (50.0, 50.0)] {
            let pid = Pid {
                offset,
                ..model.pids(PidKind::Position, Axes::All).unwrap()[0]
            };
            assert_eq!(pid.max_output, 100.0);
            model
                .set_pids(PidKind::Position, Axes::All, &[pid])
                .unwrap();
            let found = model.pid_values(PidKind::Position, PidValue::Output, Axes::All);
            assert_eq!(found.unwrap(), [output]);
        }
    }

    #[test]
    fn frictions_have_a_range() {
        let mut model = shoulder();
        for (asked, fits) in [(0.01, true), (0.009, false), (1e3, true), (1001.0, false)] {
            let taken = model.set_variable(FRICTION, &[VariableValue::Number(asked)]);
            assert_eq!(taken.is_ok(), fits, "{asked}");
        }
    }

    #[test]
    fn an_amplifier_gives_half_its_largest_current_for_ever() {
        let model = shoulder();
        let limit = |limit| model.amplifier_limit(limit, 0.into()).unwrap();
        let most = model.current_ranges(Axes::All).unwrap()[0].max;
        assert_eq!(limit(AmplifierLimit::MaxCurrent), most);
        assert_eq!(limit(AmplifierLimit::PeakCurrent), most);
        assert_eq!(limit(AmplifierLimit::NominalCurrent), most / 2.0);
        assert_eq!(limit(AmplifierLimit::DutyCycle), 100.0);
    }

    #[test]
    fn stored_variables_keep_their_values() {
        let mut model = AxesModel::new([]);
        let text = |text: &str| VariableValue::Text(text.to_owned());
        assert!(model.set_variable("all", &[text("a")]).is_err());
        model.store_variables(["all", "mode"].map(str::to_owned));
        assert_eq!(model.variables().unwrap()[2..], ["all", "mode"]);
        assert_eq!(model.variable("all").unwrap(), []);
        let value = vec![VariableValue::List(vec![
            text("mode"),
            VariableValue::Integer(3),
        ])];
        model.set_variable("all", &value).unwrap();
        assert_eq!(model.variable("all").unwrap(), value);
        assert_eq!(model.variable("mode").unwrap(), []);
        assert!(model.set_variable("description", &[text("a")]).is_err());
        assert!(model.variable("other").is_err());
    }

    #[test]
    fn stored_values_are_bounded() {
        let mut model = AxesModel::new([]);
        model.store_variables(["all".to_owned()]);
        let list = |length| vec![VariableValue::List(vec![VariableValue::Integer(1); length])];
        let largest = list(MAX_STORED_PARTS - 1);
        model.set_variable("all", &largest).unwrap();
        assert!(model.set_variable("all", &list(MAX_STORED_PARTS)).is_err());
        assert_eq!(model.variable("all").unwrap(), largest);
    }
}
