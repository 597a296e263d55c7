//! The interfaces of a guarded device for motors and control loops.

use super::guarded_interfaces::has;
use super::{Guarded, check, pairs};
use crate::{
    Axes, AxisIndex, CurrentControl, DeviceError, Impedance, ImpedanceControl, ImpedanceLimits,
    Limits, Pid, PidControl, PidInfo, PidKind, PidValue, PwmControl, VelocityDirect,
};

/// The guard that is named in refusals of currents.
const CURRENT_LIMITS: &str = "current limits";

impl Guarded {
    fn electric(&self) -> Result<&dyn CurrentControl, DeviceError> {
        has(self.device().current_control(), "currents of motors")
    }

    fn duty(&self) -> Result<&dyn PwmControl, DeviceError> {
        has(self.device().pwm_control(), "duty cycles")
    }

    fn loops(&self) -> Result<&dyn PidControl, DeviceError> {
        has(self.device().pid_control(), "control loops")
    }

    fn compliance(&self) -> Result<&dyn ImpedanceControl, DeviceError> {
        has(self.device().impedance_control(), "impedance")
    }

    fn streamed(&self) -> Result<&dyn VelocityDirect, DeviceError> {
        has(self.device().velocity_direct(), "direct velocities")
    }

    fn record_efforts(&self, axes: Axes<'_>) {
        for joint in axes.iter(self.total()) {
            self.watch.record_torque(joint);
        }
    }

    fn largest_current(&self, motor: AxisIndex) -> Option<f64> {
        self.current_limits.get(motor.index()).copied()
    }
}

/// A stream of velocities that stops leads to hold, as that of [`VelocityControl`](crate::VelocityControl).
impl VelocityDirect for Guarded {
    fn set_direct_velocities(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.admit()?;
        let total = self.total();
        axes.check_command(total, "velocities", velocities.len())?;
        for (joint, asked) in pairs(axes, total, velocities) {
            self.check_velocity(joint, asked)?;
        }
        self.streamed()?.set_direct_velocities(axes, velocities)?;
        for (joint, velocity) in pairs(axes, total, velocities) {
            // A direct velocity ends at once.
            self.watch.record_velocity(joint, velocity, f64::INFINITY);
        }
        Ok(())
    }

    fn direct_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.streamed()?.direct_velocities(axes)
    }
}

impl CurrentControl for Guarded {
    fn currents(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.electric()?.currents(axes)
    }

    /// The guard's where they are smaller.
    fn current_ranges(&self, axes: Axes<'_>) -> Result<Vec<Limits>, DeviceError> {
        let mut ranges = self.electric()?.current_ranges(axes)?;
        for (range, motor) in ranges.iter_mut().zip(axes.iter(self.total())) {
            if let Some(most) = self.largest_current(motor) {
                *range = Limits::new(range.min.max(-most), range.max.min(most));
            }
        }
        Ok(ranges)
    }

    /// Sets currents; when their stream stops, the joint is put into position mode and holds.
    fn set_reference_currents(&self, axes: Axes<'_>, currents: &[f64]) -> Result<(), DeviceError> {
        self.admit()?;
        let total = self.total();
        axes.check_command(total, "currents", currents.len())?;
        for (motor, asked) in pairs(axes, total, currents) {
            let allowed = self.largest_current(motor);
            let allowed = allowed.map(|most| Limits::new(-most, most));
            check(CURRENT_LIMITS, motor, "current", asked, allowed, "A")?;
        }
        self.electric()?.set_reference_currents(axes, currents)?;
        self.record_efforts(axes);
        Ok(())
    }

    fn reference_currents(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.electric()?.reference_currents(axes)
    }
}

impl PwmControl for Guarded {
    fn duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.duty()?.duty_cycles(axes)
    }

    /// Sets duty cycles; when their stream stops, the joint is put into position mode and holds.
    fn set_reference_duty_cycles(
        &self,
        axes: Axes<'_>,
        duty_cycles: &[f64],
    ) -> Result<(), DeviceError> {
        self.admit()?;
        self.duty()?.set_reference_duty_cycles(axes, duty_cycles)?;
        self.record_efforts(axes);
        Ok(())
    }

    fn reference_duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.duty()?.reference_duty_cycles(axes)
    }
}

impl ImpedanceControl for Guarded {
    fn impedance(&self, axis: AxisIndex) -> Result<Impedance, DeviceError> {
        self.compliance()?.impedance(axis)
    }

    fn set_impedance(&self, axis: AxisIndex, impedance: Impedance) -> Result<(), DeviceError> {
        self.admit()?;
        self.compliance()?.set_impedance(axis, impedance)
    }

    fn impedance_offset(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        self.compliance()?.impedance_offset(axis)
    }

    /// The offset is a torque, within the torque limits.
    fn set_impedance_offset(&self, axis: AxisIndex, offset: f64) -> Result<(), DeviceError> {
        self.admit()?;
        self.check_torques(Axes::One(axis), &[offset])?;
        self.compliance()?.set_impedance_offset(axis, offset)
    }

    fn impedance_limits(&self, axis: AxisIndex) -> Result<ImpedanceLimits, DeviceError> {
        self.compliance()?.impedance_limits(axis)
    }
}

/// The output of a loop is limited by the torque limits; a reference that is set behind the other interfaces is refused
/// where a guard would have to watch it.
impl PidControl for Guarded {
    fn available_pids(&self, axis: AxisIndex) -> Result<Vec<PidKind>, DeviceError> {
        self.loops()?.available_pids(axis)
    }

    fn pids(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<Pid>, DeviceError> {
        self.loops()?.pids(kind, axes)
    }

    fn pid_info(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<PidInfo>, DeviceError> {
        self.loops()?.pid_info(kind, axes)
    }

    fn set_pids(&self, kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> Result<(), DeviceError> {
        self.admit()?;
        let total = self.total();
        axes.check_command(total, "gains", pids.len())?;
        if kind != PidKind::Current {
            let outputs: Vec<f64> = pids.iter().map(|pid| pid.max_output).collect();
            self.torque_limits.check(axes, total, &outputs)?;
        }
        self.loops()?.set_pids(kind, axes, pids)
    }

    fn pid_values(
        &self,
        kind: PidKind,
        value: PidValue,
        axes: Axes<'_>,
    ) -> Result<Vec<f64>, DeviceError> {
        self.loops()?.pid_values(kind, value, axes)
    }

    fn set_pid_values(
        &self,
        kind: PidKind,
        value: PidValue,
        axes: Axes<'_>,
        values: &[f64],
    ) -> Result<(), DeviceError> {
        self.admit()?;
        let total = self.total();
        axes.check_command(total, "values", values.len())?;
        match (value, kind) {
            (PidValue::Reference, PidKind::Position) => {
                for (joint, asked) in pairs(axes, total, values) {
                    let unit = self.unit(joint, 0);
                    self.joint_limits.check_position(joint, asked, unit)?;
                }
            }
            (PidValue::Reference, _) if !self.is_unlimited => {
                return Err(DeviceError::NotSupported {
                    what: "a reference of this control loop behind a guard".to_owned(),
                });
            }
            (PidValue::Offset | PidValue::Feedforward, _) if kind != PidKind::Current => {
                self.torque_limits.check(axes, total, values)?;
            }
            _ => {}
        }
        self.loops()?.set_pid_values(kind, value, axes, values)
    }

    fn pids_enabled(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<bool>, DeviceError> {
        self.loops()?.pids_enabled(kind, axes)
    }

    fn enable_pids(&self, kind: PidKind, axes: Axes<'_>, enabled: bool) -> Result<(), DeviceError> {
        self.admit()?;
        self.loops()?.enable_pids(kind, axes, enabled)
    }

    fn reset_pids(&self, kind: PidKind, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.admit()?;
        self.loops()?.reset_pids(kind, axes)
    }
}
