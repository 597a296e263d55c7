//! Replies, and errors that keep their kind.

use std::error::Error;

use yarp_devices::DeviceError;
use yarp_devices::hand::gcl::StatusBits;
use yarp_devices::hand::{HandError, HandErrorKind};
use yarp_ports::error_chain;
use yarp_wire::{Bottle, Value, Vocab32};

use super::hand_request::{Malformed, Request};
use crate::control_board::messages::Reply as Usage;

/// Word after `[fail]` for an error that does not concern the hand.
const MALFORMED: &str = "malformed";
const DEVICE: &str = "device";

/// Reply to a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// `[ok]`, with the result.
    Done(Answer),
    /// `[fail]`, a kind, and words.
    Refused(Refused),
}

/// Result of a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Nothing: it is done.
    Done,
    /// A truth value.
    Flag(bool),
    /// Text of the hand.
    Text(String),
    /// One number per motor, degrees.
    Numbers([f64; 4]),
}

/// Reasons why a request was not executed.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Refused {
    /// Kind of the hand's error; `None` if the hand was not asked at all.
    pub kind: Option<HandErrorKind>,
    /// `malformed` or `device` if it was not asked.
    why: &'static str,
    /// The error chain.
    pub words: String,
}

impl From<Malformed> for Refused {
    fn from(error: Malformed) -> Self {
        Self {
            kind: None,
            why: MALFORMED,
            words: error.to_string(),
        }
    }
}

impl From<DeviceError> for Refused {
    fn from(error: DeviceError) -> Self {
        let cause = error
            .source()
            .and_then(|cause| cause.downcast_ref::<HandError>());
        match cause {
            Some(cause) => cause.into(),
            None => Self {
                kind: None,
                why: DEVICE,
                words: error_chain(&error),
            },
        }
    }
}

impl From<&HandError> for Refused {
    fn from(error: &HandError) -> Self {
        let kind = error.kind();
        Self {
            kind: Some(kind),
            why: kind.name(),
            words: error_chain(error),
        }
    }
}

impl Refused {
    /// Converts to the error of a device call: a [`HandError`] of the same kind, if it was the hand's.
    pub fn into_error(self, peer: &str, said: &str) -> DeviceError {
        let Refused { kind, words, .. } = self;
        match kind {
            Some(kind) => HandError::Elsewhere { kind, words }.at(peer),
            None => DeviceError::Refused {
                peer: peer.to_owned(),
                step: format!("`{said}`"),
                advice: words,
            },
        }
    }
}

impl Reply {
    /// The reply as it travels.
    pub fn to_bottle(&self) -> Bottle {
        let ok = Bottle::of(Vocab32::OK);
        match self {
            Self::Done(Answer::Done) => ok,
            Self::Done(Answer::Flag(flag)) => ok.with(i32::from(*flag)),
            Self::Done(Answer::Text(text)) => ok.with(text.as_str()),
            Self::Done(Answer::Numbers(numbers)) => {
                let [first, second, third, spread] = numbers;
                ok.with(format!("{first:?} {second:?} {third:?} {spread:?}").as_str())
            }
            Self::Refused(Refused { kind, why, words }) => {
                let fail = Bottle::of(Vocab32::FAIL).with(*why).with(words.as_str());
                match kind {
                    Some(HandErrorKind::Status(status)) => fail.with(i32::from(status.bits())),
                    _ => fail,
                }
            }
        }
    }

    /// Reads the reply to a request; `None` for other messages.
    pub fn read(request: &Request, reply: &Bottle) -> Option<Self> {
        match reply.as_slice() {
            [Value::Vocab32(Vocab32::OK), values @ ..] => answer(request, values).map(Self::Done),
            [Value::Vocab32(Vocab32::FAIL), why, words, rest @ ..] => {
                let (why, words) = (why.as_str()?, words.as_str()?.to_owned());
                let plain = [MALFORMED, DEVICE].into_iter().find(|known| *known == why);
                if let Some(why) = plain {
                    let kind = None;
                    return Some(Self::Refused(Refused { kind, why, words }));
                }
                let bits = rest.first().and_then(Value::as_i64);
                let bits = bits.and_then(|bits| StatusBits::try_from(bits).ok());
                let kind = HandErrorKind::from_name(why, bits)?;
                Some(Self::Refused(Refused {
                    kind: Some(kind),
                    why: kind.name(),
                    words,
                }))
            }
            _ => None,
        }
    }
}

fn answer(request: &Request, values: &[Value]) -> Option<Answer> {
    Some(match (request, values) {
        (Request::IsConnected, [Value::Int32(flag)]) => Answer::Flag(*flag != 0),
        (Request::Command(_), [Value::String(text)]) => Answer::Text(text.as_str()?.to_owned()),
        (Request::Positions | Request::Check(_), [Value::String(text)]) => {
            let numbers = text.as_str()?.split(' ').map(|word| word.parse().ok());
            let numbers: Vec<f64> = numbers.collect::<Option<_>>()?;
            Answer::Numbers(numbers.try_into().ok()?)
        }
        (Request::IsConnected | Request::Command(_) | Request::Positions, _) => return None,
        (Request::Check(_), _) => return None,
        (_, []) => Answer::Done,
        _ => return None,
    })
}

/// Requests that can be typed, and their effect.
const LINES: [(&str, &str); 12] = [
    ("help", "this list"),
    ("initialise", "prepare the motors; the fingers open"),
    ("open", "open the fingers"),
    ("close", "close the fingers until they meet something"),
    ("torque", "close them and end with controlled torque"),
    (
        "grasp rectangular",
        "also open_wide, isometric, palm, needle, peg, peg_close; the beginning of a name will do",
    ),
    (
        "check (64.0 any any 90.0)",
        "how far motors are from these angles, degrees",
    ),
    (
        "positions",
        "where the motors are, degrees: three fingers, the spread",
    ),
    (
        "move 0 45.0",
        "move a motor; move (0 3) (45.0 90.0) several; move (10.0 10.0 10.0 0.0) all",
    ),
    ("gcl FGET P", "a line of the hand's own language"),
    ("connected", "1 if the line to the hand is there, else 0"),
    (
        "abort",
        "stop the hand; over another connection while it moves",
    ),
];

/// The answer to `help`: `[many]`, then requests and their effects in turn.
pub fn help() -> Bottle {
    Usage::usage(LINES.map(|(typed, meaning)| (Bottle::of(typed), meaning.to_owned())))
        .into_bottle()
}

#[cfg(test)]
mod tests {
    use yarp_devices::hand::gcl::Status;

    use super::*;

    #[test]
    fn everything_that_help_lists_is_understood() {
        for (typed, _) in LINES {
            let typed = Bottle::parse(typed).unwrap();
            assert!(Request::parse(&typed).is_ok(), "{typed}");
        }
    }

    #[test]
    fn errors_keep_their_kind_on_the_way() {
        let refused = |error: HandError| Reply::Refused(error.at("/dev/hand").into());
        let check = |error: HandError, said: &str| {
            let kind = error.kind();
            let reply = refused(error);
            assert_eq!(reply.to_bottle().to_string(), said);
            let back = Reply::read(&Request::Open, &reply.to_bottle());
            let Some(Reply::Refused(back)) = back else {
                panic!("{back:?}");
            };
            let words = back.words.clone();
            let error = back.into_error("/hand", "[hand] [open]");
            let cause: &HandError = error.source().unwrap().downcast_ref().unwrap();
            assert_eq!((cause.kind(), cause.to_string()), (kind, words));
        };
        check(
            HandError::Busy { doing: "GC".into() },
            "[fail] busy \"the hand is busy with `GC`\"",
        );
        check(
            HandError::Status {
                command: "GC".into(),
                status: Status::NOT_INITIALISED,
                answer: "ERR 4".into(),
            },
            "[fail] status \"the hand answered `GC` with an error: motor not initialised (4)\" 4",
        );
        check(
            HandError::LineLost {
                step: "sending `GC`".into(),
                source: std::io::Error::other("gone"),
            },
            "[fail] line_lost \"the line broke while sending `GC`: gone\"",
        );
    }

    #[test]
    fn what_is_no_reply_is_none() {
        let check = |request: Request, said: &str| {
            let said = Bottle::parse(said).unwrap();
            assert_eq!(Reply::read(&request, &said), None, "{said}");
        };
        check(Request::Open, "");
        check(Request::Open, "[ok] 1");
        check(Request::Positions, "[ok]");
        check(Request::Positions, "[ok] \"1 2 3\"");
        check(Request::Positions, "[ok] \"1 2 3 x\"");
        check(Request::Positions, "[ok] (1.0 2.0 3.0 4.0)");
        check(Request::IsConnected, "[ok] yes");
        check(Request::Command("T".into()), "[ok]");
        check(Request::Open, "[fail]");
        check(Request::Open, "[fail] status words");
        check(Request::Open, "[fail] status words 70000");
        check(Request::Open, "[fail] strange words");
    }
}
