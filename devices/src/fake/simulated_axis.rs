//! One simulated axis: its mode, its limits, its references, and the path it is on.

use super::axis_motor::{Motor, TORQUE_CONSTANT};
use super::force_drive::Drive;
use super::{MotionState, VelocityProfile};
use crate::{AxisIndex, DeviceError, JointType, Limits, Mode};

/// The slowest reference speed accepted, deg/s or m/s: a move at speed 0 would never end.
const MIN_REFERENCE_SPEED: f64 = 0.001;
/// The weakest reference acceleration accepted, deg/s² or m/s²: with less, a stop would hardly be one.
const MIN_REFERENCE_ACCELERATION: f64 = 0.1;

/// The modes the simulation has.
pub(super) const MODES: [Mode; 8] = [
    Mode::Idle,
    Mode::Position,
    Mode::PositionDirect,
    Mode::Velocity,
    Mode::VelocityDirect,
    Mode::Torque,
    Mode::Current,
    Mode::Pwm,
];

/// Parameters of an axis by construction. Degrees or metres, and seconds.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisParameters {
    /// Distinct among the axes of one device.
    pub name: String,
    /// Revolute or prismatic.
    pub joint_type: JointType,
    /// Range of positions; the limits in force can be narrowed, not widened beyond these.
    pub limits: Limits,
    /// Maximum speed.
    pub max_speed: f64,
    /// Maximum acceleration.
    pub max_acceleration: f64,
    /// Speed of point-to-point moves unless set otherwise.
    pub reference_speed: f64,
    /// Acceleration unless set otherwise.
    pub reference_acceleration: f64,
    /// Position at the start.
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
    path: VelocityProfile,
    /// Used instead of the path while a force drives the axis.
    drive: Option<Drive>,
    /// Per second.
    friction: f64,
    target: f64,
    velocity: f64,
    /// Commanded torque, current or duty cycle, depending on the mode.
    effort: f64,
    reference_speed: f64,
    reference_acceleration: f64,
    /// True if an earlier request exceeded the maximum.
    was_bounded: bool,
    /// Torque that is reported in place of the axis's own.
    virtual_torque: Option<f64>,
    motor: Motor,
}

/// Settings of an axis that its board keeps while it is off.
#[derive(Clone, Debug)]
pub(super) struct AxisSettings {
    limits: Limits,
    max_speed: f64,
    friction: f64,
    reference_speed: f64,
    reference_acceleration: f64,
    motor: Motor,
}

impl Axis {
    pub(super) fn new(index: AxisIndex, built: AxisParameters) -> Self {
        Self {
            index,
            limits: built.limits,
            max_speed: built.max_speed,
            mode: Mode::Position,
            path: VelocityProfile::at_rest(built.home),
            drive: None,
            friction: built.max_acceleration / built.max_speed,
            target: built.home,
            velocity: 0.0,
            effort: 0.0,
            reference_speed: built.reference_speed,
            reference_acceleration: built.reference_acceleration,
            was_bounded: false,
            virtual_torque: None,
            motor: Motor::new(largest_torque(&built) / TORQUE_CONSTANT),
            built,
        }
    }

    pub(super) fn step(&mut self, seconds: f64) {
        match &mut self.drive {
            Some(drive) => drive.advance(seconds),
            None => self.path.advance(seconds),
        }
    }

    pub(super) fn state(&self) -> MotionState {
        match &self.drive {
            Some(drive) => drive.state(),
            None => self.path.state(),
        }
    }

    pub(super) fn motor(&self) -> &Motor {
        &self.motor
    }

    pub(super) fn motor_mut(&mut self) -> &mut Motor {
        &mut self.motor
    }

    /// Sets the torque that is reported from now on; the motion does not change.
    pub(super) fn set_virtual_torque(&mut self, torque: f64) {
        self.virtual_torque = Some(torque);
    }

    /// Returns the torque at the joint, Nm or N: the one set from outside, the commanded one, or that of the path.
    pub(super) fn torque(&self) -> f64 {
        if let Some(torque) = self.virtual_torque {
            return torque;
        }
        let push = match &self.drive {
            Some(drive) => drive.pushed(),
            None => {
                let state = self.path.state();
                state.acceleration + self.friction * state.velocity
            }
        };
        push / push_per_torque(self.built.joint_type)
    }

    pub(super) fn largest_torque(&self) -> f64 {
        largest_torque(&self.built)
    }

    pub(super) fn largest_current(&self) -> f64 {
        self.largest_torque() / TORQUE_CONSTANT
    }

    pub(super) fn current(&self) -> f64 {
        self.torque() / TORQUE_CONSTANT
    }

    /// Percent.
    pub(super) fn duty_cycle(&self) -> f64 {
        100.0 * self.current() / self.largest_current()
    }

    /// Returns the commanded effort in `mode`; 0 in another.
    pub(super) fn effort(&self, mode: Mode) -> f64 {
        if self.mode == mode { self.effort } else { 0.0 }
    }

    /// `asked`: torque, current or duty cycle, depending on `mode`.
    pub(super) fn check_effort(&self, mode: Mode, asked: f64) -> Result<(), DeviceError> {
        let (command, quantity, largest, unit) = match mode {
            Mode::Torque => (
                "torque reference",
                "torque",
                self.largest_torque(),
                torque_unit(self.built.joint_type),
            ),
            Mode::Current => ("current reference", "current", self.largest_current(), "A"),
            _ => ("duty cycle reference", "duty cycle", 100.0, "%"),
        };
        self.check_mode(command, mode)?;
        let allowed = Limits::new(-largest, largest);
        self.check_allowed(quantity, asked, allowed, unit)
    }

    pub(super) fn set_effort(&mut self, mode: Mode, asked: f64) {
        self.effort = asked;
        let torque = match mode {
            Mode::Torque => asked,
            Mode::Current => asked * TORQUE_CONSTANT,
            _ => asked / 100.0 * self.largest_torque(),
        };
        let push = torque * push_per_torque(self.built.joint_type);
        if let Some(drive) = &mut self.drive {
            drive.push(push);
        }
    }

    pub(super) fn friction(&self) -> f64 {
        self.friction
    }

    pub(super) fn set_friction(&mut self, friction: f64) {
        self.friction = friction;
        if let Some(drive) = &mut self.drive {
            drive.set_friction(friction);
        }
    }

    pub(super) fn set_amplifier(&mut self, on: bool) {
        self.motor.amplifier_on = on;
        if !on {
            self.change_mode(Mode::Idle);
        }
    }

    pub(super) fn is_braked(&self) -> bool {
        self.motor.manual_brake || self.motor.auto_brake && self.mode == Mode::Idle
    }

    /// Applying the brake stops the axis.
    pub(super) fn set_manual_brake(&mut self, active: bool) {
        if active && !self.motor.manual_brake {
            self.stop();
        }
        self.motor.manual_brake = active;
    }

    pub(super) fn built(&self) -> &AxisParameters {
        &self.built
    }

    pub(super) fn mode(&self) -> Mode {
        self.mode
    }

    pub(super) fn is_done(&self) -> bool {
        match &self.drive {
            Some(drive) => drive.is_done(),
            None => self.path.is_done(),
        }
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
        self.path = VelocityProfile::towards(
            self.state(),
            target,
            self.reference_speed,
            self.reference_acceleration,
            self.limits_from_here(),
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

    pub(super) fn velocity_move(&mut self, velocity: f64) {
        self.move_at(velocity, self.reference_acceleration);
    }

    pub(super) fn check_direct_position(&self, position: f64) -> Result<(), DeviceError> {
        self.check_mode("direct position", Mode::PositionDirect)?;
        self.check_inside("position", position, self.limits, "")
    }

    /// Moves as fast as the axis can.
    pub(super) fn direct_position(&mut self, position: f64) {
        self.target = position;
        self.path = VelocityProfile::towards(
            self.state(),
            position,
            self.max_speed,
            self.built.max_acceleration,
            self.limits_from_here(),
        );
    }

    pub(super) fn check_direct_velocity(&self, velocity: f64) -> Result<(), DeviceError> {
        self.check_mode("direct velocity", Mode::VelocityDirect)?;
        let allowed = Limits::new(-self.max_speed, self.max_speed);
        self.check_inside("velocity", velocity, allowed, "/s")
    }

    /// Accelerates as hard as the axis can.
    pub(super) fn direct_velocity(&mut self, velocity: f64) {
        self.move_at(velocity, self.built.max_acceleration);
    }

    /// Moving at a velocity is moving to the limit that lies ahead, at that speed.
    fn move_at(&mut self, velocity: f64, acceleration: f64) {
        if velocity == 0.0 {
            return self.stop();
        }
        let ahead = if velocity > 0.0 {
            self.limits.max
        } else {
            self.limits.min
        };
        self.velocity = velocity;
        self.path = VelocityProfile::towards(
            self.state(),
            ahead,
            velocity.abs(),
            acceleration,
            self.limits_from_here(),
        );
    }

    pub(super) fn stop(&mut self) {
        if self.mode == Mode::Idle {
            // It already brakes, harder than this would.
            return;
        }
        self.velocity = 0.0;
        self.effort = 0.0;
        match &mut self.drive {
            Some(drive) => drive.push(0.0),
            None => self.come_to_rest(self.braking()),
        }
    }

    /// A move at maximum acceleration also brakes at the maximum.
    fn braking(&self) -> f64 {
        match self.mode {
            Mode::PositionDirect | Mode::VelocityDirect => self.built.max_acceleration,
            _ => self.reference_acceleration,
        }
    }

    pub(super) fn check_mode_change(&self, mode: Mode) -> Result<(), DeviceError> {
        let joint = self.index;
        match mode {
            Mode::Idle | Mode::ForceIdle => Ok(()),
            mode if !MODES.contains(&mode) => Err(DeviceError::NoSuchMode { joint, mode }),
            _ if !self.motor.amplifier_on => Err(DeviceError::Held {
                joint,
                by: "its amplifier, which is off",
                remedy: "switch it on",
            }),
            _ => Ok(()),
        }
    }

    /// Idle brakes as hard as the axis can, as shorted windings do; an axis driven by a force coasts; the other modes
    /// brake as in a stop.
    pub(super) fn change_mode(&mut self, mode: Mode) {
        let mode = match mode {
            Mode::ForceIdle => Mode::Idle,
            other => other,
        };
        if mode == self.mode {
            return;
        }
        let braking = self.braking();
        self.mode = mode;
        self.velocity = 0.0;
        self.effort = 0.0;
        match mode {
            Mode::Idle => self.come_to_rest(self.built.max_acceleration),
            Mode::Torque | Mode::Current | Mode::Pwm => {
                self.drive = Some(Drive::new(self.state(), self.friction, self.limits));
            }
            _ => self.come_to_rest(braking),
        }
    }

    fn come_to_rest(&mut self, acceleration: f64) {
        let limits = self.limits_from_here();
        self.path = VelocityProfile::stopping(self.state(), acceleration, limits);
        self.target = self.path.target();
        self.drive = None;
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
        let allowed = Limits::new(MIN_REFERENCE_ACCELERATION, f64::MAX);
        self.check_inside("reference acceleration", acceleration, allowed, "/s²")
    }

    /// More than the axis can is as much as it can. Said once, and to the debug log alone: the owner of the model
    /// may hold a lock here that its control loop waits for.
    pub(super) fn set_reference_acceleration(&mut self, acceleration: f64) {
        let most = self.built.max_acceleration;
        if acceleration > most && !self.was_bounded {
            self.was_bounded = true;
            let axis = self.index.index();
            tracing::debug!(axis, acceleration, most, "accelerates as hard as it can");
        }
        self.reference_acceleration = acceleration.min(most);
    }

    pub(super) fn check_encoder(&self, position: f64) -> Result<(), DeviceError> {
        self.check_inside("encoder position", position, self.limits, "")?;
        self.check_at_rest("set its encoder")
    }

    pub(super) fn set_encoder(&mut self, position: f64) {
        self.path = VelocityProfile::at_rest(position);
        self.target = position;
        self.velocity = 0.0;
        if self.drive.is_some() {
            self.effort = 0.0;
            self.drive = Some(Drive::new(self.path.state(), self.friction, self.limits));
        }
    }

    /// Returns the limits in force, widened so that they hold the present position: an axis outside its limits is
    /// moved back by commands alone.
    fn limits_from_here(&self) -> Limits {
        let here = self.state().position;
        Limits::new(self.limits.min.min(here), self.limits.max.max(here))
    }

    /// Puts the axis at rest at a position inside its limits, in any state: as by hand.
    pub(super) fn place(&mut self, position: f64) {
        self.set_encoder(self.limits.clamp(position));
    }

    pub(super) fn set_limits(&mut self, asked: Limits) -> Result<(), DeviceError> {
        let built = self.built.limits;
        self.check_inside("lower position limit", asked.min, built, "")?;
        let above = Limits::new(asked.min, built.max);
        self.check_inside("upper position limit", asked.max, above, "")?;
        self.check_at_rest("change its limits")?;
        // A machine may stand a little outside its limits, which is no reason to refuse one that stays as it is.
        let position = self.state().position;
        let is_below = asked.min > self.limits.min && position < asked.min;
        let is_above = asked.max < self.limits.max && position > asked.max;
        if is_below || is_above {
            self.check_inside("present position", position, asked, "")?;
        }
        self.limits = asked;
        if let Some(drive) = &mut self.drive {
            drive.set_limits(asked);
        }
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

    /// Returns the present settings.
    pub(super) fn settings(&self) -> AxisSettings {
        AxisSettings {
            limits: self.limits,
            max_speed: self.max_speed,
            friction: self.friction,
            reference_speed: self.reference_speed,
            reference_acceleration: self.reference_acceleration,
            motor: self.motor.clone(),
        }
    }

    /// Refuses settings while the axis moves, and limits that it is outside of.
    pub(super) fn check_settings(&self, settings: &AxisSettings) -> Result<(), DeviceError> {
        self.check_at_rest("load its settings")?;
        self.check_inside(
            "present position",
            self.state().position,
            settings.limits,
            "",
        )
    }

    /// Applies settings. Encoders, brakes that are on, amplifiers and references of control loops stay as they are.
    pub(super) fn apply_settings(&mut self, settings: &AxisSettings) {
        self.limits = settings.limits;
        self.max_speed = settings.max_speed;
        self.reference_speed = settings.reference_speed;
        self.reference_acceleration = settings.reference_acceleration;
        self.motor.load(&settings.motor);
        self.set_friction(settings.friction);
        if let Some(drive) = &mut self.drive {
            drive.set_limits(settings.limits);
        }
    }

    fn check_mode(&self, command: &'static str, needed: Mode) -> Result<(), DeviceError> {
        let joint = self.index;
        if self.mode != needed {
            return Err(DeviceError::WrongMode {
                joint,
                command,
                mode: self.mode,
                needed,
            });
        }
        if self.motor.manual_brake {
            return Err(DeviceError::Held {
                joint,
                by: "its brake",
                remedy: "take the brake off",
            });
        }
        Ok(())
    }

    pub(super) fn check_at_rest(&self, what: &'static str) -> Result<(), DeviceError> {
        if self.is_done() {
            return Ok(());
        }
        let joint = self.index;
        Err(DeviceError::Moving { joint, what })
    }

    pub(super) fn check_finite(
        &self,
        quantity: &'static str,
        asked: f64,
    ) -> Result<(), DeviceError> {
        if asked.is_finite() {
            return Ok(());
        }
        Err(DeviceError::NotFinite {
            joint: self.index,
            quantity,
            asked,
        })
    }

    /// `per`: suffix of the unit of position, `/s` for a velocity.
    fn check_inside(
        &self,
        quantity: &'static str,
        asked: f64,
        allowed: Limits,
        per: &'static str,
    ) -> Result<(), DeviceError> {
        self.check_allowed(quantity, asked, allowed, self.unit(per))
    }

    /// `per`: suffix of the unit of position, `/s` for a velocity.
    pub(super) fn unit(&self, per: &str) -> &'static str {
        unit(self.built.joint_type, per)
    }

    pub(super) fn torque_unit(&self) -> &'static str {
        torque_unit(self.built.joint_type)
    }

    pub(super) fn check_allowed(
        &self,
        quantity: &'static str,
        asked: f64,
        allowed: Limits,
        unit: &'static str,
    ) -> Result<(), DeviceError> {
        allowed.check(self.index, quantity, asked, unit)
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

/// Returns the acceleration of a joint of one unit of inertia by one newton metre, or newton.
fn push_per_torque(joint_type: JointType) -> f64 {
    match joint_type {
        JointType::Revolute => 1_f64.to_degrees(),
        JointType::Prismatic | JointType::Unknown => 1.0,
    }
}

/// The torque that gives the largest acceleration.
fn largest_torque(built: &AxisParameters) -> f64 {
    built.max_acceleration / push_per_torque(built.joint_type)
}

fn torque_unit(joint_type: JointType) -> &'static str {
    match joint_type {
        JointType::Revolute => "Nm",
        JointType::Prismatic => "N",
        JointType::Unknown => "units",
    }
}
