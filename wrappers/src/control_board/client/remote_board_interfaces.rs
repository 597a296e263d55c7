//! The device interfaces; what is not written here is generated from their descriptions.

use std::time::{Duration, Instant};

use yarp_devices::{
    AmplifierLimit, Axes, AxisIndex, CalibrationParameters, DeviceError, EncoderReading, Fault,
    Impedance, ImpedanceLimits, Interaction, JointType, Limits, Mode, MotorTorqueParameters,
    PositionControl, VariableValue,
};
use yarp_wire::WireVersion;

use super::super::messages::{
    Action, Choices, Get, Outcome, Quantity, Query, Selection, SentMotorParameters, Set, Setting,
};
use super::argument_checks::Checked;

/// Timeout of parking.
const HOMING_TIMEOUT: Duration = Duration::from_secs(120);
const POLL_INTERVAL: Duration = Duration::from_millis(50);

yarp_devices::wholly_described!(remote);

remote! {
    describe_axis_info {
        fn axes(&self) -> usize {
            self.axes
        }
    }
    describe_motion_control {}
    describe_position_control {
        fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
            axes.check(self.axes)?;
            if axes.len(self.axes) == 0 {
                return Ok(true);
            }
            let answered = self.ask(Get::About(Query::MotionDone, Selection::from(axes)))?;
            answered.read(|values| Outcome::read(values, false))
        }
    }
    // Velocities, direct positions and torques are sent without waiting: a refusal of the board is not reported.
    describe_velocity_control {}
    describe_position_direct {}
    describe_velocity_direct {}
    describe_encoders {
        /// From the newest state; its time is the board's one time for all joints.
        fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
            axes.check(self.axes)?;
            axes.check_count(self.axes, "slots for readings", out.len())?;
            let latest = &self.link.latest;
            latest.read_known("encoder reading", |data, time| {
                let positions = data.positions.of(self.axes)?;
                let speeds = data.velocities.of(self.axes);
                let accelerations = data.accelerations.of(self.axes);
                for (slot, axis) in out.iter_mut().zip(axes.iter(self.axes)) {
                    *slot = reading(axis, positions, speeds, accelerations, time);
                }
                Some(())
            })
        }
    }
    describe_control_mode {
        /// [`DeviceError::NotSupported`] from 3.x, which has no query for it.
        fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
            Axes::One(axis).check(self.axes)?;
            self.asking_4("listing control modes")?;
            self.about(Query::AvailableModes, axis).map(|Choices(modes)| modes)
        }

        /// From the newest state.
        fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
            axes.check(self.axes)?;
            axes.check_count(self.axes, "slots for modes", out.len())?;
            let latest = &self.link.latest;
            latest.read_known("control mode", |data, _| {
                let modes = data.control_modes.of(self.axes)?;
                for (slot, axis) in out.iter_mut().zip(axes.iter(self.axes)) {
                    *slot = modes[axis.index()];
                }
                Some(())
            })
        }

        fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
            axes.check_command(self.axes, "modes", modes.len())?;
            if modes.is_empty() {
                return Ok(());
            }
            self.order(Set::ControlModes(Selection::from(axes), modes.to_vec()))
        }
    }
    describe_control_limits {}
    describe_torque_control {
        /// From the newest state.
        fn torques(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
            self.newest("torque", axes, |data| &data.torques)
        }

        /// A board up to 3.6 takes four numbers, and gets them if the others are 0.
        fn set_motor_torque_parameters(
            &self,
            axis: AxisIndex,
            parameters: MotorTorqueParameters,
        ) -> Result<(), DeviceError> {
            Axes::One(axis).check(self.axes)?;
            let numbers = parameters.to_array();
            for number in numbers {
                Axes::One(axis).check_finite(self.axes, "motor torque parameter", &[number])?;
            }
            let mut sent = SentMotorParameters::all(parameters);
            let outcome = self.order(Set::MotorParameters(axis, sent));
            let old = self.wire_version() == WireVersion::V3 && numbers[4..].iter().all(|one| *one == 0.0);
            match outcome {
                Err(DeviceError::Refused { .. }) if old => {
                    sent.count = 4;
                    self.order(Set::MotorParameters(axis, sent))
                }
                other => other,
            }
        }
    }
    // References are sent and not waited for, but for one joint of a board of 4.0.
    describe_current_control {
        /// From the newest state.
        fn currents(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
            self.newest("current", axes, |data| &data.currents)
        }
    }
    describe_pwm_control {
        /// From the newest state.
        fn duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
            self.newest("duty cycle", axes, |data| &data.duty_cycles)
        }
    }
    describe_interaction_mode {
        /// From the newest state.
        fn interactions(&self, axes: Axes<'_>) -> Result<Vec<Interaction>, DeviceError> {
            self.newest("interaction mode", axes, |data| &data.interaction_modes)
        }

        fn set_interactions(&self, axes: Axes<'_>, interactions: &[Interaction]) -> Result<(), DeviceError> {
            axes.check_command(self.axes, "interaction modes", interactions.len())?;
            if interactions.is_empty() {
                return Ok(());
            }
            let selection = Selection::from(axes);
            self.order(Set::Interactions(selection, interactions.to_vec()))
        }
    }
    describe_motor_encoders {
        /// From the newest state; its time is the board's one time for all joints.
        fn motor_readings(&self, axes: Axes<'_>) -> Result<Vec<EncoderReading>, DeviceError> {
            axes.check(self.axes)?;
            self.link.latest.read_known("motor encoder reading", |data, time| {
                let positions = data.motor_positions.of(self.axes)?;
                let speeds = data.motor_velocities.of(self.axes);
                let accelerations = data.motor_accelerations.of(self.axes);
                let readings = axes
                    .iter(self.axes)
                    .map(|axis| reading(axis, positions, speeds, accelerations, time));
                Some(readings.collect())
            })
        }
    }
    describe_amplifier_control {
        fn enable_amplifiers(&self, axes: Axes<'_>, enabled: bool) -> Result<(), DeviceError> {
            match enabled {
                true => self.act(Action::EnableAmplifiers, "switch on", axes),
                false => self.act(Action::DisableAmplifiers, "switch off", axes),
            }
        }

        fn amplifier_limit(&self, limit: AmplifierLimit, axis: AxisIndex) -> Result<f64, DeviceError> {
            let quantity = match limit {
                AmplifierLimit::MaxCurrent => Quantity::MaxCurrent,
                AmplifierLimit::NominalCurrent => Quantity::NominalCurrent,
                AmplifierLimit::PeakCurrent => Quantity::PeakCurrent,
                AmplifierLimit::DutyCycle => Quantity::DutyCycleLimit,
            };
            self.value(quantity, axis)
        }

        fn set_amplifier_limit(
            &self,
            limit: AmplifierLimit,
            axis: AxisIndex,
            value: f64,
        ) -> Result<(), DeviceError> {
            let setting = match limit {
                AmplifierLimit::MaxCurrent => Setting::MaxCurrent,
                AmplifierLimit::NominalCurrent => Setting::NominalCurrent,
                AmplifierLimit::PeakCurrent => Setting::PeakCurrent,
                AmplifierLimit::DutyCycle => Setting::DutyCycleLimit,
            };
            self.set(setting, "amplifier limit", axis.into(), &[value])
        }
    }
    // 3.x has messages for four calibration parameters and no zero: if any other is not 0 the call fails with
    // `DeviceError::NotSupported`.
    describe_control_calibration {
        /// Waits here, by asking: a board that waits would not answer for so long.
        fn park_robot(&self, wait: bool) -> Result<(), DeviceError> {
            self.order(Set::Act(Action::ParkRobot, Selection::All))?;
            let deadline = Instant::now() + HOMING_TIMEOUT;
            while wait && !self.motion_done(Axes::All)? && Instant::now() < deadline {
                std::thread::sleep(POLL_INTERVAL);
            }
            Ok(())
        }
    }
    describe_remote_calibrator {}
    describe_remote_variables {
        fn variable(&self, name: &str) -> Result<Vec<VariableValue>, DeviceError> {
            let answered = self.ask(Get::Variable(name.to_owned()))?;
            answered.read(|values| Outcome::read(values, true))
        }

        fn set_variable(&self, name: &str, value: &[VariableValue]) -> Result<(), DeviceError> {
            self.order(Set::Variable(name.to_owned(), value.to_vec()))
        }
    }
}

/// One joint of a state; what the board marks invalid is NaN.
fn reading(
    axis: AxisIndex,
    positions: &[f64],
    speeds: Option<&[f64]>,
    accelerations: Option<&[f64]>,
    time: f64,
) -> EncoderReading {
    let known = |values: Option<&[f64]>| values.map_or(f64::NAN, |values| values[axis.index()]);
    EncoderReading {
        position: positions[axis.index()],
        speed: known(speeds),
        acceleration: known(accelerations),
        time,
    }
}
