//! A command, as a value and as a line of text.

use std::fmt;

use super::{Motor, MotorSet, Parameter, Scope, Status};

/// A command: its motors, and its action.
///
/// ```
/// use yarp_devices::hand::gcl::{Command, Motor, MotorSet, Status, Verb};
///
/// let command = Command::new(MotorSet::from(Motor::F3), Verb::Move(Some(8000)));
/// assert_eq!(command.to_string(), "3M 8000");
/// assert_eq!(Command::parse("3m 8000"), Ok(command));
/// assert_eq!(Command::parse("XYZ"), Err(Status::UNKNOWN_COMMAND));
/// ```
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Command {
    /// The prefix; without one all enabled motors are meant.
    pub motors: Option<MotorSet>,
    /// The action.
    pub verb: Verb,
}

/// An action of the hand.
///
/// Source: the manual, chapter 5; tables 20 to 22 of the thesis.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Verb {
    /// `C`: closes to `CT`, at `MCV`.
    Close,
    /// `O`: opens to `OT`, at `MOV`.
    Open,
    /// `TC`: closes and ends with controlled torque at a stall.
    TorqueClose,
    /// `TO`: opens and ends with controlled torque at a stall.
    TorqueOpen,
    /// `IC`: closes by this many counts, or by `DS`.
    StepClose(Option<i32>),
    /// `IO`: opens by this many counts, or by `DS`.
    StepOpen(Option<i32>),
    /// `M`: moves to this position in counts, or to `DP`.
    Move(Option<i32>),
    /// `HOME`: opens the fingers, then the spread.
    Home,
    /// `HI`: searches for the motors, runs to the open stops and sets the counters to zero.
    Initialise,
    /// `T`: no more current.
    Terminate,
    /// `LOOP`: enters RealTime.
    Loop,
    /// `FSET` or `PSET`: sets parameters, all of one scope.
    Set(Scope, Vec<(Parameter, i32)>),
    /// `FGET` or `PGET`: reads parameters, all of one scope.
    Get(Scope, Vec<Parameter>),
    /// `FLOAD`, `PSAVE` and the like: all parameters of a scope, or the ones named.
    Keep(Scope, SettingsCommand, Vec<Parameter>),
    /// `FLIST`, `PLISTAV` and the like: names, perhaps with values.
    List(Scope, Listing),
    /// `?`, or `A?` for advanced ones.
    Help {
        /// With the advanced commands.
        advanced: bool,
    },
    /// `ERR`: lists the meaning of the status codes.
    Errors,
    /// `RESET`: starts again as after power-up.
    Reset,
    /// `VERS`: which firmware this is.
    Version,
    /// An empty line: only a new prompt.
    Ping,
}

/// Source or destination of parameter values.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum SettingsCommand {
    /// `LOAD`: from the memory that outlasts a reset.
    Load,
    /// `SAVE`: to it.
    Save,
    /// `DEF`: the factory's.
    Default,
}

/// Content of a list.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Listing {
    /// The advanced ones instead of the common ones.
    pub advanced: bool,
    /// With their values.
    pub values: bool,
}

/// The most bytes of a line, without its end: as of the hand server's protocol, more than any command needs.
const MAX_LINE_BYTES: usize = 255;

impl Command {
    /// A command for these motors.
    pub fn new(motors: MotorSet, verb: Verb) -> Self {
        Self {
            motors: Some(motors),
            verb,
        }
    }

    /// A command without a prefix.
    pub fn plain(verb: Verb) -> Self {
        Self { motors: None, verb }
    }

    /// Asks the four motors for parameters.
    pub fn get(parameters: &[Parameter]) -> Self {
        Self::new(MotorSet::ALL, Verb::Get(Scope::Motor, parameters.to_vec()))
    }

    /// Returns whether it moves something, or may.
    pub fn moves(&self) -> bool {
        use Verb::*;
        matches!(
            self.verb,
            Close
                | Open
                | TorqueClose
                | TorqueOpen
                | StepClose(_)
                | StepOpen(_)
                | Move(_)
                | Home
                | Initialise
                | Loop
        )
    }

    /// Reads a line as the hand does, without its end.
    ///
    /// Errors: the status that the hand would answer with `ERR`.
    pub fn parse(line: &str) -> Result<Command, Status> {
        if !line.is_ascii() || line.len() > MAX_LINE_BYTES {
            return Err(Status::UNKNOWN_COMMAND);
        }
        let line = line.to_ascii_uppercase();
        let mut words = line.split_ascii_whitespace();
        let Some(first) = words.next() else {
            return Ok(Self::plain(Verb::Ping));
        };
        let (motors, name) = MotorSet::split(first);
        let verb = Verb::parse(name, words)?;
        if motors.is_some() && !verb.takes_prefix() {
            return Err(Status::NO_PREFIX_ALLOWED);
        }
        Ok(Command { motors, verb })
    }
}

impl Verb {
    fn parse<'a>(name: &str, mut words: impl Iterator<Item = &'a str>) -> Result<Verb, Status> {
        let verb = match name {
            "C" => Verb::Close,
            "O" => Verb::Open,
            "TC" => Verb::TorqueClose,
            "TO" => Verb::TorqueOpen,
            "IC" => Verb::StepClose(step(&mut words)?),
            "IO" => Verb::StepOpen(step(&mut words)?),
            "M" => Verb::Move(position(&mut words)?),
            "HOME" => Verb::Home,
            "HI" => Verb::Initialise,
            "T" => Verb::Terminate,
            "LOOP" => Verb::Loop,
            "FSET" => Verb::Set(Scope::Motor, pairs(Scope::Motor, &mut words)?),
            "PSET" => Verb::Set(Scope::Hand, pairs(Scope::Hand, &mut words)?),
            "FGET" => Verb::Get(Scope::Motor, some(names(Scope::Motor, &mut words)?)?),
            "PGET" => Verb::Get(Scope::Hand, some(names(Scope::Hand, &mut words)?)?),
            "FLOAD" => kept(Scope::Motor, SettingsCommand::Load, &mut words)?,
            "FSAVE" => kept(Scope::Motor, SettingsCommand::Save, &mut words)?,
            "FDEF" => kept(Scope::Motor, SettingsCommand::Default, &mut words)?,
            "PLOAD" => kept(Scope::Hand, SettingsCommand::Load, &mut words)?,
            "PSAVE" => kept(Scope::Hand, SettingsCommand::Save, &mut words)?,
            "PDEF" => kept(Scope::Hand, SettingsCommand::Default, &mut words)?,
            "?" => Verb::Help { advanced: false },
            "A?" => Verb::Help { advanced: true },
            "ERR" => Verb::Errors,
            "RESET" => Verb::Reset,
            "VERS" => Verb::Version,
            other => match listing(other) {
                Some((scope, listing)) => Verb::List(scope, listing),
                None => return Err(Status::UNKNOWN_COMMAND),
            },
        };
        match words.next() {
            Some(_) => Err(Status::TOO_MANY_ARGUMENTS),
            None => Ok(verb),
        }
    }

    /// Returns whether it addresses motors.
    fn takes_prefix(&self) -> bool {
        match self {
            Verb::Set(scope, _)
            | Verb::Get(scope, _)
            | Verb::Keep(scope, ..)
            | Verb::List(scope, _) => *scope == Scope::Motor,
            Verb::Help { .. } | Verb::Errors | Verb::Reset | Verb::Version | Verb::Ping => false,
            _ => true,
        }
    }
}

fn number(word: &str) -> Result<i32, Status> {
    word.parse().map_err(|_| Status::INVALID_VALUE)
}

fn step<'a>(words: &mut impl Iterator<Item = &'a str>) -> Result<Option<i32>, Status> {
    within(words, -32768, 32767)
}

fn position<'a>(words: &mut impl Iterator<Item = &'a str>) -> Result<Option<i32>, Status> {
    within(words, 0, 20000)
}

fn within<'a>(
    words: &mut impl Iterator<Item = &'a str>,
    min: i32,
    max: i32,
) -> Result<Option<i32>, Status> {
    match words.next().map(number).transpose()? {
        Some(value) if !(min..=max).contains(&value) => Err(Status::INVALID_VALUE),
        value => Ok(value),
    }
}

fn names<'a>(
    scope: Scope,
    words: &mut impl Iterator<Item = &'a str>,
) -> Result<Vec<Parameter>, Status> {
    words
        .map(|word| Parameter::find(scope, word).ok_or(Status::UNKNOWN_PARAMETER))
        .collect()
}

/// A query needs a parameter.
fn some(parameters: Vec<Parameter>) -> Result<Vec<Parameter>, Status> {
    match parameters.is_empty() {
        true => Err(Status::UNKNOWN_PARAMETER),
        false => Ok(parameters),
    }
}

fn pairs<'a>(
    scope: Scope,
    words: &mut impl Iterator<Item = &'a str>,
) -> Result<Vec<(Parameter, i32)>, Status> {
    let mut pairs = Vec::new();
    while let Some(name) = words.next() {
        let parameter = Parameter::find(scope, name).ok_or(Status::UNKNOWN_PARAMETER)?;
        let value = number(words.next().ok_or(Status::INVALID_VALUE)?)?;
        if !parameter.is_writable() {
            return Err(Status::READ_ONLY);
        }
        if !parameter.allows(value) {
            return Err(Status::INVALID_VALUE);
        }
        pairs.push((parameter, value));
    }
    match pairs.is_empty() {
        true => Err(Status::UNKNOWN_PARAMETER),
        false => Ok(pairs),
    }
}

fn kept<'a>(
    scope: Scope,
    kept: SettingsCommand,
    words: &mut impl Iterator<Item = &'a str>,
) -> Result<Verb, Status> {
    Ok(Verb::Keep(scope, kept, names(scope, words)?))
}

fn listing(name: &str) -> Option<(Scope, Listing)> {
    let (scope, rest) = match name.split_at_checked(1)? {
        ("F", rest) => (Scope::Motor, rest),
        ("P", rest) => (Scope::Hand, rest),
        _ => return None,
    };
    let listing = |advanced, values| Some((scope, Listing { advanced, values }));
    match rest {
        "LIST" => listing(false, false),
        "LISTV" => listing(false, true),
        "LISTA" => listing(true, false),
        "LISTAV" => listing(true, true),
        _ => None,
    }
}

/// The line without its end.
impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(motors) = self.motors {
            write!(f, "{motors}")?;
        }
        write!(f, "{}", self.verb)
    }
}

impl fmt::Display for Verb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let with = |f: &mut fmt::Formatter<'_>, name: &str, value: Option<i32>| match value {
            Some(value) => write!(f, "{name} {value}"),
            None => f.write_str(name),
        };
        match self {
            Verb::Close => f.write_str("C"),
            Verb::Open => f.write_str("O"),
            Verb::TorqueClose => f.write_str("TC"),
            Verb::TorqueOpen => f.write_str("TO"),
            Verb::StepClose(step) => with(f, "IC", *step),
            Verb::StepOpen(step) => with(f, "IO", *step),
            Verb::Move(position) => with(f, "M", *position),
            Verb::Home => f.write_str("HOME"),
            Verb::Initialise => f.write_str("HI"),
            Verb::Terminate => f.write_str("T"),
            Verb::Loop => f.write_str("LOOP"),
            Verb::Set(scope, pairs) => {
                write!(f, "{}SET", letter(*scope))?;
                pairs
                    .iter()
                    .try_for_each(|(parameter, value)| write!(f, " {parameter} {value}"))
            }
            Verb::Get(scope, parameters) => {
                write!(f, "{}GET", letter(*scope))?;
                parameters.iter().try_for_each(|each| write!(f, " {each}"))
            }
            Verb::Keep(scope, kept, parameters) => {
                let kept = match kept {
                    SettingsCommand::Load => "LOAD",
                    SettingsCommand::Save => "SAVE",
                    SettingsCommand::Default => "DEF",
                };
                write!(f, "{}{kept}", letter(*scope))?;
                parameters.iter().try_for_each(|each| write!(f, " {each}"))
            }
            Verb::List(scope, listing) => {
                let advanced = if listing.advanced { "A" } else { "" };
                let values = if listing.values { "V" } else { "" };
                write!(f, "{}LIST{advanced}{values}", letter(*scope))
            }
            Verb::Help { advanced: false } => f.write_str("?"),
            Verb::Help { advanced: true } => f.write_str("A?"),
            Verb::Errors => f.write_str("ERR"),
            Verb::Reset => f.write_str("RESET"),
            Verb::Version => f.write_str("VERS"),
            Verb::Ping => Ok(()),
        }
    }
}

fn letter(scope: Scope) -> char {
    match scope {
        Scope::Motor => 'F',
        Scope::Hand => 'P',
    }
}

impl From<Verb> for Command {
    fn from(verb: Verb) -> Self {
        Self::plain(verb)
    }
}

impl From<(Motor, Verb)> for Command {
    fn from((motor, verb): (Motor, Verb)) -> Self {
        Self::new(motor.into(), verb)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_sources_print_is_understood_and_printed_again() {
        for line in [
            "GC",
            "HI",
            "1IO",
            "1T",
            "GTC",
            "123LOOP",
            "SGO",
            "SM 1200",
            "SM 1500",
            "SC",
            "3M 8000",
            "12M 8000",
            "GM 4000",
            "1234C",
            "FGET DS DP",
            "PGET TEMP",
            "2FGET P",
            "1FGET BP",
            "GTO",
            "GHOME",
            "SHOME",
            "IC -20",
            "M",
            "FLIST",
            "FLISTV",
            "PLISTAV",
            "FLOAD",
            "PSAVE BAUD",
            "12FSET LCV 1 LCVC 1 LCPG 0 LFV 0 LFS 1 LFAP 0 LFDP 1 LFDPC 1",
            "PSET LFT 1",
            "?",
            "A?",
            "ERR",
            "RESET",
            "VERS",
            "FDEF MCV",
            "PSET BAUD 384",
            "",
        ] {
            let command = Command::parse(line).unwrap_or_else(|status| panic!("{line}: {status}"));
            // All four and fingers with spread have two spellings.
            let again = Command::parse(&command.to_string()).unwrap();
            assert_eq!(again, command, "{line}");
            assert_eq!(Command::parse(&line.to_lowercase()), Ok(command), "{line}");
        }
    }

    #[test]
    fn what_is_wrong_is_refused_as_the_hand_does() {
        let check = |line: &str, status| assert_eq!(Command::parse(line), Err(status), "{line}");
        check("XYZ", Status::UNKNOWN_COMMAND);
        check("G C", Status::UNKNOWN_COMMAND);
        check("SAVE", Status::UNKNOWN_COMMAND);
        check("5C", Status::UNKNOWN_COMMAND);
        check("C\u{e9}", Status::UNKNOWN_COMMAND);
        check("M 8000!", Status::INVALID_VALUE);
        check("GC!", Status::UNKNOWN_COMMAND);
        check("!", Status::UNKNOWN_COMMAND);
        check("M 20001", Status::INVALID_VALUE);
        check("M 1 2", Status::TOO_MANY_ARGUMENTS);
        check("GC 1", Status::TOO_MANY_ARGUMENTS);
        check("FGET", Status::UNKNOWN_PARAMETER);
        check("FGET TEMP", Status::UNKNOWN_PARAMETER);
        check("FSET P 1", Status::READ_ONLY);
        check("FSET MCV", Status::INVALID_VALUE);
        check("FSET MCV 5000", Status::INVALID_VALUE);
        check("1PSET LFT 1", Status::NO_PREFIX_ALLOWED);
        check("GRESET", Status::NO_PREFIX_ALLOWED);
        check(&"M".repeat(256), Status::UNKNOWN_COMMAND);
    }
}
