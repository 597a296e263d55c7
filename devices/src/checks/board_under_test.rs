//! Support for the checks: interfaces under test, and waiting.

use std::time::Duration;

use super::polling::wait_until;
use crate::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, EncoderReading, Encoders,
    Limits, Mode, PositionControl, VelocityControl,
};

/// Tolerance of the position of a simulated joint at rest, in the unit of the axis.
pub(super) const POSITION_TOLERANCE: f64 = 1e-6;
/// Distance of test moves.
pub(super) const DISTANCE: f64 = 3.0;

/// A device with the interfaces that most checks need, every joint in position mode.
pub(super) struct Board<'a> {
    pub(super) info: &'a dyn AxisInfo,
    pub(super) position: &'a dyn PositionControl,
    velocity: Option<&'a dyn VelocityControl>,
    pub(super) encoders: &'a dyn Encoders,
    pub(super) modes: &'a dyn ControlMode,
    pub(super) limits: &'a dyn ControlLimits,
    pub(super) total: usize,
    timeout: Duration,
}

impl<'a> Board<'a> {
    pub(super) fn new(device: &'a dyn Device, timeout: Duration) -> Self {
        let info = device.axis_info().expect("it has axis info");
        let board = Self {
            info,
            position: device.position_control().expect("it has position control"),
            velocity: device.velocity_control(),
            encoders: device.encoders().expect("it has encoders"),
            modes: device.control_mode().expect("it has control modes"),
            limits: device.control_limits().expect("it has control limits"),
            total: info.axes(),
            timeout,
        };
        assert!(board.total >= 2, "the checks need two joints");
        // Behind a network the first reading may still be on its way.
        board.eventually("a first reading", || {
            board.encoders.encoder_readings(Axes::All).is_ok()
        });
        board.set_mode(Mode::Position);
        board
    }

    /// Not every arm has it.
    pub(super) fn velocity(&self) -> &'a dyn VelocityControl {
        self.velocity.expect("it has velocity control")
    }

    pub(super) fn indices(&self) -> impl Iterator<Item = AxisIndex> + use<> {
        (0..self.total).map(AxisIndex::from)
    }

    pub(super) fn readings(&self) -> Vec<EncoderReading> {
        self.encoders
            .encoder_readings(Axes::All)
            .expect("it has readings")
    }

    pub(super) fn reading(&self, axis: AxisIndex) -> EncoderReading {
        self.readings()[axis.index()]
    }

    pub(super) fn at(&self, axis: AxisIndex) -> f64 {
        self.reading(axis).position
    }

    pub(super) fn position_limits(&self, axis: AxisIndex) -> Limits {
        self.limits
            .position_limits(axis)
            .expect("each axis has limits")
    }

    pub(super) fn max_speed(&self, axis: AxisIndex) -> f64 {
        self.limits
            .velocity_limits(axis)
            .expect("each axis has limits")
            .max
    }

    /// A place a little nearer to the middle of the range.
    pub(super) fn inward(&self, axis: AxisIndex) -> f64 {
        let here = self.at(axis);
        here + DISTANCE.copysign(self.far_end(axis) - here)
    }

    /// The limit farther away.
    pub(super) fn far_end(&self, axis: AxisIndex) -> f64 {
        let (here, limits) = (self.at(axis), self.position_limits(axis));
        if limits.max - here > here - limits.min {
            limits.max
        } else {
            limits.min
        }
    }

    pub(super) fn set_mode(&self, mode: Mode) {
        self.indices().for_each(|axis| self.set_mode_of(axis, mode));
    }

    pub(super) fn set_mode_of(&self, axis: AxisIndex, mode: Mode) {
        self.modes
            .set_control_modes(axis.into(), &[mode])
            .expect("it has this mode");
        self.eventually("the mode set", || {
            self.modes
                .control_modes(axis.into())
                .is_ok_and(|modes| modes == [mode])
        });
    }

    pub(super) fn arrives(&self, axis: AxisIndex, target: f64) {
        self.eventually("the end of the motion", || {
            self.position.motion_done(axis.into()).expect("it answers")
        });
        self.eventually("rest at the target", || {
            let now = self.reading(axis);
            (now.position - target).abs() < POSITION_TOLERANCE && now.speed == 0.0
        });
    }

    /// Stops a velocity, and goes back to positions.
    pub(super) fn velocity_ends(&self, axes: Axes<'_>) {
        self.velocity().stop(axes).expect("it can always stop");
        self.rests();
        self.set_mode(Mode::Position);
    }

    pub(super) fn rests(&self) {
        self.eventually("rest", || {
            self.readings().iter().all(|now| now.speed == 0.0)
        });
    }

    /// Waits until a fifth of a second has passed by the device's clock.
    pub(super) fn time_passes(&self) {
        let start = self.reading(0.into()).time;
        self.eventually("newer readings", || {
            self.reading(0.into()).time > start + 0.2
        });
    }

    pub(super) fn eventually(&self, what: &str, condition: impl Fn() -> bool) {
        wait_until(what, self.timeout, condition);
    }
}
