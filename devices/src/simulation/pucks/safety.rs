//! The safety module as a participant of the bus.

use crate::can::puck::{Lamp, Message, Pendant, Property, mode, role, status};
use crate::simulation::{Fault, SafetyLimits, SafetyMode, SafetyModule};

/// Version of its firmware: any above 61 has today's property list.
const VERSION: i32 = 200;
/// Velocities are in m/s / 4096.
const VELOCITY_UNITS: f64 = 4096.0;
/// What a rotor seems to do whose position is written, m/s: more than any limit.
const JUMP: f64 = 1e3;

#[derive(Clone, Debug)]
pub(super) struct SafetyPuck {
    status: i32,
    zeroed: i32,
    faults_to_ignore: i32,
}

impl SafetyPuck {
    pub(super) fn switched_on() -> Self {
        Self {
            status: status::MONITOR,
            zeroed: 0,
            faults_to_ignore: 0,
        }
    }

    /// Hears what is for it, and answers questions.
    pub(super) fn hear(&mut self, message: Message, module: &mut SafetyModule) -> Option<Message> {
        match message {
            Message::Get(property) => {
                let value = self.value(property, module)?;
                Some(Message::Value { property, value })
            }
            Message::Value { property, value } => {
                self.set(property, value, module);
                None
            }
            Message::Torques(_) | Message::Position { .. } => None,
        }
    }

    /// A rotor that is told another position seems to jump.
    pub(super) fn see_position_written(&mut self, module: &mut SafetyModule) {
        if self.faults_to_ignore > 0 {
            self.faults_to_ignore -= 1;
        } else {
            module.watch(JUMP, None, 0.0);
        }
    }

    fn value(&self, property: Property, module: &SafetyModule) -> Option<i32> {
        let limits = module.limits();
        Some(match property {
            Property::STAT => self.status,
            Property::VERS => VERSION,
            _ if self.status != status::READY => return None,
            Property::ROLE => role::SAFETY,
            Property::MODE => match module.mode() {
                SafetyMode::EmergencyStop => mode::IDLE_OR_STOPPED,
                SafetyMode::Idle => mode::SAFETY_IDLE,
                SafetyMode::Active => mode::TORQUE_OR_ACTIVE,
            },
            Property::ZERO => self.zeroed,
            Property::PEN => pendant(module).bits(),
            Property::VL1 => (limits.velocity_warning * VELOCITY_UNITS) as i32,
            Property::VL2 => (limits.velocity_fault * VELOCITY_UNITS) as i32,
            Property::TL1 => limits.torque_warning as i32,
            Property::TL2 => limits.torque_fault as i32,
            Property::IFAULT => self.faults_to_ignore,
            _ => return None,
        })
    }

    fn set(&mut self, property: Property, value: i32, module: &mut SafetyModule) {
        let limits = module.limits();
        let speed = f64::from(value) / VELOCITY_UNITS;
        let units = f64::from(value);
        match property {
            Property::STAT => self.status = value,
            _ if self.status != status::READY => {}
            Property::MODE => match value {
                mode::IDLE_OR_STOPPED => module.request(SafetyMode::EmergencyStop),
                mode::SAFETY_IDLE => module.request(SafetyMode::Idle),
                _ => {}
            },
            Property::ZERO => self.zeroed = value,
            Property::IFAULT => self.faults_to_ignore = value,
            Property::VL1 => module.set_limits(SafetyLimits {
                velocity_warning: speed,
                ..limits
            }),
            Property::VL2 => module.set_limits(SafetyLimits {
                velocity_fault: speed,
                ..limits
            }),
            Property::TL1 => module.set_limits(SafetyLimits {
                torque_warning: units,
                ..limits
            }),
            Property::TL2 => module.set_limits(SafetyLimits {
                torque_fault: units,
                ..limits
            }),
            _ => {}
        }
    }
}

fn pendant(module: &SafetyModule) -> Pendant {
    let mut lamps = [Lamp::Safe; 5];
    match module.fault() {
        Some(Fault::Velocity { .. } | Fault::Runaway { .. }) => lamps[0] = Lamp::Fault,
        Some(Fault::Torque { .. }) => lamps[1] = Lamp::Fault,
        Some(Fault::Heartbeat { .. }) => lamps[3] = Lamp::Fault,
        None => {}
    }
    if module.mode() == SafetyMode::EmergencyStop {
        lamps[4] = Lamp::Fault;
    }
    Pendant { lamps }
}
