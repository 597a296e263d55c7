//! The interfaces of a guarded device for streamed commands.

use super::guarded_interfaces::has;
use super::{Guarded, pairs};
use crate::{
    Axes, AxisIndex, DeviceError, Limits, MotorTorqueParameters, PositionDirect, TorqueControl,
};

impl Guarded {
    fn direct(&self) -> Result<&dyn PositionDirect, DeviceError> {
        has(self.device().position_direct(), "direct positions")
    }

    fn forces(&self) -> Result<&dyn TorqueControl, DeviceError> {
        has(self.device().torque_control(), "torques")
    }
}

/// A stream of positions needs no watchdog: a joint holds at the last one.
impl PositionDirect for Guarded {
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.admit()?;
        let total = self.total();
        axes.check_command(total, "positions", positions.len())?;
        for (joint, asked) in pairs(axes, total, positions) {
            let unit = self.unit(joint, 0);
            self.joint_limits.check_position(joint, asked, unit)?;
            if self.rate_limits.speed(joint).is_some() {
                let here = self.place(joint)?;
                self.rate_limits.check_step(joint, asked, here, unit)?;
            }
        }
        self.direct()?.set_direct_positions(axes, positions)
    }

    fn direct_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.direct()?.direct_positions(axes)
    }
}

impl TorqueControl for Guarded {
    /// Sets torques; when their stream stops, the joint is put into position mode and holds.
    fn set_reference_torques(&self, axes: Axes<'_>, torques: &[f64]) -> Result<(), DeviceError> {
        self.admit()?;
        self.check_torques(axes, torques)?;
        self.forces()?.set_reference_torques(axes, torques)?;
        for joint in axes.iter(self.total()) {
            self.watch.record_torque(joint);
        }
        Ok(())
    }

    fn reference_torques(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.forces()?.reference_torques(axes)
    }

    fn torques(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.forces()?.torques(axes)
    }

    /// The guard's where they are smaller.
    fn torque_ranges(&self, axes: Axes<'_>) -> Result<Vec<Limits>, DeviceError> {
        let mut ranges = self.forces()?.torque_ranges(axes)?;
        for (range, joint) in ranges.iter_mut().zip(axes.iter(self.total())) {
            if let Some(most) = self.torque_limits.of(joint) {
                *range = Limits::new(range.min.max(-most), range.max.min(most));
            }
        }
        Ok(ranges)
    }

    fn motor_torque_parameters(
        &self,
        axis: AxisIndex,
    ) -> Result<MotorTorqueParameters, DeviceError> {
        self.forces()?.motor_torque_parameters(axis)
    }

    fn set_motor_torque_parameters(
        &self,
        axis: AxisIndex,
        parameters: MotorTorqueParameters,
    ) -> Result<(), DeviceError> {
        self.forces()?.set_motor_torque_parameters(axis, parameters)
    }
}
