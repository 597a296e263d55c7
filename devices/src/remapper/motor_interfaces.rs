//! Forces, motors, control loops and calibration.

use super::fan_out::OnRefusal;
use super::range_checks::Quantity;
use super::{
    AMPLIFIERS, BRAKES, CALIBRATION, CALIBRATOR, CURRENT, FAULTS, IMPEDANCE, INTERACTION, MOTOR,
    MOTOR_ENCODERS, PIDS, PWM, Remapper, TORQUE,
};
use crate::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, CalibrationParameters, ControlCalibration,
    CurrentControl, Device, DeviceError, EncoderReading, Fault, Impedance, ImpedanceControl,
    ImpedanceLimits, Interaction, InteractionMode, JointBrake, JointFault, Limits, Mode, Motor,
    MotorEncoders, MotorTorqueParameters, Pid, PidControl, PidInfo, PidKind, PidValue, PwmControl,
    RemoteCalibrator, TorqueControl,
};

type Outcome<T> = Result<T, DeviceError>;

/// Methods about one joint that pass on to its device.
macro_rules! one_joint {
    ($($interface:ident $question:ident: fn $name:ident($($value:ident: $kind:ty),*) -> $answer:ty;)*) => {
        $(fn $name(&self, axis: AxisIndex, $($value: $kind),*) -> Outcome<$answer> {
            self.one($interface, axis, |device, axis| Some(device.$question()?.$name(axis, $($value),*)))
        })*
    };
}

/// Questions about several joints that are answered with a value for each.
macro_rules! questions {
    ($($interface:ident $question:ident: fn $name:ident() -> $answer:ty;)*) => {
        $(fn $name(&self, axes: Axes<'_>) -> Outcome<Vec<$answer>> {
            self.ask($interface, axes, |device, axes| Some(device.$question()?.$name(axes)))
        })*
    };
}

impl TorqueControl for Remapper {
    questions! {
        TORQUE torque_control: fn reference_torques() -> f64;
        TORQUE torque_control: fn torques() -> f64;
        TORQUE torque_control: fn torque_ranges() -> Limits;
    }
    one_joint! {
        TORQUE torque_control: fn motor_torque_parameters() -> MotorTorqueParameters;
        TORQUE torque_control: fn set_motor_torque_parameters(parameters: MotorTorqueParameters) -> ();
    }

    fn set_reference_torques(&self, axes: Axes<'_>, torques: &[f64]) -> Outcome<()> {
        self.tell(
            TORQUE,
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
}

impl CurrentControl for Remapper {
    questions! {
        CURRENT current_control: fn currents() -> f64;
        CURRENT current_control: fn current_ranges() -> Limits;
        CURRENT current_control: fn reference_currents() -> f64;
    }

    fn set_reference_currents(&self, axes: Axes<'_>, currents: &[f64]) -> Outcome<()> {
        self.tell(
            CURRENT,
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
}

impl PwmControl for Remapper {
    questions! {
        PWM pwm_control: fn duty_cycles() -> f64;
        PWM pwm_control: fn reference_duty_cycles() -> f64;
    }

    fn set_reference_duty_cycles(&self, axes: Axes<'_>, duty_cycles: &[f64]) -> Outcome<()> {
        self.tell(
            PWM,
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
}

impl InteractionMode for Remapper {
    questions! {
        INTERACTION interaction_mode: fn interactions() -> Interaction;
    }

    fn set_interactions(&self, axes: Axes<'_>, interactions: &[Interaction]) -> Outcome<()> {
        let odd = |wanted: &Interaction| matches!(wanted, Interaction::Unknown(_));
        self.tell(
            INTERACTION,
            axes,
            ("interaction modes", interactions),
            OnRefusal::StopThere,
            |_, values| values.iter().any(odd),
            |device, axes, values| Some(device.interaction_mode()?.set_interactions(axes, values)),
        )
    }
}

impl ImpedanceControl for Remapper {
    one_joint! {
        IMPEDANCE impedance_control: fn impedance() -> Impedance;
        IMPEDANCE impedance_control: fn set_impedance(impedance: Impedance) -> ();
        IMPEDANCE impedance_control: fn impedance_offset() -> f64;
        IMPEDANCE impedance_control: fn set_impedance_offset(offset: f64) -> ();
        IMPEDANCE impedance_control: fn impedance_limits() -> ImpedanceLimits;
    }
}

impl PidControl for Remapper {
    one_joint! {
        PIDS pid_control: fn available_pids() -> Vec<PidKind>;
    }

    fn pids(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<Pid>> {
        self.ask(PIDS, axes, |device, axes| {
            Some(device.pid_control()?.pids(kind, axes))
        })
    }

    fn pid_info(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<PidInfo>> {
        self.ask(PIDS, axes, |device, axes| {
            Some(device.pid_control()?.pid_info(kind, axes))
        })
    }

    fn set_pids(&self, kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> Outcome<()> {
        self.tell(
            PIDS,
            axes,
            ("gains", pids),
            OnRefusal::StopThere,
            |share, _| lacks_loop(share.part.device.as_ref(), kind, &share.theirs),
            |device, axes, pids| Some(device.pid_control()?.set_pids(kind, axes, pids)),
        )
    }

    fn pid_values(&self, kind: PidKind, value: PidValue, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.ask(PIDS, axes, |device, axes| {
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
            PIDS,
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
        self.ask(PIDS, axes, |device, axes| {
            Some(device.pid_control()?.pids_enabled(kind, axes))
        })
    }

    fn enable_pids(&self, kind: PidKind, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
        self.order(PIDS, axes, OnRefusal::StopThere, |device, axes| {
            Some(device.pid_control()?.enable_pids(kind, axes, enabled))
        })
    }

    fn reset_pids(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<()> {
        self.order(PIDS, axes, OnRefusal::StopThere, |device, axes| {
            Some(device.pid_control()?.reset_pids(kind, axes))
        })
    }
}

/// Returns whether a device reports that one of its joints has no such loop.
fn lacks_loop(device: &dyn Device, kind: PidKind, axes: &[AxisIndex]) -> bool {
    device.pid_control().is_some_and(|control| {
        let known = axes.iter().map(|axis| control.available_pids(*axis));
        known.flatten().any(|kinds| !kinds.contains(&kind))
    })
}

impl MotorEncoders for Remapper {
    questions! {
        MOTOR_ENCODERS motor_encoders: fn motor_readings() -> EncoderReading;
    }
    one_joint! {
        MOTOR_ENCODERS motor_encoders: fn counts_per_revolution() -> f64;
        MOTOR_ENCODERS motor_encoders: fn set_counts_per_revolution(counts: f64) -> ();
    }

    fn set_motor_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Outcome<()> {
        self.tell(
            MOTOR_ENCODERS,
            axes,
            ("positions", positions),
            OnRefusal::StopThere,
            |share, values| self.beyond(Quantity::Finite, share, values),
            |device, axes, values| Some(device.motor_encoders()?.set_motor_encoders(axes, values)),
        )
    }

    fn reset_motor_encoders(&self, axes: Axes<'_>) -> Outcome<()> {
        self.order(
            MOTOR_ENCODERS,
            axes,
            OnRefusal::StopThere,
            |device, axes| Some(device.motor_encoders()?.reset_motor_encoders(axes)),
        )
    }
}

impl Motor for Remapper {
    questions! {
        MOTOR motor: fn temperatures() -> f64;
    }
    one_joint! {
        MOTOR motor: fn temperature_limit() -> f64;
        MOTOR motor: fn set_temperature_limit(limit: f64) -> ();
        MOTOR motor: fn gearbox_ratio() -> f64;
        MOTOR motor: fn set_gearbox_ratio(ratio: f64) -> ();
    }
}

impl AmplifierControl for Remapper {
    questions! {
        AMPLIFIERS amplifier_control: fn amplifier_status() -> i32;
    }
    one_joint! {
        AMPLIFIERS amplifier_control: fn amplifier_duty_cycle() -> f64;
        AMPLIFIERS amplifier_control: fn supply_voltage() -> f64;
    }

    fn enable_amplifiers(&self, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
        let others = match enabled {
            true => OnRefusal::StopThere,
            false => OnRefusal::TellOthers,
        };
        self.order(AMPLIFIERS, axes, others, |device, axes| {
            Some(device.amplifier_control()?.enable_amplifiers(axes, enabled))
        })
    }

    fn amplifier_limit(&self, limit: AmplifierLimit, axis: AxisIndex) -> Outcome<f64> {
        self.one(AMPLIFIERS, axis, |device, axis| {
            Some(device.amplifier_control()?.amplifier_limit(limit, axis))
        })
    }

    fn set_amplifier_limit(
        &self,
        limit: AmplifierLimit,
        axis: AxisIndex,
        value: f64,
    ) -> Outcome<()> {
        self.one(AMPLIFIERS, axis, |device, axis| {
            let amplifiers = device.amplifier_control()?;
            Some(amplifiers.set_amplifier_limit(limit, axis, value))
        })
    }
}

/// Calibrating and parking the whole board means the whole of each device: a device of which only some joints are
/// here refuses, since the others would move too. Whole parts of it are moved by [`RemoteCalibrator`]. Commands that
/// end a calibration or a parking go to every device.
impl ControlCalibration for Remapper {
    one_joint! {
        CALIBRATION control_calibration: fn calibrate_axis(method: u32, parameters: [f64; 3]) -> ();
        CALIBRATION control_calibration: fn set_calibration_parameters(parameters: CalibrationParameters) -> ();
        CALIBRATION control_calibration: fn calibration_done() -> bool;
    }

    fn calibrate_robot(&self) -> Outcome<()> {
        self.all_here("calibrating")?;
        self.order(CALIBRATION, Axes::All, OnRefusal::StopThere, |device, _| {
            Some(device.control_calibration()?.calibrate_robot())
        })
    }

    fn park_robot(&self, wait: bool) -> Outcome<()> {
        self.all_here("parking")?;
        let park = |wait: bool| {
            self.order(CALIBRATION, Axes::All, OnRefusal::StopThere, |device, _| {
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
            CALIBRATION,
            Axes::All,
            OnRefusal::TellOthers,
            |device, _| Some(device.control_calibration()?.abort_calibration()),
        )
    }

    fn abort_park(&self) -> Outcome<()> {
        self.order(
            CALIBRATION,
            Axes::All,
            OnRefusal::TellOthers,
            |device, _| Some(device.control_calibration()?.abort_park()),
        )
    }
}

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

impl RemoteCalibrator for Remapper {
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

    fn calibrate(&self, axes: Axes<'_>) -> Outcome<()> {
        self.order(CALIBRATOR, axes, OnRefusal::StopThere, |device, axes| {
            Some(device.remote_calibrator()?.calibrate(axes))
        })
    }

    fn home(&self, axes: Axes<'_>) -> Outcome<()> {
        self.order(CALIBRATOR, axes, OnRefusal::StopThere, |device, axes| {
            Some(device.remote_calibrator()?.home(axes))
        })
    }

    fn park(&self, axes: Axes<'_>) -> Outcome<()> {
        self.order(CALIBRATOR, axes, OnRefusal::StopThere, |device, axes| {
            Some(device.remote_calibrator()?.park(axes))
        })
    }

    fn quit_calibration(&self) -> Outcome<()> {
        self.order(CALIBRATOR, Axes::All, OnRefusal::TellOthers, |device, _| {
            Some(device.remote_calibrator()?.quit_calibration())
        })
    }

    fn quit_park(&self) -> Outcome<()> {
        self.order(CALIBRATOR, Axes::All, OnRefusal::TellOthers, |device, _| {
            Some(device.remote_calibrator()?.quit_park())
        })
    }
}

impl JointFault for Remapper {
    one_joint! {
        FAULTS joint_fault: fn last_fault() -> Fault;
    }
}

impl JointBrake for Remapper {
    one_joint! {
        BRAKES joint_brake: fn is_braked() -> bool;
        BRAKES joint_brake: fn set_manual_brake(active: bool) -> ();
        BRAKES joint_brake: fn auto_brake() -> bool;
        BRAKES joint_brake: fn set_auto_brake(enabled: bool) -> ();
    }
}
