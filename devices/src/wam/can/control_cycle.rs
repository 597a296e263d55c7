//! Messages of a control period on the bus.

use std::time::{Duration, Instant};

use tracing::warn;

use super::arm_startup::{PuckUnits, compare};
use super::can_error::AtStep;
use super::property_request::PropertyRequest;
use super::puck_bus::{MAX_FRAMES_PER_REPLY, PuckBus};
use super::puck_health::{PuckHealth, puck_limit};
use super::{CanError, CanErrorKind, CanOptions, CanStep, PositionRecord};
use crate::can::BusError;
use crate::can::puck::{Group, Node, Pendant, PuckMessage, PuckProperty, mode};
use crate::kinematics::Joints;
use crate::simulation::SafetyMode;
use crate::wam::{AXES, Motor, WamModel};

/// Number of periods between queries for the mode of the safety module, and maximum number of unanswered queries.
const SAFETY_POLL_PERIODS: u64 = 10;
const MAX_UNANSWERED_POLLS: u32 = 10;
/// Number of periods between queries for the health of one of the pucks, and while a value waits for its confirmation:
/// each of three properties of seven pucks twice a second, of four more often.
const HEALTH_POLL_PERIODS: u64 = 10;
const CONFIRMATION_POLL_PERIODS: u64 = 5;
/// Maximum plausible change of a rotor's position in a period: a turn divided by this (btclient).
const MAX_TURN_DIVISOR: f64 = 4.0;
/// Maximum time between two control periods, less than a puck takes to restart (0.5 s): after more, positions are compared
/// as after a lost connection, for the plausible change of a count grows with the time.
const MAX_STALL: Duration = Duration::from_millis(400);
/// The largest torque there is room for: 13 bits and a sign.
const MAX_TORQUE_UNITS: f64 = 8191.0;

/// An arm that is ready for control.
pub(super) struct ControlCycle<const N: usize> {
    bus: PuckBus,
    units: Vec<PuckUnits>,
    /// Groups in which positions are queried, each once.
    groups: Vec<Group>,
    /// Groups of torque frames, each once.
    torque_groups: Vec<Group>,
    options: CanOptions<N>,
    counts_per_turn: f64,
    counts: [i32; N],
    missed: [u32; N],
    /// Time of each accepted position.
    seen: [Instant; N],
    model: WamModel<N>,
    /// Origins of the pucks' positions when the connection was made.
    origins: [Option<i32>; N],
    /// Start of the last control period.
    last_cycle: Option<Instant>,
    cycles: u64,
    unanswered: u32,
    safety: Option<SafetyMode>,
    pendant: Option<Pendant>,
    missed_replies: u64,
    /// The query of a caller, and its deadline.
    property_request: Option<(PropertyRequest, Instant)>,
    health: PuckHealth<N>,
    /// The error of a puck that was found while frames were read.
    unhealthy: Option<CanErrorKind>,
}

impl<const N: usize> ControlCycle<N> {
    pub(super) fn new(
        bus: PuckBus,
        units: Vec<PuckUnits>,
        model: &WamModel<N>,
        options: &CanOptions<N>,
        position: &PositionRecord<N>,
    ) -> Self {
        let counts = position.counts;
        let limit = |motor: usize| {
            units
                .get(motor)
                .map(|unit: &PuckUnits| unit.temperature_limit)
        };
        let limits = std::array::from_fn(|motor| puck_limit(limit(motor)));
        Self {
            bus,
            model: model.clone(),
            origins: position.origins,
            groups: distinct(units.iter().map(|unit| unit.group)),
            torque_groups: distinct(units.iter().map(|unit| unit.torque_group)),
            health: PuckHealth::new(limits),
            unhealthy: None,
            units,
            options: options.clone(),
            counts_per_turn: f64::from(model.transmission.counts_per_turn()),
            counts,
            missed: [0; N],
            seen: [Instant::now(); N],
            last_cycle: None,
            cycles: 0,
            unanswered: 0,
            safety: None,
            pendant: None,
            missed_replies: 0,
            property_request: None,
        }
    }

    /// Returns whether no query of a caller is in progress.
    pub(super) fn is_free(&self) -> bool {
        self.property_request.is_none()
    }

    /// Asks what a caller wants to know; the answer is taken note of when it comes.
    pub(super) fn run(&mut self, property_request: PropertyRequest) -> Result<(), CanError> {
        let (node, property) = (property_request.node, property_request.property);
        if let Some(value) = property_request.value {
            self.bus
                .set_property(node, property, value)
                .at_step(CanStep::PropertyRequest)?;
        }
        self.bus
            .send(node, PuckMessage::Get(property))
            .at_step(CanStep::PropertyRequest)?;
        self.property_request = Some((
            property_request,
            Instant::now() + self.options.property_timeout,
        ));
        Ok(())
    }

    /// Returns the temperatures of the pucks, °C; `None` before the first reply.
    pub(super) fn temperatures(&self) -> [Option<i32>; N] {
        self.health.temperatures()
    }

    /// Returns the health of the pucks.
    pub(super) fn health(&self) -> &PuckHealth<N> {
        &self.health
    }

    /// Returns the motors as the pucks describe them, in place of the model's.
    pub(super) fn motors(&self, model: &WamModel<N>) -> [Motor; N] {
        let mut motors = model.motors;
        for (motor, units) in motors.iter_mut().zip(&self.units) {
            motor.units_per_newton_metre = units.per_newton_metre;
            motor.limit = units.largest;
        }
        motors
    }

    /// Returns the mode that the safety module allows; `None` before its first reply.
    pub(super) fn safety(&self) -> Option<SafetyMode> {
        self.safety
    }

    /// Returns the state of the pendant while the arm is not active.
    pub(super) fn pendant(&self) -> Option<Pendant> {
        self.pendant
    }

    /// Returns the number of positions that have not arrived in time so far.
    pub(super) fn missed_replies(&self) -> u64 {
        self.missed_replies
    }

    /// Queries the positions of all pucks and waits for them; a missing one counts as unchanged.
    pub(super) fn positions(&mut self) -> Result<[i32; N], CanError> {
        let now = Instant::now();
        let last = self.last_cycle.replace(now).unwrap_or(now);
        if now.saturating_duration_since(last) > MAX_STALL {
            warn!("the control was interrupted for {:?}", now - last);
            let known = PositionRecord {
                counts: self.counts,
                origins: self.origins,
            };
            compare(&mut self.bus, &self.model, &known).at_step(CanStep::Positions)?;
        }
        self.forget_stale().at_step(CanStep::Positions)?;
        self.watch().at_step(CanStep::SafetyPoll)?;
        let start = Instant::now();
        for &group in &self.groups {
            let question = PuckMessage::Get(PuckProperty::P);
            self.bus.send(group, question).at_step(CanStep::Positions)?;
        }
        let deadline = start + self.options.reply_timeout;
        let mut come = [false; N];
        let mut left = MAX_FRAMES_PER_REPLY;
        while !come.iter().all(|&come| come) {
            let heard = self.bus.receive_message(deadline, &mut left);
            let Some((from, message)) = heard.at_step(CanStep::Positions)? else {
                break;
            };
            self.note(from, message);
            if let PuckMessage::Position { motor: counts, .. } = message
                && let Some(motor) = from.motor(N)
                && self.is_believable(motor, counts, start)
            {
                come[motor] = true;
                self.counts[motor] = counts;
                self.seen[motor] = start;
            }
        }
        self.cycles += 1;
        if let Some(error) = self.unhealthy.take() {
            return Err(error).at_step(CanStep::PuckHealth);
        }
        for (motor, come) in come.into_iter().enumerate() {
            self.missed[motor] = if come { 0 } else { self.missed[motor] + 1 };
            self.missed_replies += u64::from(!come);
            if self.missed[motor] > self.options.max_missed_replies {
                let node = Node::of_motor(motor);
                return Err(CanErrorKind::Silent { node }).at_step(CanStep::Positions);
            }
        }
        Ok(self.counts)
    }

    /// Answers that came after the end of their period.
    fn forget_stale(&mut self) -> Result<(), BusError> {
        let now = Instant::now();
        let mut left = MAX_FRAMES_PER_REPLY;
        while let Some((from, message)) = self.bus.receive_message(now, &mut left)? {
            self.note(from, message);
        }
        // The waiting caller learns that no reply arrived.
        self.property_request
            .take_if(|(_, deadline)| now > *deadline);
        Ok(())
    }

    /// A rotor cannot have turned further than so; in a longer time it can go further.
    fn is_believable(&self, motor: usize, counts: i32, now: Instant) -> bool {
        let time = now.saturating_duration_since(self.seen[motor]);
        let most = max_change(self.counts_per_turn, time, self.options.period);
        f64::from(counts.abs_diff(self.counts[motor])) <= most
    }

    /// Queries the mode of the safety module, and the state of the pendant when the arm is not active; now and then
    /// the health of a puck.
    fn watch(&mut self) -> Result<(), CanErrorKind> {
        let interval = match self.health.is_in_doubt() {
            true => CONFIRMATION_POLL_PERIODS,
            false => HEALTH_POLL_PERIODS,
        };
        if self.cycles % interval == interval / 2 {
            let (node, property) = self.health.question();
            self.bus.send(node, PuckMessage::Get(property))?;
        }
        if !self.cycles.is_multiple_of(SAFETY_POLL_PERIODS) {
            return Ok(());
        }
        if self.unanswered >= MAX_UNANSWERED_POLLS {
            return Err(CanErrorKind::Silent { node: Node::SAFETY });
        }
        self.unanswered += 1;
        self.bus
            .send(Node::SAFETY, PuckMessage::Get(PuckProperty::MODE))?;
        if self.safety.is_some() && self.safety != Some(SafetyMode::Active) {
            self.bus
                .send(Node::SAFETY, PuckMessage::Get(PuckProperty::PEN))?;
        }
        Ok(())
    }

    /// Records messages of the safety module and of other nodes.
    fn note(&mut self, from: Node, message: PuckMessage) {
        if let Err(error) = check_motor::<N>(from) {
            self.unhealthy = Some(error);
        }
        let PuckMessage::Value { property, value } = message else {
            return;
        };
        let asked = |(property_request, _): &mut (PropertyRequest, Instant)| {
            (property_request.node, property_request.property) == (from, property)
        };
        if let Some((property_request, _)) = self.property_request.take_if(asked) {
            // The caller may have stopped waiting.
            let _ = property_request.answer.try_send(value);
        }
        if let Some(motor) = from.motor(N)
            && let Err(error) = self.health.note(motor, property, value)
        {
            self.unhealthy = Some(error);
        }
        if from != Node::SAFETY {
            return;
        }
        if property == PuckProperty::MODE {
            let now = match value {
                mode::IDLE_OR_STOPPED => SafetyMode::EmergencyStop,
                mode::SAFETY_IDLE => SafetyMode::Idle,
                mode::TORQUE_OR_ACTIVE => SafetyMode::Active,
                _ => return,
            };
            self.unanswered = 0;
            self.safety = Some(now);
            if now == SafetyMode::Active {
                self.pendant = None;
            }
        } else if property == PuckProperty::PEN {
            self.pendant = Some(Pendant::of_bits(value));
        }
    }

    /// Sends torques, Nm at the joints, as whole units of the motors.
    pub(super) fn drive(
        &mut self,
        model: &WamModel<N>,
        torques: &Joints<N>,
    ) -> Result<(), CanError> {
        let motors = model.transmission.motor_torques(torques);
        for &group in &self.torque_groups {
            let mut slots = [0; 4];
            for (motor, unit) in self.units.iter().enumerate() {
                if unit.torque_group == group {
                    slots[unit.slot] = command(unit, motors[motor]);
                }
            }
            let message = PuckMessage::Torques(slots);
            self.bus.send(group, message).at_step(CanStep::Torques)?;
        }
        Ok(())
    }

    /// Returns the error with its cause: a puck that the emergency stop has switched off is silent.
    pub(super) fn explain(&mut self, error: CanError) -> CanError {
        match error.kind {
            CanErrorKind::Silent { node }
                if node != Node::SAFETY && self.bus.is_stopped() == Ok(true) =>
            {
                CanError {
                    kind: CanErrorKind::EmergencyStop,
                    ..error
                }
            }
            _ => error,
        }
    }

    /// Commands the safety module to brake the arm, if it is still reachable.
    pub(super) fn brake(&mut self) {
        // Where it does not, it brakes by itself: torques have ended.
        let _ = self
            .bus
            .set_property(Node::SAFETY, PuckProperty::MODE, mode::SAFETY_IDLE);
        let _ = self.bus.discard_for(Duration::from_millis(1));
    }
}

/// Refuses a motor that an arm with `N` joints does not have: it may have been asleep or unplugged at the start.
fn check_motor<const N: usize>(node: Node) -> Result<(), CanErrorKind> {
    match node.motor(AXES) {
        Some(motor) if motor >= N => Err(CanErrorKind::UnexpectedMotor { node, joints: N }),
        _ => Ok(()),
    }
}

/// Returns the largest plausible change of a rotor's position in a time, counts.
fn max_change(counts_per_turn: f64, time: Duration, period: Duration) -> f64 {
    let periods = time.as_secs_f64() / period.as_secs_f64();
    counts_per_turn / MAX_TURN_DIVISOR * periods.max(1.0)
}

/// Returns the command of a motor for a torque, Nm: rounded down, as libbarrett does, within what the puck follows.
fn command(unit: &PuckUnits, torque: f64) -> i16 {
    let most = unit.largest.min(MAX_TORQUE_UNITS);
    let units = (unit.per_newton_metre * torque).floor();
    // What is no number becomes 0.
    units.clamp(-most, most) as i16
}

fn distinct(groups: impl Iterator<Item = Group>) -> Vec<Group> {
    let mut found = Vec::new();
    for group in groups {
        if !found.contains(&group) {
            found.push(group);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotor_turns_by_a_quarter_per_period_at_most() {
        let period = Duration::from_millis(2);
        let most = |counts: f64, millis| max_change(counts, Duration::from_millis(millis), period);
        assert_eq!([most(4096.0, 2), most(4096.0, 1)], [1024.0, 1024.0]);
        assert_eq!([most(4096.0, 6), most(40960.0, 2)], [3072.0, 10240.0]);
    }

    #[test]
    fn commands_are_rounded_down_within_the_limit() {
        let unit = |largest| PuckUnits {
            per_newton_metre: 2700.0,
            largest,
            torque_group: Group::LOWER_TORQUES,
            slot: 0,
            group: Group::ARM,
            temperature_limit: 60,
        };
        let puck = unit(4320.0);
        let commands = [0.001, -0.001, 0.0009].map(|torque| command(&puck, torque));
        assert_eq!(commands, [2, -3, 2]);
        let commands = [1.7, -1.7, f64::NAN].map(|torque| command(&puck, torque));
        assert_eq!(commands, [4320, -4320, 0]);
        assert_eq!(command(&unit(1e6), 100.0), 8191);
    }
}
