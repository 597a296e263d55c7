//! The safety module as a participant of the bus.

use super::puck_start::{PuckStart, WakeUp};
use crate::can::puck::{Lamp, Pendant, PuckMessage, PuckProperty, mode, role};
use crate::simulation::{Fault, SafetyLimits, SafetyMode, SafetyModule, VoltageLimits};

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
            PuckProperty::VBUS => module.voltage() as i32,
            PuckProperty::VOLTL1 => limits.voltage.low_warning as i32,
            PuckProperty::VOLTL2 => limits.voltage.low_fault as i32,
            PuckProperty::VOLTH1 => limits.voltage.high_warning as i32,
            PuckProperty::VOLTH2 => limits.voltage.high_fault as i32,
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
            PuckProperty::VOLTL1
            | PuckProperty::VOLTL2
            | PuckProperty::VOLTH1
            | PuckProperty::VOLTH2 => module.set_limits(SafetyLimits {
                voltage: with_voltage(limits.voltage, property, units),
                ..limits
            }),
            _ => {}
        }
    }
}

/// Returns the limits with one of them changed to `volts`.
fn with_voltage(limits: VoltageLimits, property: PuckProperty, volts: f64) -> VoltageLimits {
    let mut changed = limits;
    match property {
        PuckProperty::VOLTL1 => changed.low_warning = volts,
        PuckProperty::VOLTL2 => changed.low_fault = volts,
        PuckProperty::VOLTH1 => changed.high_warning = volts,
        PuckProperty::VOLTH2 => changed.high_fault = volts,
        _ => {}
    }
    changed
}

/// Returns the lamps: a warning while a quantity is beyond its level, a fault until a button is pressed, and that of the voltage as
/// long as the voltage is one, too.
fn pendant(module: &SafetyModule) -> Pendant {
    let warnings = module.warnings();
    let quantities = [warnings.velocity, warnings.torque, warnings.voltage];
    let mut lamps = [Lamp::Safe; 5];
    for (lamp, warns) in lamps.iter_mut().zip(quantities) {
        if warns {
            *lamp = Lamp::Warning;
        }
    }
    if module.is_voltage_faulty() {
        lamps[2] = Lamp::Fault;
    }
    match module.fault() {
        Some(Fault::Velocity { .. } | Fault::Runaway { .. }) => lamps[0] = Lamp::Fault,
        Some(Fault::Torque { .. }) => lamps[1] = Lamp::Fault,
        Some(Fault::Voltage { .. }) => lamps[2] = Lamp::Fault,
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

    /// D1001 AH.00, 4.5.2, asks the module for them after they were set.
    #[test]
    fn limits_of_the_voltage_are_read_and_set_one_by_one() {
        let mut puck = SafetyPuck::switched_on(WakeUp::default());
        puck.start_mut().advance(std::time::Duration::from_secs(3));
        let mut module = SafetyModule::new(SafetyLimits::default());
        let numbers = [49, 50, 51, 52].map(PuckProperty::new);
        for (property, volts) in numbers.into_iter().zip([36, 30, 54, 57]) {
            assert_eq!(puck.value(property, &module), Some(volts), "{property}");
        }
        for (property, volts) in numbers.into_iter().zip([20, 18, 80, 90]) {
            puck.set(property, volts, &mut module);
        }
        for (property, volts) in numbers.into_iter().zip([20, 18, 80, 90]) {
            assert_eq!(puck.value(property, &module), Some(volts), "{property}");
        }
    }

    /// The groups of bits of the wiki: velocity, torque, voltage, heartbeat, other.
    #[test]
    fn each_warning_has_its_lamp() {
        let mut module = SafetyModule::new(SafetyLimits::default());
        let lamps = |module: &SafetyModule| pendant(module).lamps;
        module.watch(0.6, None, 0.0);
        let [yellow, green, red] = [Lamp::Warning, Lamp::Safe, Lamp::Fault];
        assert_eq!(lamps(&module), [yellow, green, green, green, green]);
        module.watch(0.0, Some(&[5000.0]), 0.0);
        assert_eq!(lamps(&module), [green, yellow, green, green, green]);
        module.set_voltage(33.0);
        module.watch(0.0, None, 0.0);
        assert_eq!(lamps(&module), [green, green, yellow, green, green]);
        // In idle a voltage that is a fault is shown, and trips nothing.
        module.set_voltage(20.0);
        module.watch(0.0, None, 0.0);
        assert_eq!(lamps(&module), [green, green, red, green, green]);
        assert_eq!(module.fault(), None);
        // A fault is shown until a button is pressed, though the voltage has returned.
        module.press_activate();
        module.watch(0.0, Some(&[]), 0.0);
        module.set_voltage(48.0);
        module.watch(0.0, None, 0.0);
        assert_eq!(lamps(&module), [green, green, red, green, green]);
        module.press_idle();
        assert_eq!(lamps(&module), [green; 5]);
    }
}
