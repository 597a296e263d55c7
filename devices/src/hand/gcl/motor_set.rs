//! The four motors, and the prefix that selects the motors of a command.

use std::fmt;

/// One of the four motors.
///
/// Source: chapter 5.1 of the manual; annex B.3.1 of the thesis.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub enum Motor {
    /// Closes the first finger.
    F1,
    /// Closes the second finger.
    F2,
    /// Closes the third finger, which does not turn about the palm.
    F3,
    /// Turns the first two fingers about the palm, in opposite directions.
    Spread,
}

/// One of the three fingers.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum Finger {
    /// Turns with the spread.
    F1,
    /// Turns against the spread.
    F2,
    /// Does not turn.
    F3,
}

impl Finger {
    /// All three.
    pub const ALL: [Finger; 3] = [Finger::F1, Finger::F2, Finger::F3];

    /// The motor that closes it.
    pub const fn motor(self) -> Motor {
        match self {
            Finger::F1 => Motor::F1,
            Finger::F2 => Motor::F2,
            Finger::F3 => Motor::F3,
        }
    }
}

impl Motor {
    /// All four, in the order of the hand's replies.
    pub const ALL: [Motor; 4] = [Motor::F1, Motor::F2, Motor::F3, Motor::Spread];

    /// Its place in answers, from 0.
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// Some of the motors.
///
/// ```
/// use yarp_devices::hand::gcl::{Motor, MotorSet};
///
/// assert_eq!(MotorSet::FINGERS.to_string(), "G");
/// assert_eq!(MotorSet::from([Motor::F2, Motor::F1]).to_string(), "12");
/// ```
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq)]
pub struct MotorSet(u8);

impl MotorSet {
    /// None.
    pub const NONE: MotorSet = MotorSet(0);
    /// The three fingers: `G`.
    pub const FINGERS: MotorSet = MotorSet(0b0111);
    /// The spread: `S`.
    pub const SPREAD: MotorSet = MotorSet(0b1000);
    /// All four: `1234`.
    pub const ALL: MotorSet = MotorSet(0b1111);

    /// Returns whether this motor is in the set.
    pub const fn contains(self, motor: Motor) -> bool {
        self.0 & (1 << motor.index()) != 0
    }

    /// These and one more.
    pub const fn with(self, motor: Motor) -> MotorSet {
        MotorSet(self.0 | 1 << motor.index())
    }

    /// Returns whether the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The motors, in the order of the hand's replies.
    pub fn iter(self) -> impl Iterator<Item = Motor> {
        Motor::ALL
            .into_iter()
            .filter(move |motor| self.contains(*motor))
    }

    /// The prefix at the start of a word, and what follows it; `None` if there is none.
    ///
    /// A letter of the prefix always counts as one: no command begins with `G` or `S`, so that `SAVE` is `AVE` for
    /// the spread, which is no command.
    pub(super) fn split(word: &str) -> (Option<MotorSet>, &str) {
        let mut motors = MotorSet::NONE;
        let mut rest = word;
        while let Some(first) = rest.bytes().next() {
            motors = match first {
                b'1' => motors.with(Motor::F1),
                b'2' => motors.with(Motor::F2),
                b'3' => motors.with(Motor::F3),
                b'4' | b'S' => motors.with(Motor::Spread),
                b'G' => MotorSet(motors.0 | MotorSet::FINGERS.0),
                _ => break,
            };
            rest = &rest[1..];
        }
        ((!motors.is_empty()).then_some(motors), rest)
    }
}

impl From<Motor> for MotorSet {
    fn from(motor: Motor) -> Self {
        MotorSet::NONE.with(motor)
    }
}

impl<const N: usize> From<[Motor; N]> for MotorSet {
    fn from(motors: [Motor; N]) -> Self {
        motors.into_iter().fold(MotorSet::NONE, MotorSet::with)
    }
}

/// Formats the set as in a command: `G`, `S`, or the numbers.
impl fmt::Display for MotorSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            MotorSet::FINGERS => f.write_str("G"),
            MotorSet::SPREAD => f.write_str("S"),
            motors => motors
                .iter()
                .try_for_each(|motor| write!(f, "{}", motor.index() + 1)),
        }
    }
}
