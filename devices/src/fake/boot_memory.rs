//! Settings of simulated axes that survive their being off.

use super::AxesModel;
use super::simulated_axis::{Axis, AxisSettings};
use crate::{DeviceError, VariableValue};

/// Settings of all axes and values of the stored variables, as saved last; those by construction at first.
#[derive(Clone, Debug)]
pub(super) struct BootMemory {
    axes: Vec<AxisSettings>,
    stored: Vec<(String, Vec<VariableValue>)>,
}

impl BootMemory {
    pub(super) fn of(axes: &[Axis], stored: &[(String, Vec<VariableValue>)]) -> Self {
        Self {
            axes: axes.iter().map(Axis::settings).collect(),
            stored: stored.to_vec(),
        }
    }
}

impl AxesModel {
    /// Same as [`ControlDebug::save_boot_memory`](crate::ControlDebug::save_boot_memory).
    pub fn save_boot_memory(&mut self) -> Result<(), DeviceError> {
        self.boot_memory = BootMemory::of(&self.axes, &self.stored);
        Ok(())
    }

    /// Same as [`ControlDebug::load_boot_memory`](crate::ControlDebug::load_boot_memory). A variable that had not been saved becomes empty.
    pub fn load_boot_memory(&mut self) -> Result<(), DeviceError> {
        let memory = &self.boot_memory;
        for (axis, settings) in self.axes.iter().zip(&memory.axes) {
            axis.check_settings(settings)?;
        }
        for (axis, settings) in self.axes.iter_mut().zip(&memory.axes) {
            axis.apply_settings(settings);
        }
        for (name, value) in &mut self.stored {
            let saved = memory.stored.iter().find(|(saved, _)| saved == name);
            *value = saved.map(|(_, value)| value.clone()).unwrap_or_default();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::fake::AxisParameters;
    use crate::{AmplifierLimit, Axes, JointType, Limits, Mode, Pid, PidKind};

    const ALL: Axes<'static> = Axes::All;

    fn model() -> AxesModel {
        let axis = |name: &str| AxisParameters {
            name: name.to_owned(),
            joint_type: JointType::Revolute,
            limits: Limits::new(-100.0, 100.0),
            max_speed: 100.0,
            max_acceleration: 200.0,
            reference_speed: 20.0,
            reference_acceleration: 40.0,
            home: 0.0,
        };
        let mut model = AxesModel::new([axis("a"), axis("b")]);
        model.store_variables(["gain".to_owned()]);
        model
    }

    /// Changes every kind of setting of both axes; `number` is 1 to 9.
    fn set(model: &mut AxesModel, number: f64) {
        for axis in 0..2 {
            let axis = axis.into();
            model
                .set_position_limits(axis, Limits::new(-number * 10.0, number * 10.0))
                .unwrap();
            model
                .set_velocity_limits(axis, Limits::new(0.0, 50.0 + number))
                .unwrap();
            model.set_temperature_limit(axis, number).unwrap();
            model
                .set_amplifier_limit(AmplifierLimit::DutyCycle, axis, number)
                .unwrap();
            model.set_auto_brake(axis, number > 1.0).unwrap();
        }
        model.set_reference_speeds(ALL, &[number; 2]).unwrap();
        model
            .set_reference_accelerations(ALL, &[number; 2])
            .unwrap();
        let gains = Pid {
            kp: number,
            ..Pid::default()
        };
        model.set_pids(PidKind::Position, ALL, &[gains; 2]).unwrap();
        model
            .set_variable("gain", &[VariableValue::Number(number)])
            .unwrap();
        let friction = [VariableValue::Number(number), VariableValue::Number(number)];
        model.set_variable("friction", &friction).unwrap();
    }

    fn settings(model: &AxesModel) -> Vec<f64> {
        let mut all = Vec::new();
        for axis in 0..2 {
            let axis = axis.into();
            all.push(model.position_limits(axis).unwrap().max);
            all.push(model.velocity_limits(axis).unwrap().max);
            all.push(model.temperature_limit(axis).unwrap());
            all.push(
                model
                    .amplifier_limit(AmplifierLimit::DutyCycle, axis)
                    .unwrap(),
            );
            all.push(f64::from(u8::from(model.auto_brake(axis).unwrap())));
        }
        all.extend(model.reference_speeds(ALL).unwrap());
        all.extend(model.reference_accelerations(ALL).unwrap());
        all.extend(
            model
                .pids(PidKind::Position, ALL)
                .unwrap()
                .iter()
                .map(|pid| pid.kp),
        );
        for name in ["gain", "friction"] {
            let value = model.variable(name).unwrap();
            all.push(value.iter().filter_map(VariableValue::as_number).sum());
        }
        all
    }

    #[test]
    fn saved_settings_come_back_and_those_by_construction_without() {
        let mut model = model();
        let built = settings(&model);
        set(&mut model, 3.0);
        let saved = settings(&model);
        assert!(saved.iter().zip(&built).all(|(new, old)| new != old));
        model.load_boot_memory().unwrap();
        assert_eq!(settings(&model), built, "nothing was saved");
        set(&mut model, 3.0);
        model.save_boot_memory().unwrap();
        set(&mut model, 1.0);
        assert!(
            settings(&model)
                .iter()
                .zip(&saved)
                .all(|(new, old)| new != old)
        );
        model.load_boot_memory().unwrap();
        assert_eq!(settings(&model), saved);
    }

    #[test]
    fn the_present_motion_is_no_setting() {
        let mut model = model();
        model.set_encoders(ALL, &[5.0, 6.0]).unwrap();
        model.set_motor_encoders(ALL, &[7.0, 8.0]).unwrap();
        model.set_control_modes(ALL, &[Mode::Velocity; 2]).unwrap();
        model.enable_amplifiers(Axes::One(1.into()), false).unwrap();
        model.set_manual_brake(0.into(), true).unwrap();
        model.load_boot_memory().unwrap();
        assert_eq!(model.state(0.into()).unwrap().position, 5.0);
        let motors = model.motor_readings(ALL).unwrap();
        assert_eq!(motors[1].position, 8.0);
        let mut modes = [Mode::Idle; 2];
        model.read_control_modes(ALL, &mut modes).unwrap();
        assert_eq!(modes, [Mode::Velocity, Mode::Idle]);
        assert_eq!(model.amplifier_status(ALL).unwrap(), [1, 0]);
        assert!(model.is_braked(0.into()).unwrap());
    }

    #[test]
    fn settings_are_not_loaded_while_an_axis_moves_or_is_outside_of_their_limits() {
        let mut model = model();
        model
            .set_position_limits(0.into(), Limits::new(-10.0, 10.0))
            .unwrap();
        model.save_boot_memory().unwrap();
        model
            .set_position_limits(0.into(), Limits::new(-50.0, 50.0))
            .unwrap();
        model.set_reference_speeds(ALL, &[30.0; 2]).unwrap();
        model.position_move(Axes::One(1.into()), &[20.0]).unwrap();
        model.step(Duration::from_millis(100));
        let refused = model.load_boot_memory();
        assert!(matches!(refused, Err(DeviceError::Moving { joint, .. }) if joint == 1.into()));
        model.step(Duration::from_secs(10));
        model.set_encoders(Axes::One(0.into()), &[11.0]).unwrap();
        let refused = model.load_boot_memory();
        assert!(matches!(refused, Err(DeviceError::OutOfRange { joint, .. }) if joint == 0.into()));
        assert_eq!(model.reference_speeds(ALL).unwrap(), [30.0; 2]);
        model.set_encoders(Axes::One(0.into()), &[9.0]).unwrap();
        model.load_boot_memory().unwrap();
        assert_eq!(model.position_limits(0.into()).unwrap().max, 10.0);
    }
}
