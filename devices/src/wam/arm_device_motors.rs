//! The interfaces of an arm under control that concern its motors.

use super::arm_device::{ArmDevice, ControlledArm};
use crate::simulation::Gains;
use crate::{
    Axes, AxisIndex, DeviceError, EncoderReading, Encoders, Fault, JointFault, Limits, Mode,
    MotorEncoders, MotorTorqueParameters, Pid, PidControl, PidInfo, PidKind, PidUnits, PidValue,
    PositionDirect, TorqueControl,
};

fn not_supported<T>(what: &str) -> Result<T, DeviceError> {
    Err(DeviceError::NotSupported {
        what: what.to_owned(),
    })
}

impl<A: ControlledArm<N>, const N: usize> PositionDirect for ArmDevice<A, N> {
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.control(|arm| arm.set_direct_positions(axes, positions))
    }

    fn direct_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.control(|arm| arm.direct_positions(axes))
    }
}

impl<A: ControlledArm<N>, const N: usize> TorqueControl for ArmDevice<A, N> {
    fn set_reference_torques(&self, axes: Axes<'_>, torques: &[f64]) -> Result<(), DeviceError> {
        self.control(|arm| arm.set_reference_torques(axes, torques))
    }

    fn reference_torques(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.control(|arm| arm.reference_torques(axes))
    }

    fn torques(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.control(|arm| arm.torques(axes))
    }

    fn torque_ranges(&self, axes: Axes<'_>) -> Result<Vec<Limits>, DeviceError> {
        axes.check(N)?;
        self.control(|arm| axes.iter(N).map(|axis| arm.torque_range(axis)).collect())
    }

    fn motor_torque_parameters(&self, _: AxisIndex) -> Result<MotorTorqueParameters, DeviceError> {
        not_supported("a torque loop with parameters: motors follow torques as they are")
    }

    fn set_motor_torque_parameters(
        &self,
        _: AxisIndex,
        _: MotorTorqueParameters,
    ) -> Result<(), DeviceError> {
        not_supported("a torque loop with parameters: motors follow torques as they are")
    }
}

impl<A: ControlledArm<N>, const N: usize> ArmDevice<A, N> {
    /// Only positions are controlled by a loop.
    fn check_loop(kind: PidKind, axes: Axes<'_>) -> Result<(), DeviceError> {
        if kind != PidKind::Position {
            return not_supported("a loop for anything but positions");
        }
        axes.check(N)
    }
}

/// One loop per joint, that of its position: gains in Nm per degree, per degree and second, and seconds per degree.
impl<A: ControlledArm<N>, const N: usize> PidControl for ArmDevice<A, N> {
    fn available_pids(&self, axis: AxisIndex) -> Result<Vec<PidKind>, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(vec![PidKind::Position])
    }

    fn pids(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<Pid>, DeviceError> {
        Self::check_loop(kind, axes)?;
        self.control(|arm| {
            let pid = |axis| {
                arm.gains(axis).map(|gains| Pid {
                    kp: gains.proportional,
                    ki: gains.integral,
                    kd: gains.derivative,
                    max_integral: gains.limit,
                    max_output: gains.limit,
                    scale: 1.0,
                    ..Pid::default()
                })
            };
            axes.iter(N).map(pid).collect()
        })
    }

    fn pid_info(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<PidInfo>, DeviceError> {
        Self::check_loop(kind, axes)?;
        let info = PidInfo {
            description: "position of the joint, beside the compensation of gravity".to_owned(),
            input: "position of the joint, deg".to_owned(),
            output: "torque of the joint, Nm".to_owned(),
            units: PidUnits::plain("deg", "Nm"),
        };
        Ok(vec![info; axes.len(N)])
    }

    /// The loops have no scale, offset, friction or feed-forward of their own: those are ignored, and the largest
    /// integral is the largest output.
    fn set_pids(&self, kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> Result<(), DeviceError> {
        Self::check_loop(kind, axes)?;
        axes.check_command(N, "gains", pids.len())?;
        let gains = |pid: &Pid| Gains::new(pid.kp, pid.ki, pid.kd, pid.max_output);
        self.control(|arm| {
            for (axis, pid) in axes.iter(N).zip(pids) {
                arm.check_gains(axis, gains(pid))?;
            }
            for (axis, pid) in axes.iter(N).zip(pids) {
                arm.set_gains(axis, gains(pid))?;
            }
            Ok(())
        })
    }

    fn pid_values(
        &self,
        kind: PidKind,
        value: PidValue,
        axes: Axes<'_>,
    ) -> Result<Vec<f64>, DeviceError> {
        Self::check_loop(kind, axes)?;
        self.control(|arm| {
            let measured = |axis| arm.state(axis).map(|state| state.position);
            let reference = |axis: AxisIndex| {
                arm.direct_positions(axis.into())
                    .map(|places| places.first().copied().unwrap_or_default())
            };
            let one = |axis| match value {
                PidValue::Reference => reference(axis),
                PidValue::Error => Ok(reference(axis)? - measured(axis)?),
                PidValue::Output => arm.loop_output(axis),
                PidValue::ErrorLimit | PidValue::Offset | PidValue::Feedforward => {
                    not_supported("a loop with an error limit, offset or feed-forward")
                }
            };
            axes.iter(N).map(one).collect()
        })
    }

    fn set_pid_values(
        &self,
        kind: PidKind,
        _: PidValue,
        axes: Axes<'_>,
        _: &[f64],
    ) -> Result<(), DeviceError> {
        Self::check_loop(kind, axes)?;
        not_supported("setting references, limits, offsets or feed-forwards of loops")
    }

    fn pids_enabled(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<bool>, DeviceError> {
        Self::check_loop(kind, axes)?;
        let mut modes = vec![Mode::UNKNOWN; axes.len(N)];
        self.control(|arm| arm.read_control_modes(axes, &mut modes))?;
        let closed = [Mode::Position, Mode::PositionDirect, Mode::Velocity];
        Ok(modes.iter().map(|mode| closed.contains(mode)).collect())
    }

    fn enable_pids(&self, kind: PidKind, axes: Axes<'_>, _: bool) -> Result<(), DeviceError> {
        Self::check_loop(kind, axes)?;
        not_supported("opening and closing loops but by the control mode")
    }

    fn reset_pids(&self, kind: PidKind, axes: Axes<'_>) -> Result<(), DeviceError> {
        Self::check_loop(kind, axes)?;
        self.control(|arm| arm.reset_loops(axes))
    }
}

impl<A: ControlledArm<N>, const N: usize> MotorEncoders for ArmDevice<A, N> {
    /// Degrees of the shafts.
    fn motor_readings(&self, axes: Axes<'_>) -> Result<Vec<EncoderReading>, DeviceError> {
        axes.check(N)?;
        let joints = self.encoder_readings(Axes::All)?;
        let motors = |value: fn(&EncoderReading) -> f64| {
            self.control(|arm| {
                let values =
                    crate::kinematics::Joints::<N>::from_fn(|joint, _| value(&joints[joint]));
                arm.model().transmission.motors_of(&values)
            })
        };
        let positions = motors(|reading| reading.position);
        let speeds = motors(|reading| reading.speed);
        let accelerations = motors(|reading| reading.acceleration);
        let one = |axis: AxisIndex| EncoderReading {
            position: positions[axis.index()],
            speed: speeds[axis.index()],
            acceleration: accelerations[axis.index()],
            time: joints[axis.index()].time,
        };
        Ok(axes.iter(N).map(one).collect())
    }

    fn set_motor_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        axes.check_command(N, "motor positions", positions.len())?;
        not_supported("setting absolute encoders")
    }

    fn counts_per_revolution(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(self.control(|arm| {
            let transmission = &arm.model().transmission;
            f64::from(transmission.counts_per_turn())
        }))
    }

    fn set_counts_per_revolution(&self, axis: AxisIndex, _: f64) -> Result<(), DeviceError> {
        Axes::One(axis).check(N)?;
        not_supported("encoders with other counts")
    }
}

impl<A: ControlledArm<N>, const N: usize> JointFault for ArmDevice<A, N> {
    /// Code 1 is a fault of the safety module, of a puck or of the way to the arm, which concerns all joints; code 2 a stall
    /// of this joint since its last command.
    fn last_fault(&self, axis: AxisIndex) -> Result<Fault, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(match self.with(|arm| arm.fault()) {
            Some(message) => Fault { code: 1, message },
            None => match self.control(|arm| arm.stall(axis)) {
                Some(message) => Fault { code: 2, message },
                None => no_fault(),
            },
        })
    }
}

fn no_fault() -> Fault {
    Fault {
        code: 0,
        message: "no fault".to_owned(),
    }
}
