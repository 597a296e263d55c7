//! The safety module of the arm: the box with the pendant that watches speeds, torques, the supply voltage and traffic.

use std::fmt;

use super::thermal::SUPPLY_VOLTAGE;

/// Mode of the arm.
#[derive(Clone, Copy, Debug, Default, Eq, Ord, PartialEq, PartialOrd)]
pub enum SafetyMode {
    /// Motor power is off. The windings brake, so the arm sinks gently.
    EmergencyStop,
    /// Powered and braked; encoders count, torques are ignored.
    #[default]
    Idle,
    /// MotorSet follow torques.
    Active,
}

/// Reasons why the module took the arm out of active.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The arm moved too fast.
    Velocity {
        /// Speed of the elbow or the end of the forearm, the faster of the two, m/s.
        speed: f64,
        /// m/s.
        limit: f64,
    },
    /// The torque command of a motor was too large.
    Torque {
        /// Counted from 0.
        motor: usize,
        /// In the motor's units.
        units: f64,
        /// In the motor's units.
        limit: f64,
    },
    /// The supply voltage was too low or too high.
    Voltage {
        /// V.
        volts: f64,
        /// The limit that was passed, V.
        limit: f64,
    },
    /// No torques came for this long, s.
    Heartbeat {
        /// s.
        silence: f64,
    },
    /// The arm was still too fast half a second after it was braked.
    Runaway {
        /// m/s.
        speed: f64,
    },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Velocity { speed, limit } => {
                write!(f, "velocity fault: {speed:.2} m/s, allowed {limit:.2} m/s")
            }
            Self::Torque {
                motor,
                units,
                limit,
            } => {
                write!(
                    f,
                    "torque fault: motor {motor} asked for {units:.0} units, allowed {limit:.0}"
                )
            }
            Self::Voltage { volts, limit } => {
                let least_or_most = if volts < limit { "least" } else { "most" };
                write!(
                    f,
                    "voltage fault: {volts:.1} V, allowed at {least_or_most} {limit:.0} V"
                )
            }
            Self::Heartbeat { silence } => {
                write!(f, "heartbeat fault: no torques for {silence:.2} s")
            }
            Self::Runaway { speed } => {
                write!(
                    f,
                    "emergency stop: still {speed:.2} m/s half a second after a velocity fault"
                )
            }
        }
    }
}

/// Limits at which the module warns and at which it takes the arm out of active; 0 is never.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyLimits {
    /// `VL1`, m/s.
    pub velocity_warning: f64,
    /// `VL2`, m/s.
    pub velocity_fault: f64,
    /// `TL1`, units of the motors' torque commands.
    pub torque_warning: f64,
    /// `TL2`, units of the motors' torque commands.
    pub torque_fault: f64,
    /// Limits of the supply voltage. They are saved in the module, and the driver leaves them as they are.
    pub voltage: VoltageLimits,
    /// Maximum interval without torques, s. Barrett does not publish its own.
    pub heartbeat: f64,
}

/// Supply voltages at which the module warns and at which it takes the arm out of active, V; 0 is never.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltageLimits {
    /// `VOLTL1`: warns below.
    pub low_warning: f64,
    /// `VOLTL2`: a fault below.
    pub low_fault: f64,
    /// `VOLTH1`: warns above.
    pub high_warning: f64,
    /// `VOLTH2`: a fault above.
    pub high_fault: f64,
}

/// The values that Barrett saves in each module for a supply of 48 V (D1001 AH.00, 4.5.2 "Safety Board"; btutil's defaults of the
/// safety module).
impl Default for VoltageLimits {
    fn default() -> Self {
        Self {
            low_warning: 36.0,
            low_fault: 30.0,
            high_warning: 54.0,
            high_fault: 57.0,
        }
    }
}

impl VoltageLimits {
    /// Returns whether a voltage, V, is beyond a level at which the module warns.
    fn warns(&self, volts: f64) -> bool {
        passed(volts, self.low_warning, self.high_warning).is_some()
    }

    /// Returns the limit that a voltage, V, has passed, if that is a fault.
    fn fault(&self, volts: f64) -> Option<f64> {
        passed(volts, self.low_fault, self.high_fault)
    }
}

/// Returns the limit that a value has passed; a limit of 0 is none.
fn passed(value: f64, low: f64, high: f64) -> Option<f64> {
    if low > 0.0 && value < low {
        Some(low)
    } else {
        (high > 0.0 && value > high).then_some(high)
    }
}

/// Quantities that are beyond the level at which the module warns.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct SafetyWarnings {
    /// The speed of the arm.
    pub velocity: bool,
    /// The torque command of a motor.
    pub torque: bool,
    /// The supply voltage.
    pub voltage: bool,
}

/// The defaults at power-up, after Barrett's wiki; the heartbeat is our choice.
impl Default for SafetyLimits {
    fn default() -> Self {
        Self {
            velocity_warning: 0.5,
            velocity_fault: 1.0,
            torque_warning: 4731.0,
            torque_fault: 5204.0,
            voltage: VoltageLimits::default(),
            heartbeat: 0.5,
        }
    }
}

/// Time after a velocity fault during which the arm may still be too fast, s.
const RUNAWAY_GRACE_SECONDS: f64 = 0.5;

/// The state of the safety module (Barrett's wiki, `SafetyFeaturesPrecautions`).
///
/// Software can only lower the mode; idle and active are reached with the buttons of the pendant. Velocity is
/// judged at the elbow and at the end of the forearm, not at the tool.
#[derive(Clone, Debug)]
pub struct SafetyModule {
    limits: SafetyLimits,
    mode: SafetyMode,
    fault: Option<Fault>,
    warnings: SafetyWarnings,
    /// Supply voltage, V.
    volts: f64,
    silence: f64,
    since_velocity_fault: Option<f64>,
}

impl SafetyModule {
    /// A module that has just been switched on: idle.
    pub fn new(limits: SafetyLimits) -> Self {
        Self {
            limits,
            mode: SafetyMode::Idle,
            fault: None,
            warnings: SafetyWarnings::default(),
            volts: f64::from(SUPPLY_VOLTAGE),
            silence: 0.0,
            since_velocity_fault: None,
        }
    }

    /// Returns the mode of the arm.
    pub fn mode(&self) -> SafetyMode {
        self.mode
    }

    /// Returns why the arm was taken out of active; cleared when a button is pressed.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Returns whether the last step was beyond a warning level.
    pub fn warns(&self) -> bool {
        self.warnings != SafetyWarnings::default()
    }

    /// Returns which quantities were beyond their warning levels in the last step.
    pub fn warnings(&self) -> SafetyWarnings {
        self.warnings
    }

    /// Returns the supply voltage that the module measures, V.
    pub fn voltage(&self) -> f64 {
        self.volts
    }

    /// Changes the supply voltage that the module measures, V: 48 V at first.
    pub fn set_voltage(&mut self, volts: f64) {
        self.volts = volts;
    }

    /// Returns whether the supply voltage is a fault now: in idle too, so that the pendant shows it before it is pressed.
    pub fn is_voltage_faulty(&self) -> bool {
        self.limits.voltage.fault(self.volts).is_some()
    }

    /// The limits in force.
    pub fn limits(&self) -> SafetyLimits {
        self.limits
    }

    /// Changes the limits.
    pub fn set_limits(&mut self, limits: SafetyLimits) {
        self.limits = limits;
    }

    /// Shift and idle on the pendant: out of an emergency stop, or out of active.
    pub fn press_idle(&mut self) {
        self.mode = SafetyMode::Idle;
        self.forget();
    }

    /// Shift and activate on the pendant. Does nothing in an emergency stop: idle comes first.
    pub fn press_activate(&mut self) {
        if self.mode != SafetyMode::EmergencyStop {
            self.mode = SafetyMode::Active;
            self.forget();
        }
    }

    /// The red button.
    pub fn press_stop(&mut self) {
        self.mode = SafetyMode::EmergencyStop;
    }

    /// Requests a mode by software: a lower mode is taken, a higher one ignored.
    pub fn request(&mut self, mode: SafetyMode) {
        self.mode = self.mode.min(mode);
    }

    fn forget(&mut self) {
        self.fault = None;
        self.silence = 0.0;
        self.since_velocity_fault = None;
    }

    /// Judges what happened in the last `seconds`.
    ///
    /// * `speed`: of the elbow or the end of the forearm, m/s.
    /// * `torques`: the commands that came, in units of the motors; `None` if none came.
    pub fn watch(&mut self, speed: f64, torques: Option<&[f64]>, seconds: f64) {
        let exceeds = |value: f64, limit: f64| limit > 0.0 && value > limit;
        let hardest = torques
            .unwrap_or_default()
            .iter()
            .map(|torque| torque.abs())
            .enumerate()
            .max_by(|(_, one), (_, other)| one.total_cmp(other));
        self.warnings = SafetyWarnings {
            velocity: exceeds(speed, self.limits.velocity_warning),
            torque: hardest.is_some_and(|(_, units)| exceeds(units, self.limits.torque_warning)),
            voltage: self.limits.voltage.warns(self.volts),
        };
        self.silence = match torques {
            Some(_) => 0.0,
            None => self.silence + seconds,
        };
        if let Some(since) = &mut self.since_velocity_fault {
            *since += seconds;
            if *since > RUNAWAY_GRACE_SECONDS {
                self.since_velocity_fault = None;
                if exceeds(speed, self.limits.velocity_fault) {
                    self.fault = Some(Fault::Runaway { speed });
                    self.mode = SafetyMode::EmergencyStop;
                }
            }
        }
        if self.mode != SafetyMode::Active {
            return;
        }
        if exceeds(speed, self.limits.velocity_fault) {
            let limit = self.limits.velocity_fault;
            self.since_velocity_fault = Some(0.0);
            self.trip(Fault::Velocity { speed, limit });
        } else if let Some((motor, units)) =
            hardest.filter(|&(_, units)| exceeds(units, self.limits.torque_fault))
        {
            let limit = self.limits.torque_fault;
            self.trip(Fault::Torque {
                motor,
                units,
                limit,
            });
        } else if let Some(limit) = self.limits.voltage.fault(self.volts) {
            let volts = self.volts;
            self.trip(Fault::Voltage { volts, limit });
        } else if exceeds(self.silence, self.limits.heartbeat) {
            let silence = self.silence;
            self.trip(Fault::Heartbeat { silence });
        }
    }

    fn trip(&mut self, fault: Fault) {
        self.fault = Some(fault);
        self.mode = SafetyMode::Idle;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn active() -> SafetyModule {
        let mut module = SafetyModule::new(SafetyLimits::default());
        module.press_activate();
        module
    }

    #[test]
    fn software_only_lowers_the_mode() {
        let mut module = active();
        module.request(SafetyMode::Idle);
        module.request(SafetyMode::Active);
        assert_eq!(module.mode(), SafetyMode::Idle);
        module.request(SafetyMode::EmergencyStop);
        module.press_activate();
        assert_eq!(module.mode(), SafetyMode::EmergencyStop);
        module.press_idle();
        module.press_activate();
        assert_eq!(module.mode(), SafetyMode::Active);
    }

    #[test]
    fn each_limit_warns_and_then_trips() {
        let check = |speed: f64, torque: f64, warns: bool, fault: Option<Fault>| {
            let mut module = active();
            module.watch(speed, Some(&[0.0, -torque]), 0.002);
            assert_eq!((module.warns(), module.fault()), (warns, fault));
            assert_eq!(module.mode() == SafetyMode::Active, fault.is_none());
        };
        check(0.4, 4000.0, false, None);
        check(0.6, 4000.0, true, None);
        check(0.4, 4800.0, true, None);
        let velocity = Fault::Velocity {
            speed: 1.5,
            limit: 1.0,
        };
        check(1.5, 0.0, true, Some(velocity));
        let torque = Fault::Torque {
            motor: 1,
            units: 6000.0,
            limit: 5204.0,
        };
        check(0.4, 6000.0, true, Some(torque));
    }

    #[test]
    fn a_limit_of_zero_is_none() {
        let mut module = active();
        module.set_limits(SafetyLimits {
            velocity_warning: 0.0,
            velocity_fault: 0.0,
            ..SafetyLimits::default()
        });
        module.watch(99.0, Some(&[]), 0.002);
        assert_eq!((module.mode(), module.warns()), (SafetyMode::Active, false));
    }

    /// D1001 AH.00, 4.5.2: warnings below 36 V and above 54 V, faults below 30 V and above 57 V.
    #[test]
    fn a_voltage_beyond_the_limits_of_the_manual_warns_and_then_trips() {
        let voltage = |volts: f64, limit: f64| Some(Fault::Voltage { volts, limit });
        for (volts, warns, fault) in [
            (48.0, false, None),
            (36.5, false, None),
            (35.5, true, None),
            (30.5, true, None),
            (29.5, true, voltage(29.5, 30.0)),
            (53.5, false, None),
            (54.5, true, None),
            (56.5, true, None),
            (57.5, true, voltage(57.5, 57.0)),
        ] {
            let mut module = active();
            module.set_voltage(volts);
            module.watch(0.0, Some(&[0.0]), 0.002);
            assert_eq!(module.warnings().voltage, warns, "{volts} V");
            assert_eq!(module.fault(), fault, "{volts} V");
            assert_eq!(module.mode() == SafetyMode::Active, fault.is_none());
            assert_eq!(module.is_voltage_faulty(), fault.is_some());
            // Pressed again, it trips again: the supply has to be repaired first.
            module.press_idle();
            module.press_activate();
            module.watch(0.0, Some(&[0.0]), 0.002);
            assert_eq!(module.fault(), fault, "{volts} V");
        }
        let told =
            [(29.5, 30.0), (57.5, 57.0)].map(|(volts, limit)| Fault::Voltage { volts, limit });
        assert_eq!(
            told.map(|fault| fault.to_string()),
            [
                "voltage fault: 29.5 V, allowed at least 30 V",
                "voltage fault: 57.5 V, allowed at most 57 V"
            ]
        );
    }

    #[test]
    fn a_limit_of_the_voltage_of_zero_is_none() {
        for volts in [1.0, 1000.0] {
            let mut module = active();
            module.set_limits(SafetyLimits {
                voltage: VoltageLimits {
                    low_warning: 0.0,
                    low_fault: 0.0,
                    high_warning: 0.0,
                    high_fault: 0.0,
                },
                ..SafetyLimits::default()
            });
            module.set_voltage(volts);
            module.watch(0.0, Some(&[]), 0.002);
            assert_eq!((module.mode(), module.warns()), (SafetyMode::Active, false));
        }
    }

    #[test]
    fn silence_trips_the_heartbeat() {
        let mut module = active();
        for _ in 0..240 {
            module.watch(0.0, None, 0.002);
        }
        module.watch(0.0, Some(&[0.0]), 0.002);
        for _ in 0..240 {
            module.watch(0.0, None, 0.002);
        }
        assert_eq!(module.mode(), SafetyMode::Active);
        for _ in 0..20 {
            module.watch(0.0, None, 0.002);
        }
        assert_eq!(module.mode(), SafetyMode::Idle);
        assert!(matches!(module.fault(), Some(Fault::Heartbeat { .. })));
    }

    #[test]
    fn an_arm_that_does_not_slow_down_is_stopped_for_good() {
        for (later, mode) in [(0.5, SafetyMode::Idle), (1.2, SafetyMode::EmergencyStop)] {
            let mut module = active();
            module.watch(1.5, Some(&[]), 0.002);
            for _ in 0..300 {
                module.watch(later, None, 0.002);
            }
            assert_eq!(module.mode(), mode);
        }
    }
}
