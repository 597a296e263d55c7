//! The puck of one motor.

use super::puck_start::{PuckStart, WakeUp};
use crate::can::puck::{Group, Node, PuckMessage, PuckProperty, Target, mode, role, status};
use crate::simulation::{MAX_TEMPERATURE, REST_TEMPERATURE, SUPPLY_VOLTAGE};
use crate::wam::Motor;

/// Version of the firmware whose property list is published whole.
const VERSION: i32 = 200;
/// MotorSet that one frame of torques is for.
const SLOTS: usize = 4;

#[derive(Clone, Debug)]
pub(super) struct MotorPuck {
    start: PuckStart,
    mode: i32,
    /// Offset of the count from the rotor's position.
    offset: i32,
    /// Counts per turn.
    turn: i32,
    torque: i16,
    slot: usize,
    torque_group: Group,
    /// °C.
    temperature: i32,
    /// Temperature that a test gives it, °C, in place of that of its motor.
    forced_temperature: Option<i32>,
    /// Value of `ERROR` while the puck is in its error state.
    error: Option<i32>,
    /// Properties that stay as they were set.
    values: [Option<i32>; 128],
}

impl MotorPuck {
    /// A puck after power-up: its rotor's angle is known inside one turn.
    pub(super) fn switched_on(
        motor: usize,
        of: &Motor,
        turn: i32,
        counts: i32,
        wake_up: WakeUp,
    ) -> Self {
        let upper = motor >= SLOTS;
        let torque_group = if upper {
            Group::UPPER_TORQUES
        } else {
            Group::LOWER_TORQUES
        };
        let mut values = [None; 128];
        for (property, value) in [
            (PuckProperty::VERS, VERSION),
            (
                PuckProperty::ROLE,
                role::MOTOR | role::ABSOLUTE_ENCODER | 0x0400,
            ),
            (PuckProperty::OTEMP, MAX_TEMPERATURE),
            (PuckProperty::VBUS, SUPPLY_VOLTAGE),
            (PuckProperty::MT, of.limit as i32),
            (PuckProperty::CTS, turn),
            (PuckProperty::IPNM, of.units_per_newton_metre as i32),
            (PuckProperty::PIDX, (motor % SLOTS + 1) as i32),
            (PuckProperty::GRPB, i32::from(torque_group.number())),
            (PuckProperty::GRPC, i32::from(Group::ARM.number())),
        ] {
            values[usize::from(property.number())] = Some(value);
        }
        Self {
            start: PuckStart::switched_on(wake_up),
            mode: mode::IDLE_OR_STOPPED,
            offset: counts.rem_euclid(turn.max(1)) - counts,
            turn: turn.max(1),
            torque: 0,
            slot: motor % SLOTS,
            torque_group,
            temperature: REST_TEMPERATURE as i32,
            forced_temperature: None,
            error: None,
            values,
        }
    }

    pub(super) fn listens(&self, to: Target, own: Node) -> bool {
        match to {
            Target::Node(node) => node == own,
            Target::Group(group) => {
                group == Group::ALL || group == Group::ARM || group == self.torque_group
            }
        }
    }

    /// Handles a message for it, with its rotor at `counts`; returns the reply and its group.
    pub(super) fn handle_message(
        &mut self,
        message: PuckMessage,
        counts: i32,
    ) -> Option<(Group, PuckMessage)> {
        match message {
            PuckMessage::Get(PuckProperty::P) if self.is_awake() => Some((
                Group::POSITIONS,
                PuckMessage::Position {
                    motor: counts.wrapping_add(self.offset),
                    joint: None,
                },
            )),
            PuckMessage::Get(property) => {
                let value = match property {
                    PuckProperty::MECH if self.is_awake() => counts.rem_euclid(self.turn),
                    _ => self.value(property)?,
                };
                Some((Group::REPLIES, PuckMessage::Value { property, value }))
            }
            PuckMessage::Value { property, value } => {
                self.set(property, value, counts);
                None
            }
            PuckMessage::Torques(torques) => {
                if self.is_awake() {
                    self.torque = torques[self.slot];
                }
                None
            }
            PuckMessage::Position { .. } => None,
        }
    }

    fn value(&self, property: PuckProperty) -> Option<i32> {
        match property {
            PuckProperty::STAT if self.error.is_some() && self.is_awake() => Some(status::ERROR),
            PuckProperty::STAT => self.start.status(),
            PuckProperty::VERS => self.start.status().and(self.stored(property)),
            _ if !self.is_awake() => None,
            PuckProperty::MODE => Some(self.mode),
            PuckProperty::TEMP => Some(self.forced_temperature.unwrap_or(self.temperature)),
            PuckProperty::ERROR => Some(self.error.unwrap_or_default()),
            PuckProperty::T => Some(i32::from(self.torque)),
            _ => self.stored(property),
        }
    }

    fn stored(&self, property: PuckProperty) -> Option<i32> {
        self.values[usize::from(property.number())]
    }

    fn set(&mut self, property: PuckProperty, value: i32, counts: i32) {
        match property {
            PuckProperty::STAT => self.start.set_status(value),
            _ if !self.is_awake() => {}
            PuckProperty::MODE => self.switch(value),
            PuckProperty::P => self.offset = value.wrapping_sub(counts),
            _ => {
                let slot = &mut self.values[usize::from(property.number())];
                if slot.is_some() {
                    *slot = Some(value);
                }
            }
        }
    }

    /// Tells it how warm it is, °C.
    pub(super) fn set_temperature(&mut self, temperature: f64) {
        self.temperature = temperature as i32;
    }

    /// Tells it the voltage that feeds it, V.
    pub(super) fn set_voltage(&mut self, volts: f64) {
        self.values[usize::from(PuckProperty::VBUS.number())] = Some(volts as i32);
    }

    /// Gives it a temperature of its own, °C, or that of its motor.
    pub(super) fn force_temperature(&mut self, temperature: Option<i32>) {
        self.forced_temperature = temperature;
    }

    /// Puts it into its error state, with a value of `ERROR`, or ends that.
    pub(super) fn set_error(&mut self, error: Option<i32>) {
        self.error = error;
    }

    /// Sets the action of the motor. A motor that is switched off forgets its torque.
    pub(super) fn switch(&mut self, mode: i32) {
        self.mode = mode;
        self.torque = 0;
    }

    fn is_awake(&self) -> bool {
        self.start.is_awake()
    }

    /// The way from power-up to the firmware.
    pub(super) fn start(&self) -> &PuckStart {
        &self.start
    }

    pub(super) fn start_mut(&mut self) -> &mut PuckStart {
        &mut self.start
    }

    /// Returns whether it follows torques.
    pub(super) fn follows(&self) -> bool {
        self.is_awake() && self.error.is_none() && self.mode == mode::TORQUE_OR_ACTIVE
    }

    /// Returns the torque of the motor, in its units.
    pub(super) fn units(&self) -> i16 {
        if !self.follows() {
            return 0;
        }
        let largest = self.stored(PuckProperty::MT).unwrap_or_default();
        let largest = largest.clamp(0, 8191) as i16;
        self.torque.clamp(-largest, largest)
    }
}
