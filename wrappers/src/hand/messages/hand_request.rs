//! Requests as words.

use yarp_devices::GraspKind;
use yarp_wire::{Bottle, Value, Vocab32};

use crate::control_board::messages::{Selection, axis, float, floats, integer};

/// Optional prefix of every request.
const HAND: Spelling = spelling("hand", "hand");
/// Stands for a motor without expectation.
const ANYWHERE: &str = "any";

/// A request to a hand.
///
/// ```
/// use yarp_devices::GraspKind;
/// use yarp_wire::Bottle;
/// use yarp_wrappers::hand::messages::Request;
///
/// let typed = Bottle::parse("grasp rect").unwrap();
/// let request = Request::parse(&typed).unwrap();
/// assert_eq!(request, Request::Grasp(GraspKind::Rectangular));
/// assert_eq!(request.to_bottle().to_string(), "[hand] [gras] rectangular");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// List the requests.
    Help,
    /// Prepares the motors.
    Initialise,
    /// Stops the hand.
    Abort,
    /// Query whether the line to the hand exists.
    IsConnected,
    /// Query the positions of the motors.
    Positions,
    /// Moves motors to angles, degrees.
    Move(Selection, Vec<f64>),
    /// A line of the hand's own language.
    Command(String),
    /// Opens the fingers.
    Open,
    /// Closes them.
    Close,
    /// Closes them, and ends with controlled torque.
    CloseWithTorque,
    /// Goes through the motions of a grasp.
    Grasp(GraspKind),
    /// Query the distances of motors from their expected positions, degrees.
    Check([Option<f64>; 4]),
}

/// Reasons why a message is not a request.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Malformed {
    /// It begins with no word that is known.
    #[error("unknown word {0}; `help` lists those that are known")]
    Word(String),
    /// Values are missing, too many, or of another kind.
    #[error("{word} needs {expected}")]
    Values {
        /// The request.
        word: &'static str,
        /// The expected values.
        expected: &'static str,
    },
    /// No grasp has this name, or several begin with it.
    #[error(
        "no grasp, or more than one, is called {0}; there are open_wide, isometric, rectangular, palm, needle, peg, peg_close"
    )]
    Grasp(String),
}

/// Spelling of a request, typed and on the wire.
struct Spelling {
    word: &'static str,
    short: Vocab32,
}

const fn spelling(word: &'static str, short: &str) -> Spelling {
    let short = Vocab32::new(short);
    Spelling { word, short }
}

const HELP: Spelling = spelling("help", "help");
const INITIALISE: Spelling = spelling("initialise", "init");
const ABORT: Spelling = spelling("abort", "abrt");
const CONNECTED: Spelling = spelling("connected", "conn");
const POSITIONS: Spelling = spelling("positions", "pos");
const MOVE: Spelling = spelling("move", "move");
const COMMAND: Spelling = spelling("gcl", "gcl");
const OPEN: Spelling = spelling("open", "open");
const CLOSE: Spelling = spelling("close", "clos");
const TORQUE: Spelling = spelling("torque", "torq");
const GRASP: Spelling = spelling("grasp", "gras");
const CHECK: Spelling = spelling("check", "chck");

/// Requests without values.
const PLAIN: [(Spelling, Request); 8] = [
    (HELP, Request::Help),
    (INITIALISE, Request::Initialise),
    (ABORT, Request::Abort),
    (CONNECTED, Request::IsConnected),
    (POSITIONS, Request::Positions),
    (OPEN, Request::Open),
    (CLOSE, Request::Close),
    (TORQUE, Request::CloseWithTorque),
];

impl Spelling {
    /// Returns whether the value is this word: the whole word, or the short one in any form.
    fn is(&self, value: &Value) -> bool {
        match value {
            Value::Vocab32(word) => *word == self.short,
            Value::String(text) => text
                .as_str()
                .is_some_and(|text| text == self.word || text.bytes().eq(self.short.bytes())),
            _ => false,
        }
    }

    fn needs(&self, expected: &'static str) -> Malformed {
        Malformed::Values {
            word: self.word,
            expected,
        }
    }
}

impl Request {
    /// Reads a request.
    ///
    /// Errors: [`Malformed`], with the expected form.
    pub fn parse(message: &Bottle) -> Result<Self, Malformed> {
        let items = match message.as_slice() {
            [first, rest @ ..] if HAND.is(first) => rest,
            items => items,
        };
        let Some((word, values)) = items.split_first() else {
            return Err(Malformed::Word("\"\"".to_owned()));
        };
        let plain = PLAIN.iter().find(|(spelling, _)| spelling.is(word));
        if let Some((spelling, request)) = plain {
            return match values {
                [] => Ok(request.clone()),
                _ => Err(spelling.needs("nothing behind it")),
            };
        }
        if MOVE.is(word) {
            let (axes, angles) = moved(values).ok_or_else(|| {
                MOVE.needs("an axis and an angle, a list of each, or a list of four angles")
            })?;
            return Ok(Self::Move(axes, angles));
        }
        if COMMAND.is(word) {
            let line = line(values);
            return line
                .map(Self::Command)
                .ok_or_else(|| COMMAND.needs("a line of the hand's own language"));
        }
        if GRASP.is(word) {
            let [name @ (Value::String(_) | Value::Vocab32(_))] = values else {
                return Err(GRASP.needs("the name of a grasp"));
            };
            return grasp(&name.to_plain_string()).map(Self::Grasp);
        }
        if CHECK.is(word) {
            return expected(values)
                .map(Self::Check)
                .ok_or_else(|| CHECK.needs("a list of four angles, or `any` for some of them"));
        }
        Err(Malformed::Word(word.to_string()))
    }

    /// The request as it travels.
    pub fn to_bottle(&self) -> Bottle {
        let say = |spelling: &Spelling| Bottle::of(HAND.short).with(spelling.short);
        match self {
            Self::Move(axes, angles) => {
                let angles = angles.iter().copied().map(Value::from).collect::<Bottle>();
                let said = say(&MOVE);
                match axes {
                    Selection::One(axis) => {
                        let angle = angles.get(0).cloned();
                        angle
                            .into_iter()
                            .fold(said.with(integer(axis.index())), Bottle::with)
                    }
                    Selection::Group(group) => {
                        let group: Bottle =
                            group.iter().map(|axis| integer(axis.index())).collect();
                        said.with(group).with(angles)
                    }
                    Selection::All => said.with(angles),
                }
            }
            Self::Command(line) => say(&COMMAND).with(line.as_str()),
            Self::Grasp(kind) => say(&GRASP).with(kind.name()),
            Self::Check(expected) => {
                let place = |place: &Option<f64>| match place {
                    Some(angle) => Value::from(*angle),
                    None => Value::from(ANYWHERE),
                };
                say(&CHECK).with(expected.iter().map(place).collect::<Bottle>())
            }
            plain => PLAIN
                .iter()
                .find(|(_, request)| request == plain)
                .map(|(spelling, _)| say(spelling))
                .expect("all others are there"),
        }
    }

    /// Returns whether it may take as long as a motion; the others are answered at once.
    pub fn lasts(&self) -> bool {
        !matches!(self, Self::Help | Self::Abort | Self::IsConnected)
    }
}

fn moved(values: &[Value]) -> Option<(Selection, Vec<f64>)> {
    Some(match values {
        [angles] => (Selection::All, floats(angles.as_list()?)?),
        [axes, angles] => match (axes.as_list(), angles.as_list()) {
            (Some(axes), Some(angles)) => {
                let group = axes.iter().map(axis).collect::<Option<_>>()?;
                (Selection::Group(group), floats(angles)?)
            }
            (None, None) => (Selection::One(axis(axes)?), vec![float(angles)?]),
            _ => return None,
        },
        _ => return None,
    })
}

/// Returns a text that was typed as one string, or as several words and whole numbers.
fn line(values: &[Value]) -> Option<String> {
    let word = |value: &Value| match value {
        Value::String(text) => text.as_str().map(str::to_owned),
        Value::Int8(_) | Value::Int16(_) | Value::Int32(_) | Value::Int64(_) => {
            value.as_i64().map(|number| number.to_string())
        }
        _ => None,
    };
    let words: Vec<String> = values.iter().map(word).collect::<Option<_>>()?;
    (!words.is_empty()).then(|| words.join(" "))
}

/// The grasp of this name, or the only one that begins so.
fn grasp(name: &str) -> Result<GraspKind, Malformed> {
    if let Ok(kind) = name.parse() {
        return Ok(kind);
    }
    let mut begun = GraspKind::ALL
        .into_iter()
        .filter(|kind| !name.is_empty() && kind.name().starts_with(name));
    match (begun.next(), begun.next()) {
        (Some(kind), None) => Ok(kind),
        _ => Err(Malformed::Grasp(format!("{name:?}"))),
    }
}

fn expected(values: &[Value]) -> Option<[Option<f64>; 4]> {
    let [list] = values else { return None };
    let place = |value: &Value| match value {
        Value::String(text) if text.as_str() == Some(ANYWHERE) => Some(None),
        other => float(other).map(Some),
    };
    let places: Vec<Option<f64>> = list.as_list()?.iter().map(place).collect::<Option<_>>()?;
    places.try_into().ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Words of the language in any order, which random bytes hardly ever form.
        #[test]
        fn any_words_are_refused_or_said_again_the_same_way(words in prop::collection::vec(
            prop::sample::select(vec![
                "[hand]", "hand", "open", "[clos]", "torque", "move", "[move]", "0", "1", "-1", "45.0", "nan",
                "(0 3)", "(45.0 90.0)", "(1 2 3 4)", "(64 any any 1)", "check", "gcl", "\"FGET P\"", "GC", "grasp",
                "[gras]", "rect", "peg", "p", "()", "{1 2}", "\"\"", "help", "[abrt]", "positions",
            ]),
            0..6,
        )) {
            if let Ok(request) = read(&words.join(" ")) {
                let again = Request::parse(&request.to_bottle());
                // Compared as they print: a nan is not equal to itself.
                prop_assert_eq!(format!("{again:?}"), format!("{:?}", Ok::<_, Malformed>(request)));
            }
        }
    }

    fn read(typed: &str) -> Result<Request, Malformed> {
        Request::parse(&Bottle::parse(typed).unwrap())
    }

    #[test]
    fn people_and_programs_are_understood() {
        let check = |typed: &str, request: Request, said: &str| {
            assert_eq!(read(typed), Ok(request.clone()), "{typed}");
            assert_eq!(request.to_bottle().to_string(), said);
            assert_eq!(Request::parse(&request.to_bottle()), Ok(request), "{said}");
        };
        check("help", Request::Help, "[hand] [help]");
        check("[hand] [open]", Request::Open, "[hand] [open]");
        check("hand close", Request::Close, "[hand] [clos]");
        check("init", Request::Initialise, "[hand] [init]");
        check("torque", Request::CloseWithTorque, "[hand] [torq]");
        let peg = Request::Grasp(GraspKind::Peg);
        check("grasp peg", peg, "[hand] [gras] peg");
        let iso = Request::Grasp(GraspKind::Isometric);
        check("[gras] [iso]", iso, "[hand] [gras] isometric");
        let line = |line: &str| Request::Command(line.to_owned());
        check("gcl 3M 8000", line("3M 8000"), "[hand] [gcl] \"3M 8000\"");
        check("gcl \"\"", line(""), "[hand] [gcl] \"\"");
        let one = Request::Move(Selection::One(3.into()), vec![90.0]);
        check("move 3 90", one, "[hand] [move] 3 90.0");
        let group = Selection::Group(vec![0.into(), 2.into()]);
        let two = Request::Move(group, vec![1.0, 2.5]);
        check("move (0 2) (1 2.5)", two, "[hand] [move] (0 2) (1.0 2.5)");
        let all = Request::Move(Selection::All, vec![1.0, 2.0, 3.0, 4.0]);
        check("move (1 2 3 4)", all, "[hand] [move] (1.0 2.0 3.0 4.0)");
        let some = Request::Check([Some(64.0), None, None, Some(1.0)]);
        check(
            "check (64 any any 1)",
            some,
            "[hand] [chck] (64.0 any any 1.0)",
        );
    }

    #[test]
    fn what_is_malformed_says_what_would_do() {
        let check = |typed: &str, words: &str| {
            assert_eq!(read(typed).unwrap_err().to_string(), words, "{typed}");
        };
        for typed in ["", "[hand]", "dance", "[set] [pos] 0 10", "(open)", "1.5"] {
            let error = read(typed).unwrap_err();
            assert!(matches!(error, Malformed::Word(_)), "{typed}: {error}");
        }
        check("open wide", "open needs nothing behind it");
        check("grasp", "grasp needs the name of a grasp");
        for typed in ["grasp p", "grasp \"\"", "grasp fist"] {
            let error = read(typed).unwrap_err();
            assert!(matches!(error, Malformed::Grasp(_)), "{typed}: {error}");
        }
        for typed in [
            "move",
            "move 0",
            "move 0 (1)",
            "move -1 1",
            "move 0 1 2",
            "move 0.5 1",
        ] {
            let error = read(typed).unwrap_err();
            assert!(
                matches!(error, Malformed::Values { .. }),
                "{typed}: {error}"
            );
        }
        for typed in [
            "gcl",
            "gcl (GC)",
            "gcl 1.5",
            "check 1 2 3 4",
            "check (1 2 3)",
            "check (1 2 3 x)",
        ] {
            let error = read(typed).unwrap_err();
            assert!(
                matches!(error, Malformed::Values { .. }),
                "{typed}: {error}"
            );
        }
    }
}
