//! The motor interfaces of the recorded board.

use yarp_devices::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, AxisInfo, DeviceError, Limits, Motor,
    MotorTorqueParameters, Pid, PidControl, PidInfo, PidKind, PidValue, PositionControl,
    PositionDirect, TorqueControl,
};

use crate::recorded_board::RecordedBoard;

type Outcome<T> = Result<T, DeviceError>;

impl RecordedBoard {
    fn each<T: Clone>(&self, axes: Axes<'_>, value: T) -> Outcome<Vec<T>> {
        axes.check(self.axes())?;
        Ok(vec![value; axes.len(self.axes())])
    }
}

impl PositionDirect for RecordedBoard {
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Outcome<()> {
        self.position_move(axes, positions)
    }

    fn direct_positions(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.target_positions(axes)
    }
}

impl TorqueControl for RecordedBoard {
    fn set_reference_torques(&self, axes: Axes<'_>, torques: &[f64]) -> Outcome<()> {
        self.arm.set_reference_torques(axes, torques)
    }

    fn reference_torques(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.arm.reference_torques(axes)
    }

    fn torques(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.arm.torques(axes)
    }

    fn torque_ranges(&self, axes: Axes<'_>) -> Outcome<Vec<Limits>> {
        let largest = self.largest_torque;
        // Not -0, which has other bytes.
        self.each(axes, Limits::new(0.0 - largest, largest))
    }

    fn motor_torque_parameters(&self, axis: AxisIndex) -> Outcome<MotorTorqueParameters> {
        self.arm.motor_torque_parameters(axis)
    }

    fn set_motor_torque_parameters(
        &self,
        axis: AxisIndex,
        parameters: MotorTorqueParameters,
    ) -> Outcome<()> {
        self.arm.set_motor_torque_parameters(axis, parameters)
    }
}

impl AmplifierControl for RecordedBoard {
    fn enable_amplifiers(&self, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
        self.arm.enable_amplifiers(axes, enabled)
    }

    fn amplifier_status(&self, axes: Axes<'_>) -> Outcome<Vec<i32>> {
        self.each(axes, 0)
    }

    fn amplifier_limit(&self, limit: AmplifierLimit, axis: AxisIndex) -> Outcome<f64> {
        match limit {
            AmplifierLimit::MaxCurrent => {
                Ok(33_000.0 + self.each(axis.into(), 0.0)?.iter().sum::<f64>())
            }
            other => self.arm.amplifier_limit(other, axis),
        }
    }

    fn set_amplifier_limit(
        &self,
        limit: AmplifierLimit,
        axis: AxisIndex,
        value: f64,
    ) -> Outcome<()> {
        self.arm.set_amplifier_limit(limit, axis, value)
    }

    fn amplifier_duty_cycle(&self, axis: AxisIndex) -> Outcome<f64> {
        self.arm.amplifier_duty_cycle(axis)
    }

    fn supply_voltage(&self, axis: AxisIndex) -> Outcome<f64> {
        self.arm.supply_voltage(axis)
    }
}

impl Motor for RecordedBoard {
    fn temperatures(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        axes.check(self.axes())?;
        let degrees = |axis: AxisIndex| 37.5 + axis.index() as f64;
        Ok(axes.iter(self.axes()).map(degrees).collect())
    }

    fn temperature_limit(&self, axis: AxisIndex) -> Outcome<f64> {
        self.arm.temperature_limit(axis)
    }

    fn set_temperature_limit(&self, axis: AxisIndex, limit: f64) -> Outcome<()> {
        self.arm.set_temperature_limit(axis, limit)
    }

    fn gearbox_ratio(&self, axis: AxisIndex) -> Outcome<f64> {
        self.arm.gearbox_ratio(axis)
    }

    fn set_gearbox_ratio(&self, axis: AxisIndex, ratio: f64) -> Outcome<()> {
        self.arm.set_gearbox_ratio(axis, ratio)
    }
}

impl PidControl for RecordedBoard {
    fn available_pids(&self, axis: AxisIndex) -> Outcome<Vec<PidKind>> {
        self.arm.available_pids(axis)
    }

    fn pids(&self, _kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<Pid>> {
        axes.check(self.axes())?;
        let state = self.state();
        let chosen = axes.iter(self.axes()).map(|axis| state.pids[axis.index()]);
        Ok(chosen.collect())
    }

    fn pid_info(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<PidInfo>> {
        self.arm.pid_info(kind, axes)
    }

    fn set_pids(&self, _kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> Outcome<()> {
        axes.check_command(self.axes(), "pids", pids.len())?;
        let mut state = self.state();
        for (axis, pid) in axes.iter(self.axes()).zip(pids) {
            state.pids[axis.index()] = *pid;
        }
        Ok(())
    }

    fn pid_values(&self, kind: PidKind, value: PidValue, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        match value {
            PidValue::Error => self.each(axes, 0.1),
            other => self.arm.pid_values(kind, other, axes),
        }
    }

    fn set_pid_values(
        &self,
        kind: PidKind,
        value: PidValue,
        axes: Axes<'_>,
        values: &[f64],
    ) -> Outcome<()> {
        self.arm.set_pid_values(kind, value, axes, values)
    }

    fn pids_enabled(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<Vec<bool>> {
        self.arm.pids_enabled(kind, axes)
    }

    fn enable_pids(&self, kind: PidKind, axes: Axes<'_>, enabled: bool) -> Outcome<()> {
        self.arm.enable_pids(kind, axes, enabled)
    }

    fn reset_pids(&self, kind: PidKind, axes: Axes<'_>) -> Outcome<()> {
        self.arm.reset_pids(kind, axes)
    }
}
