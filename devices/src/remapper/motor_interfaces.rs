//! Forces, motors, control loops and calibration.

use super::Remapper;
use super::fan_out::{Interface, OnRefusal};
use super::range_checks::Quantity;
use crate::{
    AmplifierLimit, Axes, AxisIndex, CalibrationParameters, Device, DeviceError, EncoderReading,
    Fault, Impedance, ImpedanceLimits, Interaction, Limits, Mode, MotorTorqueParameters, Pid,
    PidInfo, PidKind, PidValue,
};

type Outcome<T> = Result<T, DeviceError>;

remapped! { describe_torque_control {
        fn set_motor_torque_parameters(
            &self,
            axis: AxisIndex,
            parameters: MotorTorqueParameters,
        ) -> Outcome<()> {
            self.one(Interface::torque_control(), axis, |device, axis| {
                Some(device.torque_control()?.set_motor_torque_parameters(axis, parameters))
            })
        }

        fn torques(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
            self.ask(Interface::torque_control(), axes, |device, axes| Some(device.torque_control()?.torques(axes)))
        }

        fn set_reference_torques(&self, axes: Axes<'_>, torques: &[f64]) -> Outcome<()> {
            self.tell(
                Interface::torque_control(),
                axes,
                ("torques", torques),
                OnRefusal::StopThere,
                |share, values| {
                    self.beyond(Quantity::Torque, share, values)
                        || self.in_other_mode(share, Mode::Torque)
                },
                |device, axes, values| {
                    Some(device.torque_control()?.set_reference_torques(axes, values))
                },
            )
        }
} }

remapped! { describe_current_control {
        fn currents(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
            self.ask(Interface::current_control(), axes, |device, axes| Some(device.current_control()?.currents(axes)))
        }

        fn set_reference_currents(&self, axes: Axes<'_>, currents: &[f64]) -> Outcome<()> {
            self.tell(
                Interface::current_control(),
                axes,
                ("currents", currents),
                OnRefusal::StopThere,
                |share, values| {
                    self.beyond(Quantity::Current, share, values)
                        || self.in_other_mode(share, Mode::Current)
                },
                |device, axes, values| {
                    Some(
                        device
                            .current_control()?
                            .set_reference_currents(axes, values),
                    )
                },
            )
        }
} }

remapped! { describe_pwm_control {
        fn duty_cycles(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
            self.ask(Interface::pwm_control(), axes, |device, axes| Some(device.pwm_control()?.duty_cycles(axes)))
        }

        fn set_reference_duty_cycles(&self, axes: Axes<'_>, duty_cycles: &[f64]) -> Outcome<()> {
            self.tell(
                Interface::pwm_control(),
                axes,
                ("duty cycles", duty_cycles),
                OnRefusal::StopThere,
                |share, values| {
                    self.beyond(Quantity::DutyCycle, share, values)
                        || self.in_other_mode(share, Mode::Pwm)
                },
                |device, axes, values| {
                    Some(
                        device
                            .pwm_control()?
                            .set_reference_duty_cycles(axes, values),
                    )
                },
            )
        }
} }

remapped! { describe_interaction_mode {
        fn interactions(&self, axes: Axes<'_>) -> Outcome<Vec<Interaction>> {
            self.ask(Interface::interaction_mode(), axes, |device, axes| Some(device.interaction_mode()?.interactions(axes)))
        }

        fn set_interactions(&self, axes: Axes<'_>, interactions: &[Interaction]) -> Outcome<()> {
            let odd = |wanted: &Interaction| matches!(wanted, Interaction::Unknown(_));
            self.tell(
                Interface::interaction_mode(),
                axes,
                ("interaction modes", interactions),
                OnRefusal::StopThere,
                |_, values| values.iter().any(odd),
                |device, axes, values| Some(device.interaction_mode()?.set_interactions(axes, values)),
            )
        }
} }

remapped! { describe_pid_control {
        fn available_pids(&self, axis: AxisIndex) -> Outcome<Vec<PidKind>> {
            self.one(Interface::pid_control(), axis, |device, axis| {
                Some(device.pid_control()?.available_pids(axis))
            })
        }

        fn pids(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<Pid>> {
            self.ask(Interface::pid_control(), axes, |device, axes| {
                Some(device.pid_control()?.pids(kind, axes))
            })
        }

        fn pid_info(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<PidInfo>> {
            self.ask(Interface::pid_control(), axes, |device, axes| {
                Some(device.pid_control()?.pid_info(kind, axes))
            })
        }

        fn set_pids(&self, kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> Outcome<()> {
            self.tell(
                Interface::pid_control(),
                axes,
                ("gains", pids),
                OnRefusal::StopThere,
                |share, _| lacks_loop(share.part.device.as_ref(), kind, &share.theirs),
                |device, axes, pids| Some(device.pid_control()?.set_pids(kind, axes, pids)),
            )
        }

        fn pid_values(&self, kind: PidKind, value: PidValue, axes: Axes<'_>) -> Outcome<Vec<f64>> {
            self.ask(Interface::pid_control(), axes, |device, axes| {
                Some(device.pid_control()?.pid_values(kind, value, axes))
            })
        }

        fn set_pid_values(
            &self,
            kind: PidKind,
            value: PidValue,
            axes: Axes<'_>,
            values: &[f64],
        ) -> Outcome<()> {
            self.tell(
                Interface::pid_control(),
                axes,
                ("values", values),
                OnRefusal::StopThere,
                |share, values| {
                    self.beyond(Quantity::Finite, share, values)
                        || lacks_loop(share.part.device.as_ref(), kind, &share.theirs)
                },
                |device, axes, values| {
                    let control = device.pid_control()?;
                    Some(control.set_pid_values(kind, value, axes, values))
                },
            )
        }

        fn pids_enabled(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<bool>> {
            self.ask(Interface::pid_control(), axes, |device, axes| {
                Some(device.pid_control()?.pids_enabled(kind, axes))
            })
        }

        fn enable_pids(&self, kind: PidKind, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
            self.order(Interface::pid_control(), axes, OnRefusal::StopThere, |device, axes| {
                Some(device.pid_control()?.enable_pids(kind, axes, enabled))
            })
        }

        fn reset_pids(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<()> {
            self.order(Interface::pid_control(), axes, OnRefusal::StopThere, |device, axes| {
                Some(device.pid_control()?.reset_pids(kind, axes))
            })
        }
} }

/// Returns whether a device reports that one of its joints has no such loop.
fn lacks_loop(device: &dyn Device, kind: PidKind, axes: &[AxisIndex]) -> bool {
    device.pid_control().is_some_and(|control| {
        let known = axes.iter().map(|axis| control.available_pids(*axis));
        known.flatten().any(|kinds| !kinds.contains(&kind))
    })
}

remapped! { describe_motor_encoders {
        fn motor_readings(&self, axes: Axes<'_>) -> Outcome<Vec<EncoderReading>> {
            self.ask(Interface::motor_encoders(), axes, |device, axes| Some(device.motor_encoders()?.motor_readings(axes)))
        }

        fn set_motor_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Outcome<()> {
            self.tell(
                Interface::motor_encoders(),
                axes,
                ("positions", positions),
                OnRefusal::StopThere,
                |share, values| self.beyond(Quantity::Finite, share, values),
                |device, axes, values| Some(device.motor_encoders()?.set_motor_encoders(axes, values)),
            )
        }
} }

remapped! { describe_amplifier_control {
        fn enable_amplifiers(&self, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
            let others = match enabled {
                true => OnRefusal::StopThere,
                false => OnRefusal::TellOthers,
            };
            self.order(Interface::amplifier_control(), axes, others, |device, axes| {
                Some(device.amplifier_control()?.enable_amplifiers(axes, enabled))
            })
        }

        fn amplifier_limit(&self, limit: AmplifierLimit, axis: AxisIndex) -> Outcome<f64> {
            self.one(Interface::amplifier_control(), axis, |device, axis| {
                Some(device.amplifier_control()?.amplifier_limit(limit, axis))
            })
        }

        fn set_amplifier_limit(
            &self,
            limit: AmplifierLimit,
            axis: AxisIndex,
            value: f64,
        ) -> Outcome<()> {
            self.one(Interface::amplifier_control(), axis, |device, axis| {
                let amplifiers = device.amplifier_control()?;
                Some(amplifiers.set_amplifier_limit(limit, axis, value))
            })
        }
} }

// Calibrating and parking the whole board means the whole of each device: a device of which only some joints are
// here refuses, since the others would move too. Whole parts of it are moved by `RemoteCalibrator`. Commands that
// end a calibration or a parking go to every device.
remapped! { describe_control_calibration {
        fn calibrate_robot(&self) -> Outcome<()> {
            self.all_here("calibrating")?;
            self.order(Interface::control_calibration(), Axes::All, OnRefusal::StopThere, |device, _| {
                Some(device.control_calibration()?.calibrate_robot())
            })
        }

        fn park_robot(&self, wait: bool) -> Outcome<()> {
            self.all_here("parking")?;
            let park = |wait: bool| {
                self.order(Interface::control_calibration(), Axes::All, OnRefusal::StopThere, |device, _| {
                    Some(device.control_calibration()?.park_robot(wait))
                })
            };
            // All are on their way before the first is waited for.
            park(wait && self.parts.len() == 1)?;
            if wait && self.parts.len() > 1 {
                park(true)?;
            }
            Ok(())
        }

        fn abort_calibration(&self) -> Outcome<()> {
            self.order(
                Interface::control_calibration(),
                Axes::All,
                OnRefusal::TellOthers,
                |device, _| Some(device.control_calibration()?.abort_calibration()),
            )
        }

        fn abort_park(&self) -> Outcome<()> {
            self.order(
                Interface::control_calibration(),
                Axes::All,
                OnRefusal::TellOthers,
                |device, _| Some(device.control_calibration()?.abort_park()),
            )
        }
} }

impl Remapper {
    /// Refuses what would move joints that are not here.
    fn all_here(&self, doing: &str) -> Outcome<()> {
        match self.parts.iter().find(|part| !part.is_all_here()) {
            None => Ok(()),
            Some(part) => Err(part.refused(DeviceError::NotSupported {
                what: format!("{doing} a part of {}", part.name),
            })),
        }
    }
}

remapped! { describe_remote_calibrator {
        /// Returns whether every device has one.
        fn calibrator_present(&self) -> Outcome<bool> {
            for part in &self.parts {
                let present = match part.device.remote_calibrator() {
                    Some(calibrator) => calibrator.calibrator_present(),
                    None => Ok(false),
                };
                if !present.map_err(|error| part.refused(error))? {
                    return Ok(false);
                }
            }
            Ok(true)
        }



        fn quit_calibration(&self) -> Outcome<()> {
            self.order(Interface::remote_calibrator(), Axes::All, OnRefusal::TellOthers, |device, _| {
                Some(device.remote_calibrator()?.quit_calibration())
            })
        }

        fn quit_park(&self) -> Outcome<()> {
            self.order(Interface::remote_calibrator(), Axes::All, OnRefusal::TellOthers, |device, _| {
                Some(device.remote_calibrator()?.quit_park())
            })
        }
} }

crate::wholly_described!(remapped);
