//! One motor and the links that it moves.

use super::super::finger_coupling::OUTER_COUNTS;
use super::super::gcl::Motor;
use super::super::hand_units;

/// Torque at the inner joint at which the clutch releases, Nm.
///
/// Not published; as if 15 N pressed 50 mm from the joint.
pub const BREAKAWAY_TORQUE: f64 = 0.75;

/// Counts per degree of the outer link, while it holds.
const OUTER_ENGAGED: f64 = 375.0;
/// End of a finger's counter; the spread's ends with its range.
const FINGER_STOP: f64 = 17800.0;
/// Counts per s², so that a finger is at its speed after some 50 ms.
const ACCELERATION: f64 = 350_000.0;

/// Something in the way of a finger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    /// Angle at which the inner link touches it, degrees.
    pub inner: f64,
    /// Angle by which the outer link can then turn against the inner one, degrees.
    pub outer: f64,
    /// Torque that it withstands at the inner joint, Nm. Above [`BREAKAWAY_TORQUE`] the clutch lets go.
    pub torque: f64,
}

/// Torque at the outer joint at which the motor stalls once the clutch has let go, Nm: 20 N at the fingertip, 55 mm from
/// that joint. The manual's figure 25 has up to 25 N.
pub const STALL_TORQUE: f64 = 1.1;

/// Torque at the outer joint beyond which no gain raises the stall, Nm: the 25 N of that figure.
const MAX_STALL_TORQUE: f64 = 25.0 * 0.055;
/// Gain at which a motor stalls at [`STALL_TORQUE`]: that of Barrett's demonstration. The torque is taken as proportional to
/// the gain, which is not published.
const USUAL_GAIN: f64 = 5.0;
/// Torque about the inner joint with the clutch engaged over that about the outer joint without: the ratio of the gears.
const OUTER_ENGAGED_RATIO: f64 = 125.0 / 93.75;

/// Torques that contact puts on a finger, against closing, Nm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// About the inner joint, of all forces on both links.
    pub inner: f64,
    /// About the outer joint, of the forces on the outer link.
    pub outer: f64,
}

/// Command of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Drive {
    /// No current. Fingers stay where they are: they cannot be driven back.
    Off,
    /// The motion has ended and the servo keeps the position (`HOLD`).
    Hold,
    /// The motion has ended at a stall, and the motor pushes on with controlled torque (`TC`, `TO`); closing is positive,
    /// counts/s.
    Press(f64),
    /// To a position, at a speed; counts and counts/s.
    To { target: f64, speed: f64 },
    /// At a speed, counts/s; closing is positive.
    At(f64),
}

#[derive(Clone, Debug)]
pub(super) struct SimulatedMotor {
    motor: Motor,
    /// Counts.
    position: f64,
    /// Counts/s.
    speed: f64,
    pub(super) drive: Drive,
    pub(super) object: Option<Object>,
    /// Effect of contact on the finger; an alternative to an object in the way.
    pub(super) load: Load,
    /// Position at which the clutch is disengaged, counts.
    clutch: Option<f64>,
    /// Something else holds it, such as closed fingers the spread.
    pub(super) blocked: bool,
    breakaway: Option<f64>,
    /// Time for which it has pushed against something, s.
    pushing: f64,
    /// Total distance, counts.
    travelled: f64,
    /// Gain of the servo (`FPG`, or `LCPG` in RealTime), which sets the torque of a stall.
    gain: f64,
}

impl SimulatedMotor {
    pub(super) fn new(motor: Motor) -> Self {
        // A hand is found with its fingers somewhere.
        let position = 0.2 * hand_units::whole_way(motor);
        Self {
            motor,
            position,
            speed: 0.0,
            drive: Drive::Off,
            object: None,
            load: Load::default(),
            clutch: None,
            blocked: false,
            breakaway: None,
            pushing: 0.0,
            travelled: 0.0,
            gain: USUAL_GAIN,
        }
    }

    pub(super) fn position(&self) -> f64 {
        self.position
    }

    pub(super) fn speed(&self) -> f64 {
        self.speed
    }

    pub(super) fn travelled(&self) -> f64 {
        self.travelled
    }

    /// Returns where the clutch is disengaged, counts; `None` while it is engaged.
    pub(super) fn clutch(&self) -> Option<f64> {
        self.clutch
    }

    /// Returns the position at which the clutch released, counts.
    pub(super) fn breakaway(&self) -> Option<f64> {
        self.breakaway
    }

    pub(super) fn clear_breakaway(&mut self) {
        self.breakaway = None;
    }

    /// Returns the time for which it has pushed against something, s.
    pub(super) fn pushing(&self) -> f64 {
        self.pushing
    }

    /// Returns whether it has reached its target.
    pub(super) fn has_arrived(&self) -> bool {
        match self.drive {
            Drive::To { target, .. } => (self.position - target).abs() < 0.5,
            Drive::Off | Drive::Hold | Drive::Press(_) | Drive::At(_) => false,
        }
    }

    /// Returns whether a motion is in progress.
    pub(super) fn is_driven(&self) -> bool {
        matches!(self.drive, Drive::To { .. } | Drive::At(_))
    }

    /// Returns whether there is current in the motor.
    pub(super) fn has_current(&self) -> bool {
        self.drive != Drive::Off
    }

    /// Ends a motion: with the servo on if `hold`.
    pub(super) fn finish(&mut self, hold: bool) {
        self.stop();
        if hold {
            self.drive = Drive::Hold;
        }
    }

    /// Ends a motion at a stall with controlled torque, in its direction.
    pub(super) fn press(&mut self, speed: f64) {
        self.stop();
        self.drive = Drive::Press(speed);
    }

    /// Sets the gain of the servo; 0 leaves the motor without torque.
    pub(super) fn set_gain(&mut self, gain: f64) {
        self.gain = gain;
    }

    /// Moves it from outside by these counts, if it can be driven back: only the spread, and only without current.
    pub(super) fn push_back(&mut self, counts: f64) {
        if self.motor == Motor::Spread && !self.has_current() {
            let (open, closed) = self.stops();
            self.position = (self.position + counts).clamp(open, closed);
        }
    }

    /// Returns the torque at which it stalls: about the inner joint while the clutch is engaged, about the outer one after
    /// it let go, Nm.
    fn stall_torque(&self) -> f64 {
        let outer = (STALL_TORQUE * self.gain / USUAL_GAIN).min(MAX_STALL_TORQUE);
        match self.clutch {
            Some(_) => outer,
            None => outer * OUTER_ENGAGED_RATIO,
        }
    }

    pub(super) fn stop(&mut self) {
        self.drive = Drive::Off;
        self.speed = 0.0;
        self.pushing = 0.0;
    }

    pub(super) fn drive(&mut self, drive: Drive) {
        self.drive = drive;
        self.pushing = 0.0;
    }

    /// Time passes, a short piece of it.
    pub(super) fn step(&mut self, seconds: f64) {
        let wanted = match self.drive {
            Drive::Off | Drive::Hold => {
                self.speed = 0.0;
                return;
            }
            Drive::At(speed) | Drive::Press(speed) => speed,
            Drive::To { target, speed } => {
                // Not faster than it can still stop in time.
                let left = target - self.position;
                let most = (2.0 * ACCELERATION * left.abs()).sqrt().min(speed);
                most.min(left.abs() / seconds) * left.signum()
            }
        };
        let change = ACCELERATION * seconds;
        self.speed += (wanted - self.speed).clamp(-change, change);
        let free = self.position + self.speed * seconds;
        let (open, closed) = self.stops();
        let reached = match self.blocked || self.is_stalled() {
            true => self.position,
            false => free.clamp(open, closed.max(self.position)),
        };
        let held = (reached - free).abs() > 1e-9;
        self.disengage();
        if self.position < self.letting_go() && reached >= self.letting_go() {
            self.breakaway = Some(self.letting_go());
            self.clutch = self.breakaway;
        }
        self.travelled += (reached - self.position).abs();
        self.position = reached;
        self.clutch = self.clutch.filter(|place| *place <= reached);
        if held {
            self.speed = 0.0;
            self.pushing += seconds;
        } else {
            self.pushing = 0.0;
        }
    }

    /// Lets the clutch go when a closing finger meets more torque at its inner joint than the clutch bears.
    fn disengage(&mut self) {
        let overloaded = self.load.inner > BREAKAWAY_TORQUE
            && self.stall_torque() > BREAKAWAY_TORQUE
            && self.speed > 0.0;
        if overloaded && self.clutch.is_none() && self.motor != Motor::Spread {
            self.clutch = Some(self.position);
            self.breakaway = Some(self.position);
        }
    }

    /// Returns whether contact is stronger than the motor.
    fn is_stalled(&self) -> bool {
        if self.gain <= 0.0 {
            return true;
        }
        let load = match self.clutch {
            Some(_) => self.load.outer,
            None => self.load.inner,
        };
        self.speed > 0.0 && load > self.stall_torque()
    }

    /// Returns whether an object is stronger than the clutch, and the motor too.
    fn releases_at(&self, object: Object) -> bool {
        object.torque > BREAKAWAY_TORQUE
            && self.motor != Motor::Spread
            && (self.clutch.is_some() || self.stall_torque() > BREAKAWAY_TORQUE)
    }

    /// Returns the stops in opening and closing direction, counts.
    fn stops(&self) -> (f64, f64) {
        let end = match self.motor {
            Motor::Spread => hand_units::whole_way(Motor::Spread),
            _ => FINGER_STOP,
        };
        let closed = match self.object {
            None => end,
            Some(object) => {
                let met = hand_units::counts(self.motor, object.inner);
                if self.releases_at(object) {
                    let beyond = (object.outer - met / OUTER_ENGAGED).max(0.0);
                    (met + beyond * OUTER_COUNTS).min(end)
                } else {
                    met
                }
            }
        };
        (0.0, closed)
    }

    /// Returns the position at which the clutch releases, counts; infinite if it does not.
    fn letting_go(&self) -> f64 {
        match self.object {
            Some(object) if self.releases_at(object) => {
                hand_units::counts(self.motor, object.inner)
            }
            _ => f64::INFINITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(motor: &mut SimulatedMotor, seconds: f64) {
        for _ in 0..(seconds * 1000.0) as usize {
            motor.step(0.001);
        }
    }

    #[test]
    fn it_goes_where_it_is_driven_and_stays() {
        let mut motor = SimulatedMotor::new(Motor::F1);
        motor.drive(Drive::To {
            target: 8000.0,
            speed: 17500.0,
        });
        run(&mut motor, 1.0);
        assert!(motor.has_arrived(), "{motor:?}");
        motor.stop();
        run(&mut motor, 1.0);
        assert!((motor.position() - 8000.0).abs() < 0.5);
    }

    #[test]
    fn a_hard_object_makes_the_clutch_let_go() {
        let mut motor = SimulatedMotor::new(Motor::F2);
        motor.object = Some(Object {
            inner: 60.0,
            outer: 40.0,
            torque: 2.0,
        });
        motor.drive(Drive::At(17500.0));
        run(&mut motor, 2.0);
        assert_eq!(motor.breakaway(), Some(7500.0));
        let links =
            super::super::super::finger_coupling::links(motor.position(), motor.breakaway());
        assert!((links.outer.to_degrees() - 40.0).abs() < 1e-6);
        assert!(motor.pushing() > 0.5);
    }

    #[test]
    fn contact_disengages_the_clutch_and_then_stalls_the_motor() {
        let mut motor = SimulatedMotor::new(Motor::F1);
        motor.drive(Drive::At(17500.0));
        run(&mut motor, 0.2);
        assert_eq!(motor.clutch(), None);
        motor.load = Load {
            inner: BREAKAWAY_TORQUE + 0.1,
            outer: STALL_TORQUE - 0.1,
        };
        run(&mut motor, 0.1);
        let place = motor.clutch().expect("the clutch let go");
        assert!(motor.position() > place + 1000.0, "the outer link goes on");
        motor.load.outer = STALL_TORQUE + 0.1;
        let stalled = motor.position();
        run(&mut motor, 0.3);
        assert_eq!(motor.position(), stalled);
        assert!(motor.pushing() > 0.2);
        // Opening engages the clutch again; what was seen stays known.
        motor.load = Load::default();
        motor.drive(Drive::At(-17500.0));
        run(&mut motor, 1.0);
        assert_eq!((motor.clutch(), motor.breakaway()), (None, Some(place)));
    }

    /// A quarter of the usual gain stalls at 0.37 Nm about the inner joint: before the clutch lets go.
    #[test]
    fn the_gain_sets_the_torque_of_a_stall() {
        for (gain, load, moves) in [
            (5.0, 0.7, true),
            (5.0, 0.8, true),
            (1.25, 0.3, true),
            (1.25, 0.4, false),
            (0.0, 0.0, false),
        ] {
            let mut motor = SimulatedMotor::new(Motor::F1);
            motor.set_gain(gain);
            motor.load.inner = load;
            motor.drive(Drive::At(10000.0));
            let before = motor.position();
            run(&mut motor, 0.5);
            assert_eq!(motor.position() > before + 1000.0, moves, "{gain} {load}");
            assert_eq!(motor.clutch().is_some(), gain == 5.0 && load > 0.75);
        }
        // After the clutch let go, no gain gives more than 25 N at the fingertip, 55 mm from the joint.
        for (outer, moves) in [(1.37, true), (1.38, false)] {
            let mut motor = SimulatedMotor::new(Motor::F1);
            motor.set_gain(255.0);
            motor.load = Load { inner: 0.8, outer };
            motor.drive(Drive::At(2000.0));
            run(&mut motor, 0.05);
            let before = motor.position();
            run(&mut motor, 0.5);
            assert_eq!(motor.position() > before, moves, "{outer}");
        }
    }

    #[test]
    fn a_soft_object_stalls_the_inner_link() {
        let mut motor = SimulatedMotor::new(Motor::F2);
        motor.object = Some(Object {
            inner: 60.0,
            outer: 40.0,
            torque: 0.5,
        });
        motor.drive(Drive::At(17500.0));
        run(&mut motor, 2.0);
        assert_eq!((motor.position(), motor.breakaway()), (7500.0, None));
    }
}
