//! Requests for the priority of packets and threads of a connection.
//!
//! The request is `[prop] [set] /PEER (qos ((KEY VALUE)))`. Routers use the *type of service*, one
//! byte in the header of each packet; its upper six bits are the *code point*.
//!
//! Checked against 3.5.0, including refused requests.

use std::fmt;
use std::str::FromStr;

use crate::{Bottle, Value};

/// A differentiated services code point: 0 to 63, some of which have names such as `AF12`.
///
/// ```
/// use yarp_wire::qos::CodePoint;
/// let point: CodePoint = "AF42".parse().unwrap();
/// assert_eq!((point.number(), point.type_of_service()), (36, 144));
/// assert_eq!(CodePoint::new(36).unwrap().to_string(), "AF42");
/// assert!("AF44".parse::<CodePoint>().is_err());
/// assert!(CodePoint::new(64).is_none());
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct CodePoint(u8);

/// The code points that have names. Source: RFC 2474, 2597, 3246 and 5865; stock spells the last
/// one `VA`.
const NAMES: [(&str, u8); 22] = [
    ("CS0", 0),
    ("CS1", 8),
    ("CS2", 16),
    ("CS3", 24),
    ("CS4", 32),
    ("CS5", 40),
    ("CS6", 48),
    ("CS7", 56),
    ("AF11", 10),
    ("AF12", 12),
    ("AF13", 14),
    ("AF21", 18),
    ("AF22", 20),
    ("AF23", 22),
    ("AF31", 26),
    ("AF32", 28),
    ("AF33", 30),
    ("AF41", 34),
    ("AF42", 36),
    ("AF43", 38),
    ("EF", 46),
    ("VA", 44),
];

/// Stock's four levels of packet priority.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub enum Level {
    /// `LOW`
    Low,
    /// `NORM`
    Normal,
    /// `HIGH`
    High,
    /// `CRIT`
    Critical,
}

const LEVELS: [(&str, Level, CodePoint); 4] = [
    ("LOW", Level::Low, CodePoint(10)),
    ("NORM", Level::Normal, CodePoint(0)),
    ("HIGH", Level::High, CodePoint(36)),
    ("CRIT", Level::Critical, CodePoint(44)),
];

/// A word that names no code point or level.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[error("expected {expected}, got {text:?}")]
pub struct NameError {
    /// The received text.
    pub text: String,
    /// The expected values.
    pub expected: &'static str,
}

impl CodePoint {
    /// Creates the code point of this number, if it fits six bits.
    pub const fn new(number: u8) -> Option<Self> {
        if number < 64 {
            Some(Self(number))
        } else {
            None
        }
    }

    /// Returns its number, 0 to 63.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Returns the byte in packet headers: the number, shifted past the two lower bits.
    pub const fn type_of_service(self) -> u8 {
        self.0 << 2
    }

    /// Returns its name, if it has one.
    pub fn name(self) -> Option<&'static str> {
        let mut names = NAMES.iter();
        names
            .find(|(_, number)| *number == self.0)
            .map(|(name, _)| *name)
    }
}

impl FromStr for CodePoint {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        let found = NAMES.iter().find(|(name, _)| *name == text);
        found
            .map(|(_, number)| Self(*number))
            .ok_or_else(|| NameError {
                text: text.to_owned(),
                expected: "CS0 to CS7, AF11 to AF43, VA or EF",
            })
    }
}

impl fmt::Display for CodePoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "{}", self.0),
        }
    }
}

impl Level {
    /// Returns the code point that packets of this level have.
    pub fn code_point(self) -> CodePoint {
        let mut levels = LEVELS.iter();
        let found = levels.find(|(_, level, _)| *level == self);
        found.expect("every level is in the table").2
    }
}

impl FromStr for Level {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        let found = LEVELS.iter().find(|(name, ..)| *name == text);
        found.map(|(_, level, _)| *level).ok_or_else(|| NameError {
            text: text.to_owned(),
            expected: "LOW, NORM, HIGH or CRIT",
        })
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut levels = LEVELS.iter();
        let found = levels.find(|(_, level, _)| level == self);
        f.write_str(found.expect("every level is in the table").0)
    }
}

/// Returns the type of service that `((KEY VALUE))` requests; `None` if there is no valid request.
///
/// The first present key decides: `priority LOW|NORM|HIGH|CRIT`, `dscp NAME` or `dscp 0..63`, `tos
/// N`. A `tos` above 255 is truncated to its lowest byte, as the operating system does.
pub fn type_of_service(wanted: &Bottle) -> Option<u32> {
    // As in stock, names are compared as vocabs: `NORMAL` matches `NORM`.
    let word = |value: &Value| value.as_vocab().map(|word| word.to_string());
    if let Some(level) = wanted.find("priority") {
        let level: Level = word(level)?.parse().ok()?;
        return Some(level.code_point().type_of_service().into());
    }
    if let Some(point) = wanted.find("dscp") {
        let named = word(point).and_then(|word| word.parse().ok());
        let point: CodePoint = match named {
            Some(point) => point,
            None => CodePoint::new(u8::try_from(integer(point)?).ok()?)?,
        };
        return Some(point.type_of_service().into());
    }
    u32::try_from(integer(wanted.find("tos")?)?).ok()
}

/// The requested scheduling of the threads behind a connection, or of all threads of a process.
///
/// `((priority N) (policy P))`; a missing value, or -1, means unchanged.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Scheduling {
    /// The system's number of a scheduling policy.
    pub policy: Option<i64>,
    /// The priority within that policy.
    pub priority: Option<i64>,
}

impl Scheduling {
    /// Parses the request; `None` if it contains neither.
    pub fn parse(wanted: &Bottle) -> Option<Self> {
        let (policy, priority) = (wanted.find("policy"), wanted.find("priority"));
        if policy.is_none() && priority.is_none() {
            return None;
        }
        let number = |value: Option<&Value>| value.and_then(integer).filter(|number| *number != -1);
        Some(Self {
            policy: number(policy),
            priority: number(priority),
        })
    }
}

fn integer(value: &Value) -> Option<i64> {
    match value {
        Value::Int8(_) | Value::Int16(_) | Value::Int32(_) | Value::Int64(_) => value.as_i64(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_read_as_in_stock() {
        let check = |text: &str, expected: Option<u32>| {
            let wanted = Bottle::parse(text).unwrap();
            assert_eq!(type_of_service(&wanted), expected, "{text}");
        };
        check("(priority LOW)", Some(40));
        check("(priority NORM)", Some(0));
        check("(priority NORMAL)", Some(0));
        check("(priority HIGH)", Some(144));
        check("(priority [CRIT])", Some(176));
        check("priority CRIT", Some(176));
        check("(dscp AF12)", Some(48));
        check("(dscp CS7)", Some(224));
        check("(dscp 10)", Some(40));
        check("(tos 48)", Some(48));
        check("(tos 300)", Some(300));
        check("(priority LOW) (tos 72)", Some(40));
        check("(tos 72) (dscp 1)", Some(4));
        check("(dscp EF) (tos -1)", Some(184));
        for refused in [
            "",
            "(priority low)",
            "(priority 36)",
            "(dscp ef)",
            "(dscp 99)",
            "(dscp -1)",
            "(dscp 0.5)",
            "(tos -1)",
            "(tos abc)",
            "(tos 40.5)",
            "(foo 5)",
            "5",
        ] {
            check(refused, None);
        }
    }

    #[test]
    fn names_read_back() {
        for (name, number) in NAMES {
            let point: CodePoint = name.parse().unwrap();
            assert_eq!((point.number(), point.to_string()), (number, name.into()));
        }
        for (name, level, point) in LEVELS {
            assert_eq!(name.parse(), Ok(level));
            assert_eq!(
                (level.to_string(), level.code_point()),
                (name.into(), point)
            );
        }
        assert_eq!(CodePoint(1).to_string(), "1");
    }

    #[test]
    fn unchanged_values_are_not_requested() {
        let check = |text: &str, expected: Option<(Option<i64>, Option<i64>)>| {
            let wanted = Scheduling::parse(&Bottle::parse(text).unwrap());
            let wanted = wanted.map(|wanted| (wanted.policy, wanted.priority));
            assert_eq!(wanted, expected, "{text}");
        };
        check("(policy -1) (priority -1)", Some((None, None)));
        check("(priority 0) (policy 0)", Some((Some(0), Some(0))));
        check("(policy 0)", Some((Some(0), None)));
        check("(priority 5) (policy 1)", Some((Some(1), Some(5))));
        check("(priority 5)", Some((None, Some(5))));
        check("", None);
    }
}
