//! Motions of the motors for a command.

use super::super::gcl::{Motor, MotorSet, Status, Verb};
use super::parameter_values::Settings;
use super::simulated_motor::{Drive, Load, SimulatedMotor};

/// Counts/s per unit of `MCV` and `MOV`: makes the data sheet's 1.0 s and 0.5 s of the defaults.
const FINGER_UNIT: f64 = 175.0;
const SPREAD_UNIT: f64 = 105.0;
/// Values of `HSG` and `LSG` from here on switch the limit off.
const STRAIN_OFF: i32 = 255;

/// A motion in progress: some motors now, others when they are done.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// All its motors.
    pub(super) motors: MotorSet,
    /// The motors that still move.
    going: MotorSet,
    /// The next motion: the spread goes home after the fingers.
    then: Option<(MotorSet, Purpose)>,
    pub(super) purpose: Purpose,
    targets: [f64; 4],
    pub(super) status: Status,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Purpose {
    /// To the open or closed target; a stall is as good. With `torque` the motor pushes on after a stall.
    Grasp { closing: bool, torque: bool },
    /// To a position, which must be reached; a step is one too.
    Move(Option<i32>),
    /// Relative to the present position.
    Step { by: Option<i32>, closing: bool },
    /// To the open end.
    Home,
    /// To the open stop, to count from there.
    Initialise,
}

impl Purpose {
    /// Returns the purpose of a verb that moves.
    pub(super) fn of(verb: &Verb) -> Option<Purpose> {
        Some(match verb {
            Verb::Close | Verb::TorqueClose => Purpose::Grasp {
                closing: true,
                torque: *verb == Verb::TorqueClose,
            },
            Verb::Open | Verb::TorqueOpen => Purpose::Grasp {
                closing: false,
                torque: *verb == Verb::TorqueOpen,
            },
            Verb::StepClose(by) => Purpose::Step {
                by: *by,
                closing: true,
            },
            Verb::StepOpen(by) => Purpose::Step {
                by: *by,
                closing: false,
            },
            Verb::Move(position) => Purpose::Move(*position),
            Verb::Home => Purpose::Home,
            Verb::Initialise => Purpose::Initialise,
            _ => return None,
        })
    }
}

impl Motion {
    /// Starts the motors.
    pub(super) fn start(
        motors: MotorSet,
        purpose: Purpose,
        hand: &mut [SimulatedMotor; 4],
        settings: &Settings,
    ) -> Self {
        let mut motion = Motion {
            motors,
            going: motors,
            then: None,
            purpose,
            targets: [0.0; 4],
            status: Status::FINE,
        };
        let fingers = motors.iter().filter(|motor| *motor != Motor::Spread);
        let fingers = fingers.fold(MotorSet::NONE, MotorSet::with);
        let one_after_the_other = matches!(purpose, Purpose::Home | Purpose::Initialise);
        if one_after_the_other && motors.contains(Motor::Spread) && !fingers.is_empty() {
            motion.going = fingers;
            motion.then = Some((MotorSet::SPREAD, purpose));
        }
        motion.drive(hand, settings);
        motion
    }

    fn drive(&mut self, hand: &mut [SimulatedMotor; 4], settings: &Settings) {
        for motor in self.going.iter() {
            let (target, speed) = self.plan(motor, &hand[motor.index()], settings);
            self.targets[motor.index()] = target;
            let moved = &mut hand[motor.index()];
            if clears_breakaway(self.purpose) {
                moved.clear_breakaway();
            }
            moved.set_gain(f64::from(settings.motor("FPG", motor)));
            moved.drive(Drive::To { target, speed });
        }
    }

    /// Returns target and speed.
    fn plan(&self, motor: Motor, from: &SimulatedMotor, settings: &Settings) -> (f64, f64) {
        let value = |name: &str| f64::from(settings.motor(name, motor));
        let target = match self.purpose {
            Purpose::Grasp { closing: true, .. } => value("CT"),
            Purpose::Grasp { closing: false, .. } => value("OT"),
            Purpose::Move(position) => position.map_or_else(|| value("DP"), f64::from),
            Purpose::Step { by, closing } => {
                let by = by.map_or_else(|| value("DS"), f64::from);
                from.position() + if closing { by } else { -by }
            }
            Purpose::Home => value("OT"),
            // Beyond the stop, so that it is felt.
            Purpose::Initialise => -20000.0,
        };
        let unit = match motor {
            Motor::Spread => SPREAD_UNIT,
            _ => FINGER_UNIT,
        };
        let speed = match self.purpose {
            Purpose::Initialise => value("IVEL").abs().max(16.0),
            _ if target > from.position() => value("MCV"),
            _ => value("MOV"),
        };
        (target, speed * unit)
    }

    /// Checks the motors after a step of time; returns whether the motion has ended.
    ///
    /// Source: the manual, chapter 5.5: a motor ends at its target, when it has pushed for `TSTOP`, or when the strain
    /// is above `HSG` or below `LSG`; with the current off unless `HOLD` is set, or with controlled torque after a stall of
    /// `TC` and `TO`.
    pub(super) fn watch(&mut self, hand: &mut [SimulatedMotor; 4], settings: &Settings) -> bool {
        for motor in self.going.iter() {
            let moved = &mut hand[motor.index()];
            let stop_after = f64::from(settings.motor("TSTOP", motor)) / 1000.0;
            let hold = settings.motor("HOLD", motor) != 0;
            let (high, low) = (settings.motor("HSG", motor), settings.motor("LSG", motor));
            let strained = high < STRAIN_OFF && strain(motor, moved) > high
                || low < STRAIN_OFF && strain(motor, moved) < low;
            if moved.has_arrived() {
                moved.finish(hold);
            } else if moved.pushing() > stop_after || strained {
                match (self.purpose, moved.drive) {
                    (Purpose::Grasp { torque: true, .. }, Drive::To { target, speed })
                        if !strained =>
                    {
                        moved.press(speed.copysign(target - moved.position()));
                    }
                    _ => moved.finish(hold),
                }
                let left = (self.targets[motor.index()] - moved.position()).abs();
                let must_arrive =
                    !matches!(self.purpose, Purpose::Grasp { .. } | Purpose::Initialise);
                if must_arrive && left > f64::from(settings.motor("MPE", motor)) {
                    self.status = self.status.and(Status::NOT_REACHED);
                }
            }
        }
        let still = |motor: &Motor| hand[motor.index()].is_driven();
        self.going = self
            .going
            .iter()
            .filter(still)
            .fold(MotorSet::NONE, MotorSet::with);
        if !self.going.is_empty() {
            return false;
        }
        match self.then.take() {
            None => true,
            Some((motors, purpose)) => {
                self.going = motors;
                self.purpose = purpose;
                self.drive(hand, settings);
                false
            }
        }
    }
}

/// Returns the reading of a finger's strain gauge; the spread has none.
pub(super) fn strain(motor: Motor, moved: &SimulatedMotor) -> i32 {
    match motor {
        Motor::Spread => 255,
        // About a hundred per Nm about the outer joint.
        _ if moved.load != Load::default() => {
            128 + (moved.load.outer * 100.0).clamp(-127.0, 126.0) as i32
        }
        // A stall presses with as much as the object bears.
        _ if moved.pushing() > 0.0 => {
            let torque = moved.object.map_or(1.0, |object| object.torque.min(1.0));
            128 + (torque * 100.0) as i32
        }
        _ => 128,
    }
}

/// `O`, `TO` and `HI` clear the breakaway; no other command does.
fn clears_breakaway(purpose: Purpose) -> bool {
    matches!(
        purpose,
        Purpose::Grasp { closing: false, .. } | Purpose::Initialise
    )
}
