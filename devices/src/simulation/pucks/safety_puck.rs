//! The safety module as a participant of the bus.

use super::puck_start::{PuckStart, WakeUp};
use crate::can::puck::{Lamp, Pendant, PuckMessage, PuckProperty, mode, role};
use crate::simulation::{Fault, SafetyLimits, SafetyMode, SafetyModule};

/// Version of its firmware: any above 61 has today's property list.
const VERSION: i32 = 200;
/// Velocities are in m/s / 4096.
const VELOCITY_UNITS: f64 = 4096.0;
/// Apparent speed of a rotor whose position is written, m/s: more than any limit.
const REWRITE_SPEED: f64 = 1e3;

#[derive(Clone, Debug)]
pub(super) struct SafetyPuck {
    start: PuckStart,
    zeroed: i32,
    faults_to_ignore: i32,
}

impl SafetyPuck {
    pub(super) fn switched_on(wake_up: WakeUp) -> Self {
        Self {
            start: PuckStart::switched_on(wake_up),
            zeroed: 0,
            faults_to_ignore: 0,
        }
    }

    /// The way from power-up to the firmware.
    pub(super) fn start(&self) -> &PuckStart {
        &self.start
    }

    pub(super) fn start_mut(&mut self) -> &mut PuckStart {
        &mut self.start
    }

    /// Handles a message for it, and answers queries.
    pub(super) fn handle_message(
        &mut self,
        message: PuckMessage,
        module: &mut SafetyModule,
    ) -> Option<PuckMessage> {
        match message {
            PuckMessage::Get(property) => {
                let value = self.value(property, module)?;
                Some(PuckMessage::Value { property, value })
            }
            PuckMessage::Value { property, value } => {
                self.set(property, value, module);
                None
            }
            PuckMessage::Torques(_) | PuckMessage::Position { .. } => None,
        }
    }

    /// A rotor whose position is written seems to jump.
    pub(super) fn see_position_written(&mut self, module: &mut SafetyModule) {
        if self.faults_to_ignore > 0 {
            self.faults_to_ignore -= 1;
        } else {
            module.watch(REWRITE_SPEED, None, 0.0);
        }
    }

    fn value(&self, property: PuckProperty, module: &SafetyModule) -> Option<i32> {
        let limits = module.limits();
        Some(match property {
            PuckProperty::STAT => self.start.status()?,
            PuckProperty::VERS => self.start.status().map(|_| VERSION)?,
            _ if !self.start.is_awake() => return None,
            PuckProperty::ROLE => role::SAFETY,
            PuckProperty::MODE => match module.mode() {
                SafetyMode::EmergencyStop => mode::IDLE_OR_STOPPED,
                SafetyMode::Idle => mode::SAFETY_IDLE,
                SafetyMode::Active => mode::TORQUE_OR_ACTIVE,
            },
            PuckProperty::ZERO => self.zeroed,
            PuckProperty::PEN => pendant(module).bits(),
            PuckProperty::VL1 => (limits.velocity_warning * VELOCITY_UNITS) as i32,
            PuckProperty::VL2 => (limits.velocity_fault * VELOCITY_UNITS) as i32,
            PuckProperty::TL1 => limits.torque_warning as i32,
            PuckProperty::TL2 => limits.torque_fault as i32,
            PuckProperty::IFAULT => self.faults_to_ignore,
            _ => return None,
        })
    }

    fn set(&mut self, property: PuckProperty, value: i32, module: &mut SafetyModule) {
        let limits = module.limits();
        let speed = f64::from(value) / VELOCITY_UNITS;
        let units = f64::from(value);
        match property {
            PuckProperty::STAT => self.start.set_status(value),
            _ if !self.start.is_awake() => {}
            PuckProperty::MODE => match value {
                mode::IDLE_OR_STOPPED => module.request(SafetyMode::EmergencyStop),
                mode::SAFETY_IDLE => module.request(SafetyMode::Idle),
                _ => {}
            },
            PuckProperty::ZERO => self.zeroed = value,
            PuckProperty::IFAULT => self.faults_to_ignore = value,
            PuckProperty::VL1 => module.set_limits(SafetyLimits {
                velocity_warning: speed,
                ..limits
            }),
            PuckProperty::VL2 => module.set_limits(SafetyLimits {
                velocity_fault: speed,
                ..limits
            }),
            PuckProperty::TL1 => module.set_limits(SafetyLimits {
                torque_warning: units,
                ..limits
            }),
            PuckProperty::TL2 => module.set_limits(SafetyLimits {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest limit that `VL2` holds is 8 m/s: 16 bits, 12 of them behind the point.
    #[test]
    fn a_position_that_is_written_exceeds_every_limit_of_velocity() {
        let mut puck = SafetyPuck::switched_on(WakeUp::default());
        let mut module = SafetyModule::new(SafetyLimits {
            velocity_fault: f64::from(i16::MAX) / 4096.0,
            ..SafetyLimits::default()
        });
        module.press_activate();
        puck.faults_to_ignore = 1;
        puck.see_position_written(&mut module);
        assert_eq!(module.mode(), SafetyMode::Active, "it was to be ignored");
        puck.see_position_written(&mut module);
        assert_eq!(module.mode(), SafetyMode::Idle);
        assert!(matches!(module.fault(), Some(Fault::Velocity { .. })));
    }
}
