//! Axes, encoders, modes and limits.

use yarp_devices::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, DeviceError, EncoderReading, Encoders,
    JointType, Limits, Mode,
};

use yarp_wire::Value;

use super::super::messages::{
    Action, Query, Range, Selection, Set, Setting, joint_type_from_value,
};
use super::RemoteControlBoard;
use super::board_requests::{codes, pair};

impl AxisInfo for RemoteControlBoard {
    fn axes(&self) -> usize {
        self.axes
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        Axes::One(axis).check(self.axes)?;
        self.about(Query::Name, axis)?
            .read(|values| values.first().map(Value::to_plain_string))
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        Axes::One(axis).check(self.axes)?;
        self.about(Query::Type, axis)?
            .read(|values| joint_type_from_value(values.first()?))
    }
}

impl Encoders for RemoteControlBoard {
    /// From the newest state; its time is the board's one time for all joints.
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        axes.check(self.axes)?;
        axes.check_count(self.axes, "slots for readings", out.len())?;
        let latest = &self.link().latest;
        latest.read("encoder reading", |data, time| {
            let positions = data.positions.of(self.axes)?;
            let speeds = data.velocities.of(self.axes);
            let accelerations = data.accelerations.of(self.axes);
            let known = |values: Option<&[f64]>, joint: usize| {
                values.map_or(f64::NAN, |values| values[joint])
            };
            for (slot, axis) in out.iter_mut().zip(axes.iter(self.axes)) {
                let joint = axis.index();
                *slot = EncoderReading {
                    position: positions[joint],
                    speed: known(speeds, joint),
                    acceleration: known(accelerations, joint),
                    time,
                };
            }
            Some(())
        })
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.set(Setting::Encoder, "encoder positions", axes, positions)
    }

    fn reset_encoders(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.act(Action::ResetEncoders, "reset the encoders of", axes)
    }
}

impl ControlMode for RemoteControlBoard {
    /// [`DeviceError::NotSupported`] from 3.x, which has no query for it.
    fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        Axes::One(axis).check(self.axes)?;
        self.asking_4("listing control modes")?;
        self.about(Query::AvailableModes, axis)?
            .read(|values| codes(values.first()?, Mode::from))
    }

    /// From the newest state.
    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        axes.check(self.axes)?;
        axes.check_count(self.axes, "slots for modes", out.len())?;
        let latest = &self.link().latest;
        latest.read("control mode", |data, _| {
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

impl ControlLimits for RemoteControlBoard {
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        Axes::One(axis).check(self.axes)?;
        self.about(Query::Range(Range::Position), axis)?
            .read(limits)
    }

    fn set_position_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.check_limits(axis, "position limit", limits)?;
        self.order(Set::Limits(Range::Position, axis, limits))
    }

    fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        Axes::One(axis).check(self.axes)?;
        self.about(Query::Range(Range::Velocity), axis)?
            .read(limits)
    }

    fn set_velocity_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.check_limits(axis, "velocity limit", limits)?;
        self.order(Set::Limits(Range::Velocity, axis, limits))
    }
}

impl RemoteControlBoard {
    fn check_limits(
        &self,
        axis: AxisIndex,
        quantity: &'static str,
        limits: Limits,
    ) -> Result<(), DeviceError> {
        Axes::One(axis).check(self.axes)?;
        self.check_finite(Axes::One(axis), quantity, &[limits.min])?;
        self.check_finite(Axes::One(axis), quantity, &[limits.max])
    }
}

fn limits(values: &[Value]) -> Option<Limits> {
    pair(values).map(|(min, max)| Limits::new(min, max))
}
