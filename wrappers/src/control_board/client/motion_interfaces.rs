//! Position and velocity control.

use yarp_devices::{
    Axes, DeviceError, MotionControl, PositionControl, PositionDirect, VelocityControl,
    VelocityDirect,
};

use super::super::messages::{Action, Get, Quantity, Query, Selection, Setting, read_flag};
use super::RemoteControlBoard;

impl MotionControl for RemoteControlBoard {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.act(Action::Stop, "stop", axes)
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
        self.ask(Get::About(Query::MotionDone, Selection::from(axes)))?
            .read(|values| read_flag(values.first()?))
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
    /// Sent without waiting: a refusal of the board is not reported.
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.set(Setting::Velocity, "velocities", axes, velocities)
    }

    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.values(Quantity::ReferenceVelocity, axes)
    }
}

impl PositionDirect for RemoteControlBoard {
    /// Sent without waiting: a refusal of the board is not reported.
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.set(Setting::DirectPosition, "positions", axes, positions)
    }

    fn direct_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.values(Quantity::DirectPosition, axes)
    }
}

impl VelocityDirect for RemoteControlBoard {
    /// Sent without waiting: a refusal of the board is not reported.
    fn set_direct_velocities(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.set(Setting::DirectVelocity, "velocities", axes, velocities)
    }

    fn direct_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.values(Quantity::DirectVelocity, axes)
    }
}
