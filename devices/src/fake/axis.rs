//! One simulated axis: its mode, its limits, its references, and the path it is on.

use super::{MotionState, Profile};
use crate::{AxisIndex, DeviceError, JointType, Limits, Mode};

/// The slowest reference speed accepted, deg/s or m/s: a move at speed 0 would never end.
const MIN_REFERENCE_SPEED: f64 = 0.001;
/// The weakest reference acceleration accepted, deg/s² or m/s²: with less, a stop would hardly be one.
const MIN_REFERENCE_ACCELERATION: f64 = 0.1;

/// The modes the simulation has.
pub(super) const MODES: [Mode; 3] = [Mode::Idle, Mode::Position, Mode::Velocity];

/// What an axis was built like. Degrees or metres, and seconds.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisParameters {
    /// Distinct among the axes of one device.
    pub name: String,
    /// Whether it turns or slides.
    pub joint_type: JointType,
    /// Where it may be; the limits in force can be drawn closer, not widened beyond these.
    pub limits: Limits,
    /// How fast it may move.
    pub max_speed: f64,
    /// How hard it may accelerate.
    pub max_acceleration: f64,
    /// How fast point-to-point moves become unless told otherwise.
    pub reference_speed: f64,
    /// How hard it accelerates unless told otherwise.
    pub reference_acceleration: f64,
    /// Where it is at the start.
    pub home: f64,
}

/// Checks are separate from actions, so that a command for several axes can be checked completely before
/// anything moves. Every action expects that its check has passed.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    index: AxisIndex,
    built: AxisParameters,
    limits: Limits,
    max_speed: f64,
    mode: Mode,
    path: Profile,
    target: f64,
    velocity: f64,
    reference_speed: f64,
    reference_acceleration: f64,
}

impl Axis {
    pub(super) fn new(index: AxisIndex, built: AxisParameters) -> Self {
        Self {
            index,
            limits: built.limits,
            max_speed: built.max_speed,
            mode: Mode::Position,
            path: Profile::at_rest(built.home),
            target: built.home,
            velocity: 0.0,
            reference_speed: built.reference_speed,
            reference_acceleration: built.reference_acceleration,
            built,
        }
    }

    pub(super) fn step(&mut self, seconds: f64) {
        self.path.advance(seconds);
    }

    pub(super) fn state(&self) -> MotionState {
        self.path.state()
    }

    pub(super) fn built(&self) -> &AxisParameters {
        &self.built
    }

    pub(super) fn mode(&self) -> Mode {
        self.mode
    }

    pub(super) fn is_done(&self) -> bool {
        self.path.is_done()
    }

    pub(super) fn target(&self) -> f64 {
        self.target
    }

    pub(super) fn velocity(&self) -> f64 {
        self.velocity
    }

    pub(super) fn reference_speed(&self) -> f64 {
        self.reference_speed
    }

    pub(super) fn reference_acceleration(&self) -> f64 {
        self.reference_acceleration
    }

    pub(super) fn limits(&self) -> Limits {
        self.limits
    }

    pub(super) fn velocity_limits(&self) -> Limits {
        Limits::new(0.0, self.max_speed)
    }

    pub(super) fn check_position_move(&self, target: f64) -> Result<(), DeviceError> {
        self.check_mode("position move", Mode::Position)?;
        self.check_inside("position", target, self.limits, "")
    }

    pub(super) fn position_move(&mut self, target: f64) {
        self.target = target;
        self.path = Profile::towards(
            self.state(),
            target,
            self.reference_speed,
            self.reference_acceleration,
            self.limits,
        );
    }

    pub(super) fn check_relative_move(&self, distance: f64) -> Result<(), DeviceError> {
        self.check_finite("distance", distance)?;
        self.check_position_move(self.state().position + distance)
    }

    pub(super) fn relative_move(&mut self, distance: f64) {
        self.position_move(self.state().position + distance);
    }

    pub(super) fn check_velocity_move(&self, velocity: f64) -> Result<(), DeviceError> {
        self.check_mode("velocity move", Mode::Velocity)?;
        let allowed = Limits::new(-self.max_speed, self.max_speed);
        self.check_inside("velocity", velocity, allowed, "/s")
    }

    /// Moving at a velocity is moving to the limit that lies ahead, at that speed.
    pub(super) fn velocity_move(&mut self, velocity: f64) {
        if velocity == 0.0 {
            return self.stop();
        }
        let ahead = if velocity > 0.0 {
            self.limits.max
        } else {
            self.limits.min
        };
        self.velocity = velocity;
        self.path = Profile::towards(
            self.state(),
            ahead,
            velocity.abs(),
            self.reference_acceleration,
            self.limits,
        );
    }

    pub(super) fn stop(&mut self) {
        if self.mode == Mode::Idle {
            // It already brakes, harder than this would.
            return;
        }
        self.velocity = 0.0;
        self.come_to_rest(self.reference_acceleration);
    }

    pub(super) fn check_mode_change(&self, mode: Mode) -> Result<(), DeviceError> {
        if MODES.contains(&mode) || mode == Mode::ForceIdle {
            return Ok(());
        }
        let joint = self.index;
        Err(DeviceError::NoSuchMode { joint, mode })
    }

    /// Idle brakes as hard as the axis can, as shorted windings do; the other modes as in a stop.
    pub(super) fn change_mode(&mut self, mode: Mode) {
        let mode = match mode {
            Mode::ForceIdle => Mode::Idle,
            other => other,
        };
        if mode == self.mode {
            return;
        }
        self.mode = mode;
        match mode {
            Mode::Idle => {
                self.velocity = 0.0;
                self.come_to_rest(self.built.max_acceleration);
            }
            _ => self.stop(),
        }
    }

    fn come_to_rest(&mut self, acceleration: f64) {
        self.path = Profile::stopping(self.state(), acceleration, self.limits);
        self.target = self.path.target();
    }

    pub(super) fn check_reference_speed(&self, speed: f64) -> Result<(), DeviceError> {
        let allowed = Limits::new(MIN_REFERENCE_SPEED, self.max_speed);
        self.check_inside("reference speed", speed, allowed, "/s")
    }

    pub(super) fn set_reference_speed(&mut self, speed: f64) {
        self.reference_speed = speed;
    }

    pub(super) fn check_reference_acceleration(
        &self,
        acceleration: f64,
    ) -> Result<(), DeviceError> {
        let allowed = Limits::new(MIN_REFERENCE_ACCELERATION, self.built.max_acceleration);
        self.check_inside("reference acceleration", acceleration, allowed, "/s²")
    }

    pub(super) fn set_reference_acceleration(&mut self, acceleration: f64) {
        self.reference_acceleration = acceleration;
    }

    pub(super) fn check_encoder(&self, position: f64) -> Result<(), DeviceError> {
        self.check_inside("encoder position", position, self.limits, "")?;
        self.check_at_rest("set its encoder")
    }

    pub(super) fn set_encoder(&mut self, position: f64) {
        self.path = Profile::at_rest(position);
        self.target = position;
        self.velocity = 0.0;
    }

    /// Puts the axis to rest at a place inside its limits, whatever it does: as by hand.
    pub(super) fn place(&mut self, position: f64) {
        self.set_encoder(self.limits.clamp(position));
    }

    pub(super) fn set_limits(&mut self, asked: Limits) -> Result<(), DeviceError> {
        let built = self.built.limits;
        self.check_inside("lower position limit", asked.min, built, "")?;
        let above = Limits::new(asked.min, built.max);
        self.check_inside("upper position limit", asked.max, above, "")?;
        self.check_at_rest("change its limits")?;
        self.check_inside("present position", self.state().position, asked, "")?;
        self.limits = asked;
        Ok(())
    }

    pub(super) fn set_velocity_limits(&mut self, asked: Limits) -> Result<(), DeviceError> {
        let none = Limits::new(0.0, 0.0);
        self.check_inside("lower velocity limit", asked.min, none, "/s")?;
        let allowed = Limits::new(MIN_REFERENCE_SPEED, self.built.max_speed);
        self.check_inside("upper velocity limit", asked.max, allowed, "/s")?;
        self.check_at_rest("change its limits")?;
        self.max_speed = asked.max;
        self.reference_speed = self.reference_speed.min(asked.max);
        Ok(())
    }

    fn check_mode(&self, command: &'static str, needed: Mode) -> Result<(), DeviceError> {
        if self.mode == needed {
            return Ok(());
        }
        Err(DeviceError::WrongMode {
            joint: self.index,
            command,
            mode: self.mode,
            needed,
        })
    }

    fn check_at_rest(&self, what: &'static str) -> Result<(), DeviceError> {
        if self.path.is_done() {
            return Ok(());
        }
        let joint = self.index;
        Err(DeviceError::Moving { joint, what })
    }

    fn check_finite(&self, quantity: &'static str, asked: f64) -> Result<(), DeviceError> {
        if asked.is_finite() {
            return Ok(());
        }
        Err(DeviceError::NotFinite {
            joint: self.index,
            quantity,
            asked,
        })
    }

    /// `per`: what follows the unit of position, `/s` for a velocity.
    fn check_inside(
        &self,
        quantity: &'static str,
        asked: f64,
        allowed: Limits,
        per: &'static str,
    ) -> Result<(), DeviceError> {
        self.check_finite(quantity, asked)?;
        if allowed.contains(asked) {
            return Ok(());
        }
        Err(DeviceError::OutOfRange {
            joint: self.index,
            quantity,
            asked,
            min: allowed.min,
            max: allowed.max,
            unit: unit(self.built.joint_type, per),
        })
    }
}

fn unit(joint_type: JointType, per: &str) -> &'static str {
    match (joint_type, per) {
        (JointType::Revolute, "") => "deg",
        (JointType::Revolute, "/s") => "deg/s",
        (JointType::Revolute, _) => "deg/s²",
        (JointType::Prismatic, "") => "m",
        (JointType::Prismatic, "/s") => "m/s",
        (JointType::Prismatic, _) => "m/s²",
        (JointType::Unknown, _) => "units",
    }
}
