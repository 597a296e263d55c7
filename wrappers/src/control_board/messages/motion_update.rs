//! Words of ours about numbered motions; stock has none of them.
//!
//! ```text
//! [numb] [set] [pos] 0 10.0     move, and say the number         [move] N (0), else [drop] .., [fail] reason
//! [numb] [set] [rel] 0 10.0     the same, from where it is
//! [numb] [get] N                what became of it                one of those below
//! [numb] [drop]                 how many orders were dropped     [is] [drop] count
//! ```
//!
//! The state of a motion, as `async:o` announces its end and as an RPC replies:
//!
//! ```text
//! [move] N (axes)               it is under way (RPC only)
//! [done] N (axes)               all axes arrived
//! [over] N (axes) M             an axis was taken by order M
//! [stop] N (axes)               an axis was stopped
//! [fail] N (axes) reason        an error, a fault, a change of mode
//! [drop] N (axes) M             the device never got it, M took its place; 0: there was no room, or no server any more
//! [none] N                      a number that this server did not give, or long ago (RPC only)
//! ```

use yarp_devices::AxisIndex;
use yarp_wire::{Bottle, Value, Vocab32};

use super::board_request::{Malformed, Request};
use super::board_vocabulary as word;
use super::number_parsing;
use super::request_table::Set;

const NUMBERED: Vocab32 = Vocab32::new("numb");
const MOVE: Vocab32 = Vocab32::new("move");
const DONE: Vocab32 = Vocab32::new("done");
const OVER: Vocab32 = Vocab32::new("over");
const STOP: Vocab32 = Vocab32::new("stop");
const DROP: Vocab32 = Vocab32::new("drop");
const NONE: Vocab32 = Vocab32::new("none");

/// End of a motion.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum MotionEnd {
    /// All axes arrived.
    Done,
    /// Another command took one of its axes.
    Superseded {
        /// The number of that command.
        by: u64,
    },
    /// One of its axes was stopped.
    Stopped,
    /// It was broken off.
    Failed {
        /// The reason, in words.
        reason: String,
    },
    /// The device never got it.
    Dropped {
        /// The number of the command that replaced it; 0 if the queue was full, or the server has ended.
        by: u64,
    },
}

/// State of a motion on the board.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum MotionState {
    /// It is in progress.
    Moving,
    /// It ended.
    Ended(MotionEnd),
    /// The number is not one of those that this board remembers.
    Unknown,
}

/// State of a numbered motion, as the board reports it.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct MotionUpdate {
    /// Its number, from 1.
    pub number: u64,
    /// Its axes.
    pub axes: Vec<AxisIndex>,
    /// Its state.
    pub state: MotionState,
}

impl MotionUpdate {
    /// Encodes the update.
    pub fn to_bottle(&self) -> Bottle {
        let (said, last) = match &self.state {
            MotionState::Moving => (MOVE, None),
            MotionState::Unknown => return Bottle::of(NONE).with(integer(self.number)),
            MotionState::Ended(end) => match end {
                MotionEnd::Done => (DONE, None),
                MotionEnd::Superseded { by } => (OVER, Some(integer(*by))),
                MotionEnd::Stopped => (STOP, None),
                MotionEnd::Failed { reason } => (Vocab32::FAIL, Some(reason.as_str().into())),
                MotionEnd::Dropped { by } => (DROP, Some(integer(*by))),
            },
        };
        let axes: Bottle = self
            .axes
            .iter()
            .map(|axis| number_parsing::integer(axis.index()))
            .collect();
        let mut message = Bottle::of(said).with(integer(self.number)).with(axes);
        message.extend(last);
        message
    }

    /// Reads it; `None` for anything else.
    pub fn from_bottle(message: &Bottle) -> Option<Self> {
        let [said, number, rest @ ..] = message.as_slice() else {
            return None;
        };
        let said = said.as_vocab()?;
        let number = unsigned(number)?;
        if said == NONE && rest.is_empty() {
            return Some(Self {
                number,
                axes: Vec::new(),
                state: MotionState::Unknown,
            });
        }
        let [axes, rest @ ..] = rest else {
            return None;
        };
        let axes = axes.as_list()?.iter().map(number_parsing::axis);
        let axes = axes.collect::<Option<_>>()?;
        let ended = match (said, rest) {
            (MOVE, []) => None,
            (DONE, []) => Some(MotionEnd::Done),
            (OVER, [by]) => Some(MotionEnd::Superseded { by: unsigned(by)? }),
            (STOP, []) => Some(MotionEnd::Stopped),
            (Vocab32::FAIL, [reason]) => Some(MotionEnd::Failed {
                reason: reason.as_str()?.to_owned(),
            }),
            (DROP, [by]) => Some(MotionEnd::Dropped { by: unsigned(by)? }),
            _ => return None,
        };
        Some(Self {
            number,
            axes,
            state: ended.map_or(MotionState::Moving, MotionState::Ended),
        })
    }
}

/// Requests of our clients that stock does not have.
#[derive(Clone, Debug, PartialEq)]
pub enum Numbered {
    /// Submit a command and return its number.
    Submit(Set),
    /// To know what became of the motion of this number.
    Ask(u64),
    /// Query the number of dropped commands.
    Drops,
}

impl Numbered {
    /// Reads it; `None` for a message that does not begin with `[numb]`.
    pub fn parse(message: &Bottle) -> Option<Result<Self, Malformed>> {
        let (first, rest) = message.as_slice().split_first()?;
        if first.as_vocab() != Some(NUMBERED) {
            return None;
        }
        let wrong = Err(Malformed::Values(NUMBERED));
        Some(match rest {
            [said] if said.as_vocab() == Some(DROP) => Ok(Self::Drops),
            [said, asked] if said.as_vocab() == Some(word::GET) => {
                unsigned(asked).map(Self::Ask).map_or(wrong, Ok)
            }
            _ => match Request::parse(&rest.to_vec().into()) {
                Ok(Request::Set(set)) => Ok(Self::Submit(set)),
                Ok(_) => wrong,
                Err(error) => Err(error),
            },
        })
    }

    /// Returns the message, or `None` if 3.x does not have the command.
    pub fn to_bottle(&self) -> Option<Bottle> {
        let mut message = Bottle::of(NUMBERED);
        match self {
            Self::Submit(set) => message.extend(Request::Set(set.clone()).to_bottle()?),
            Self::Ask(number) => message.extend([word::GET.into(), integer(*number)]),
            Self::Drops => message.push(DROP),
        }
        Some(message)
    }

    /// The answer to [`Numbered::Drops`].
    pub fn drops(dropped: u64) -> Bottle {
        Bottle::of(word::IS).with(DROP).with(integer(dropped))
    }

    /// Reads the answer to [`Numbered::Drops`].
    pub fn read_drops(answer: &Bottle) -> Option<u64> {
        match answer.as_slice() {
            [is, drop, count]
                if is.as_vocab() == Some(word::IS) && drop.as_vocab() == Some(DROP) =>
            {
                unsigned(count)
            }
            _ => None,
        }
    }
}

/// Numbers of a run stay far below 2^63.
fn integer(number: u64) -> Value {
    Value::Int64(i64::try_from(number).unwrap_or(i64::MAX))
}

fn unsigned(value: &Value) -> Option<u64> {
    u64::try_from(value.as_i64()?).ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn end() -> impl Strategy<Value = MotionEnd> {
        let by = 0..1_u64 << 53;
        prop_oneof![
            Just(MotionEnd::Done),
            Just(MotionEnd::Stopped),
            by.clone().prop_map(|by| MotionEnd::Superseded { by }),
            by.prop_map(|by| MotionEnd::Dropped { by }),
            ".*".prop_map(|reason| MotionEnd::Failed { reason }),
        ]
    }

    fn value() -> impl Strategy<Value = Value> {
        let words = [
            "numb", "move", "done", "over", "stop", "fail", "drop", "none", "get", "set", "pos",
        ];
        let word = prop::sample::select(words.to_vec()).prop_map(|word| Vocab32::new(word).into());
        let list = prop::collection::vec(any::<i32>().prop_map(Value::Int32), 0..4);
        prop_oneof![
            word,
            any::<i64>().prop_map(Value::Int64),
            any::<f64>().prop_map(Value::Float64),
            ".{0,4}".prop_map(Value::from),
            list.prop_map(|items| Value::List(items.into())),
        ]
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(
            number in 0..1_u64 << 53,
            axes in prop::collection::vec(0..100_usize, 0..8),
            end in end(),
        ) {
            let axes: Vec<AxisIndex> = axes.into_iter().map(AxisIndex::from).collect();
            for state in [MotionState::Moving, MotionState::Ended(end.clone())] {
                let news = MotionUpdate { number, axes: axes.clone(), state };
                prop_assert_eq!(MotionUpdate::from_bottle(&news.to_bottle()), Some(news));
            }
            let asked = Numbered::Ask(number);
            let message = asked.to_bottle().unwrap();
            prop_assert_eq!(Numbered::parse(&message), Some(Ok(asked)));
        }

        #[test]
        fn arbitrary_messages_are_judged(items in prop::collection::vec(value(), 0..6)) {
            let message = Bottle::from(items);
            if let Some(news) = MotionUpdate::from_bottle(&message) {
                prop_assert_eq!(MotionUpdate::from_bottle(&news.to_bottle()), Some(news));
            }
            if let Some(Ok(wanted)) = Numbered::parse(&message) {
                prop_assert!(wanted.to_bottle().is_some());
            }
            let _ = Numbered::read_drops(&message);
        }
    }

    #[test]
    fn a_person_can_type_and_read_it() {
        let typed = |text: &str| Numbered::parse(&Bottle::parse(text).unwrap());
        assert!(matches!(
            typed("numb set pos 0 10.0"),
            Some(Ok(Numbered::Submit(_)))
        ));
        assert_eq!(
            typed("numb get 4000000000000001"),
            Some(Ok(Numbered::Ask(4_000_000_000_000_001)))
        );
        assert_eq!(typed("numb drop"), Some(Ok(Numbered::Drops)));
        assert_eq!(typed("set pos 0 10.0"), None);
        assert!(typed("numb get encs").is_some_and(|wanted| wanted.is_err()));
        assert!(typed("numb").is_some_and(|wanted| wanted.is_err()));
        let news = MotionUpdate {
            number: 7,
            axes: vec![0.into(), 2.into()],
            state: MotionState::Ended(MotionEnd::Superseded { by: 9 }),
        };
        assert_eq!(news.to_bottle().to_string(), "[over] 7 (0 2) 9");
        assert_eq!(Numbered::read_drops(&Numbered::drops(5)), Some(5));
    }
}
