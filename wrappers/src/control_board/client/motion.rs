//! Position and velocity control.

use yarp_devices::{Axes, DeviceError, MotionControl, PositionControl, VelocityControl};

use super::super::messages::{Command, Get, Quantity, Selection, Set, Setting};
use super::RemoteControlBoard;

impl MotionControl for RemoteControlBoard {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(self.axes)?;
        if axes.len(self.axes) == 0 {
            return Ok(());
        }
        self.order(Set::Stop(Selection::from(axes)))
    }

    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError> {
        let setting = Setting::ReferenceAcceleration;
        self.set(setting, "reference accelerations", axes, accelerations)
    }

    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.values(Quantity::ReferenceAcceleration, axes)
    }
}

impl PositionControl for RemoteControlBoard {
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        self.set(Setting::Position, "target positions", axes, targets)
    }

    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        self.set(Setting::Distance, "distances", axes, distances)
    }

    fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        axes.check(self.axes)?;
        if axes.len(self.axes) == 0 {
            return Ok(true);
        }
        self.ask(Get::MotionDone(Selection::from(axes)))?
            .read(|reply| reply.count().map(|done| done != 0))
    }

    fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.values(Quantity::TargetPosition, axes)
    }

    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Result<(), DeviceError> {
        self.set(Setting::ReferenceSpeed, "reference speeds", axes, speeds)
    }

    fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.values(Quantity::ReferenceSpeed, axes)
    }
}

impl VelocityControl for RemoteControlBoard {
    /// Sent and not waited for: what the board refuses is not heard of.
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        axes.check_command(self.axes, "velocities", velocities.len())?;
        self.check_finite(axes, "velocity", velocities)?;
        if velocities.is_empty() {
            return Ok(());
        }
        let command = Command::velocity(&Selection::from(axes), velocities);
        self.link().stream(command)
    }

    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.values(Quantity::ReferenceVelocity, axes)
    }
}

impl RemoteControlBoard {
    /// Asks for one number per joint.
    fn values(&self, quantity: Quantity, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(self.axes)?;
        let expected = axes.len(self.axes);
        if expected == 0 {
            return Ok(Vec::new());
        }
        let selection = quantity.words().sayable(axes, self.axes, "ask about")?;
        let one = matches!(selection, Selection::One(_));
        self.ask(Get::Values(quantity, selection))?.read(|reply| {
            if one {
                reply.float().map(|value| vec![value])
            } else {
                reply.floats(expected)
            }
        })
    }

    /// Orders one number per joint; `what` they are, for the errors.
    pub(super) fn set(
        &self,
        setting: Setting,
        what: &'static str,
        axes: Axes<'_>,
        values: &[f64],
    ) -> Result<(), DeviceError> {
        axes.check_command(self.axes, what, values.len())?;
        self.check_finite(axes, what, values)?;
        if values.is_empty() {
            return Ok(());
        }
        let selection = setting.words().sayable(axes, self.axes, "set")?;
        self.order(Set::Values(setting, selection, values.to_vec()))
    }

    /// Not every board checks this, so nothing else leaves here.
    pub(super) fn check_finite(
        &self,
        axes: Axes<'_>,
        quantity: &'static str,
        values: &[f64],
    ) -> Result<(), DeviceError> {
        let mut pairs = axes.iter(self.axes).zip(values);
        match pairs.find(|(_, value)| !value.is_finite()) {
            Some((joint, &asked)) => Err(DeviceError::NotFinite {
                joint,
                quantity,
                asked,
            }),
            None => Ok(()),
        }
    }
}
