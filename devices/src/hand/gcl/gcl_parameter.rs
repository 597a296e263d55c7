//! Parameters of the hand that can be read and set.

use std::fmt;

use super::{FirmwareVersion, Motor};

/// Scope of a parameter: per motor, or for the whole hand.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum Scope {
    /// One per motor: `FSET`, `FGET`.
    Motor,
    /// One for the hand: `PSET`, `PGET`.
    Hand,
}

/// A parameter of a motor or of the hand.
///
/// ```
/// use yarp_devices::hand::gcl::{Parameter, Scope};
///
/// let speed = Parameter::find(Scope::Motor, "mcv").unwrap();
/// assert_eq!(speed.name(), "MCV");
/// assert!(speed.allows(100) && !speed.allows(5000));
/// ```
///
/// Source: the manual of firmware 4.3x, pages 28 to 41, that of 4.4.x, page 45, and the ranges of Barrett's API 4.4.3.
#[derive(Clone, Copy, Eq, PartialEq)]
pub struct Parameter(usize);

/// Description of a parameter: its row in the table below.
struct Row {
    scope: Scope,
    name: &'static str,
    /// The name in other firmware.
    alias: Option<&'static str>,
    min: i32,
    max: i32,
    writable: bool,
    /// Defaults of the simulated hand: a finger, the spread.
    ///
    /// The factory's values of most are not published; then these are choices.
    defaults: [i32; 2],
    advanced: bool,
    /// True if firmware has it from 4.4 on only.
    newer: bool,
}

const fn row(scope: Scope, name: &'static str, min: i32, max: i32, defaults: [i32; 2]) -> Row {
    Row {
        scope,
        name,
        alias: None,
        min,
        max,
        writable: true,
        defaults,
        advanced: false,
        newer: false,
    }
}

const fn motor(name: &'static str, min: i32, max: i32, defaults: [i32; 2]) -> Row {
    row(Scope::Motor, name, min, max, defaults)
}

const fn hand(name: &'static str, min: i32, max: i32, default: i32) -> Row {
    row(Scope::Hand, name, min, max, [default, default])
}

const fn read_only(row: Row) -> Row {
    Row {
        writable: false,
        ..row
    }
}

const fn advanced(row: Row) -> Row {
    Row {
        advanced: true,
        ..row
    }
}

const fn newer(row: Row) -> Row {
    Row { newer: true, ..row }
}

const fn also(row: Row, alias: &'static str) -> Row {
    Row {
        alias: Some(alias),
        ..row
    }
}

static TABLE: [Row; 46] = [
    read_only(motor("P", 0, 20000, [0, 0])),
    read_only(motor("S", 0, 65535, [0, 0])),
    read_only(motor("SG", 0, 255, [128, 255])),
    also(read_only(motor("BD", 0, 1, [0, 0])), "BS"),
    read_only(motor("BP", 0, 20000, [0, 0])),
    read_only(motor("OD", 0, i32::MAX, [0, 0])),
    motor("MCV", 16, 4080, [100, 60]),
    motor("MOV", 16, 4080, [100, 60]),
    also(motor("HSG", 0, 256, [256, 256]), "MSG"),
    motor("LSG", 0, 256, [256, 256]),
    motor("CT", 0, 18000, [17800, 3150]),
    motor("OT", 0, 18000, [0, 0]),
    motor("DP", 0, 18000, [8900, 1575]),
    motor("DS", -32768, 32767, [1780, 315]),
    motor("MPE", 0, 65535, [50, 20]),
    motor("TSTOP", 0, 65535, [200, 200]),
    motor("HOLD", 0, 1, [0, 1]),
    motor("EN", 0, 1, [1, 1]),
    advanced(motor("ACCEL", 0, 65535, [4, 2])),
    advanced(motor("SAMPLE", 15, 255, [63, 200])),
    advanced(motor("FPG", 0, 255, [5, 5])),
    advanced(motor("FDZ", 0, 255, [200, 200])),
    advanced(motor("FIP", 0, 255, [0, 0])),
    advanced(motor("IVEL", -32768, 32767, [100, 60])),
    advanced(motor("IOFF", -32768, 32767, [0, 0])),
    advanced(motor("SGFLIP", 0, 1, [0, 0])),
    motor("LCV", 0, 1, [1, 1]),
    motor("LCPG", 0, 1, [1, 1]),
    motor("LFV", 0, 1, [1, 1]),
    motor("LFS", 0, 1, [1, 1]),
    motor("LFAP", 0, 1, [1, 1]),
    motor("LFDP", 0, 1, [1, 1]),
    motor("LCVC", 0, 255, [1, 1]),
    motor("LFVC", 0, 255, [1, 1]),
    motor("LFDPC", 0, 255, [1, 1]),
    hand("BAUD", 6, 384, 96),
    read_only(hand("TEMP", -550, 1250, 350)),
    read_only(hand("PTEMP", 0, 1250, 350)),
    hand("OTEMP", 0, 1250, 650),
    read_only(hand("UPSECS", 0, i32::MAX, 0)),
    read_only(hand("SN", 0, i32::MAX, 262)),
    hand("LFT", 0, 1, 0),
    hand("LFDPD", 0, 1, 0),
    newer(motor("LCT", 0, 1, [0, 0])),
    newer(motor("LFBP", 0, 1, [0, 0])),
    newer(motor("LFAIN", 0, 1, [0, 0])),
];

impl Parameter {
    /// Position of a motor, in counts; 0 is open.
    pub const POSITION: Parameter = Parameter(0);
    /// The status of a motor.
    pub const STATUS: Parameter = Parameter(1);
    /// The strain gauge of a finger, 0 to 255.
    pub const STRAIN: Parameter = Parameter(2);
    /// State of the clutch: 1 if it has released.
    pub const BREAKAWAY: Parameter = Parameter(3);
    /// Position at which the clutch released, in counts.
    pub const BREAKAWAY_POSITION: Parameter = Parameter(4);
    /// Closing speed of a motor.
    pub const CLOSE_SPEED: Parameter = Parameter(6);
    /// Opening speed of a motor.
    pub const OPEN_SPEED: Parameter = Parameter(7);
    /// The speed of the line, in hundreds of bits per second.
    pub const BAUD: Parameter = Parameter(35);
    /// The temperature, in tenths of a degree Celsius.
    pub const TEMPERATURE: Parameter = Parameter(36);

    /// The parameter of this name, in any case and by any of its names.
    pub fn find(scope: Scope, name: &str) -> Option<Parameter> {
        let named = |row: &Row| {
            row.name.eq_ignore_ascii_case(name)
                || row
                    .alias
                    .is_some_and(|alias| alias.eq_ignore_ascii_case(name))
        };
        Self::all().find(|each| each.scope() == scope && named(each.about()))
    }

    /// Lists all parameters of a scope, advanced ones or the others.
    pub fn list(scope: Scope, advanced: bool) -> impl Iterator<Item = Parameter> {
        Self::all().filter(move |each| each.scope() == scope && each.about().advanced == advanced)
    }

    /// Its name in a command.
    pub fn name(self) -> &'static str {
        self.about().name
    }

    /// Returns whether it belongs to a motor or to the hand.
    pub fn scope(self) -> Scope {
        self.about().scope
    }

    /// Returns whether firmware of this version has it.
    pub fn exists_in(self, version: FirmwareVersion) -> bool {
        !self.about().newer || version.has_newer_fields()
    }

    /// Returns whether firmware of this version accepts a value: scales have no 0 from 4.4 on.
    pub fn allows_in(self, version: FirmwareVersion, value: i32) -> bool {
        let is_scale = matches!(self.name(), "LCVC" | "LFVC" | "LFDPC");
        self.allows(value) && !(is_scale && value == 0 && version >= FirmwareVersion::V4_4)
    }

    /// Returns whether it can be set.
    pub fn is_writable(self) -> bool {
        self.about().writable
    }

    /// Returns whether the value is in its range.
    pub fn allows(self, value: i32) -> bool {
        (self.about().min..=self.about().max).contains(&value)
    }

    /// Returns the default of the simulated hand.
    pub fn default(self, motor: Motor) -> i32 {
        self.about().defaults[usize::from(motor == Motor::Spread)]
    }

    fn about(self) -> &'static Row {
        &TABLE[self.0]
    }

    /// The number of its row, for keeping values.
    #[cfg(all(unix, feature = "barrett"))]
    pub(crate) const fn row(self) -> usize {
        self.0
    }

    /// Number of rows of the table.
    pub(crate) const ROWS: usize = TABLE.len();

    /// Every parameter.
    pub(crate) fn all() -> impl Iterator<Item = Parameter> {
        (0..Self::ROWS).map(Parameter)
    }
}

impl fmt::Debug for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_and_constants_are_what_they_say() {
        for parameter in Parameter::all() {
            let found = Parameter::find(parameter.scope(), parameter.name());
            assert_eq!(found, Some(parameter));
            for motor in Motor::ALL {
                assert!(parameter.allows(parameter.default(motor)), "{parameter}");
            }
        }
        let check = |parameter: Parameter, name| assert_eq!(parameter.name(), name);
        check(Parameter::POSITION, "P");
        check(Parameter::STATUS, "S");
        check(Parameter::STRAIN, "SG");
        check(Parameter::BREAKAWAY, "BD");
        check(Parameter::BREAKAWAY_POSITION, "BP");
        check(Parameter::CLOSE_SPEED, "MCV");
        check(Parameter::OPEN_SPEED, "MOV");
        check(Parameter::BAUD, "BAUD");
        check(Parameter::TEMPERATURE, "TEMP");
        check(Parameter::find(Scope::Motor, "msg").unwrap(), "HSG");
        assert_eq!(Parameter::find(Scope::Hand, "MCV"), None);
    }
}
