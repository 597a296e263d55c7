//! Requests of YARP 3.5 to 3.12, on `rpc:i`.
//!
//! ```text
//! [get] [word] SELECTION              [get] [interface] [word] SELECTION
//! [set] [word] SELECTION VALUES       [set] [interface] [word] SELECTION VALUES
//! ```
//!
//! Words are compared as vocabs, and a string counts as the vocab of its first four characters, so that a person can
//! type them. A message that is not parsed completely is refused, above all commands to move.

use yarp_devices::PidKind;
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

use super::axis_selection::{Form, Selection};
use super::board_arguments::{Arguments, push};
use super::board_request::{Get, Malformed, Request};
use super::board_vocabulary as word;
use super::number_parsing;
use super::pid_messages;
use super::request_spelling::Spelling;
use super::request_table::{Action, Place, Row, Set, Setting, is_prefix};

const V3: WireVersion = WireVersion::V3;

impl Request {
    /// Reads a message of 3.x; the order of the decisions is that of stock.
    pub fn parse(message: &Bottle) -> Result<Self, Malformed> {
        let [first, second, rest @ ..] = message.as_slice() else {
            return Err(Malformed::TooShort);
        };
        let first = first.as_vocab().unwrap_or_default();
        let after_first = &message.as_slice()[1..];
        let second = second.as_vocab().unwrap_or_default();
        // Item 1 decides before item 0 does.
        match (first, second) {
            (word::GET, word::PROTOCOL_VERSION) => Ok(Self::ProtocolVersion),
            (word::GET, interface) if is_prefix(interface) => {
                behind(interface, rest, question).map(Self::Get)
            }
            (word::SET, interface) if is_prefix(interface) => {
                behind(interface, rest, order).map(Self::Set)
            }
            (_, interface) if is_prefix(interface) => Err(Malformed::UnknownWord(first)),
            (word::GET, asked) => question(None, asked, None, rest).map(Self::Get),
            (word::SET, ordered) => order(None, ordered, None, rest).map(Self::Set),
            (word::HELP, word::MORE) => Ok(Self::Help),
            (first, _) => calibration(first, after_first),
        }
    }

    /// Returns the message for 3.x, or `None` if the protocol does not have it.
    pub fn to_bottle(&self) -> Option<Bottle> {
        Some(match self {
            Self::Help => Bottle::from_iter(["help".into(), "more".into()]),
            Self::ProtocolVersion => Bottle::of(word::GET).with(word::PROTOCOL_VERSION),
            Self::Interfaces => return None,
            Self::Get(get) => get.to_bottle()?,
            Self::Set(set) => set.to_bottle()?,
        })
    }
}

type Reader<T> = fn(Option<Vocab32>, Vocab32, Option<PidKind>, &[Value]) -> Result<T, Malformed>;

/// Takes off the word behind the interface, and behind that the kind of control loop.
fn behind<T>(interface: Vocab32, items: &[Value], read: Reader<T>) -> Result<T, Malformed> {
    let wrong = Malformed::Values(interface);
    let [first, rest @ ..] = items else {
        return Err(wrong);
    };
    let said = first.as_vocab().unwrap_or_default();
    if interface != word::PID_INTERFACE {
        return read(Some(interface), said, None, rest);
    }
    let [kind, rest @ ..] = rest else {
        return Err(wrong);
    };
    let kind = pid_messages::kind_of(kind.as_vocab().ok_or(wrong)?, V3);
    read(Some(interface), said, Some(kind), rest)
}

fn question(
    interface: Option<Vocab32>,
    asked: Vocab32,
    kind: Option<PidKind>,
    items: &[Value],
) -> Result<Get, Malformed> {
    let wrong = || Malformed::Values(asked);
    let of_kind = kind.unwrap_or(PidKind::Position);
    if interface == Some(word::REMOTE_VARIABLES_INTERFACE) && asked == word::VARIABLE {
        let name = items.first().and_then(Value::as_str).ok_or_else(wrong)?;
        return Ok(Get::Variable(name.to_owned()));
    }
    let (row, form) =
        Row::of_word(Place::Get(interface), asked).ok_or(Malformed::UnknownWord(asked))?;
    // Items after a query are harmless, and stock ignores them.
    let selection = Selection::read(form, &mut &*items).ok_or_else(wrong)?;
    match row {
        Row::Number(quantity) => Ok(Get::Values(quantity.of_kind(of_kind), selection)),
        Row::Query(query) => Ok(Get::About(query.of_kind(of_kind), selection)),
        _ => Err(Malformed::UnknownWord(asked)),
    }
}

fn order(
    interface: Option<Vocab32>,
    ordered: Vocab32,
    kind: Option<PidKind>,
    items: &[Value],
) -> Result<Set, Malformed> {
    let of_kind = kind.unwrap_or(PidKind::Position);
    let (row, form) =
        Row::of_word(Place::Set(interface), ordered).ok_or(Malformed::UnknownWord(ordered))?;
    let set = match row {
        Row::Setting(setting) => setting_of(setting.of_kind(of_kind), form, items),
        Row::Action(action) => {
            let action = action.of_kind(of_kind);
            acting(action, form, items).map(|selection| Set::Act(action, selection))
        }
        Row::Command(command) => {
            let mut arguments = Arguments::of_message(items, form, kind);
            Set::read(command, &mut arguments).and_then(|set| arguments.done(set))
        }
        Row::Number(_) | Row::Query(_) => None,
    };
    set.ok_or(Malformed::Values(ordered))
}

/// Nothing may be missing, left over, or of another kind.
fn setting_of(setting: Setting, form: Form, mut items: &[Value]) -> Option<Set> {
    let selection = Selection::read(form, &mut items)?;
    let listed = setting == Setting::ImpedanceOffset;
    let values = match (&selection, items) {
        (Selection::One(_), [value]) if listed => number_parsing::floats(value.as_list()?)?,
        (Selection::One(_), [value]) => vec![number_parsing::float(value)?],
        (Selection::Group(_) | Selection::All, [list]) => number_parsing::floats(list.as_list()?)?,
        _ => return None,
    };
    (!listed || values.len() == 1).then_some(Set::Values(setting, selection, values))
}

fn acting(action: Action, form: Form, mut items: &[Value]) -> Option<Selection> {
    match (action, form, items) {
        // A stop is not refused over a detail: with a wrong count, or words after it, it still is a stop.
        (Action::Stop, Form::Group, [_, list, ..]) => {
            let axes = list.as_list()?.iter().map(number_parsing::axis);
            axes.collect::<Option<_>>().map(Selection::Group)
        }
        (Action::Stop, ..) => Selection::read(form, &mut items),
        // Stock's client writes a joint behind words for the whole part, too.
        (_, Form::All, _) => Some(Selection::All),
        _ => Selection::read(form, &mut items).filter(|_| items.is_empty()),
    }
}

/// The words for calibration are in the first place.
fn calibration(first: Vocab32, items: &[Value]) -> Result<Request, Malformed> {
    let (row, form) = Row::of_word(Place::First, first).ok_or(Malformed::UnknownWord(first))?;
    match row {
        Row::Action(action) => Some(Request::Set(Set::Act(action, Selection::All))),
        Row::Query(query) => Selection::read(form, &mut &*items)
            .map(|selection| Request::Get(Get::About(query, selection))),
        Row::Command(command) => {
            let mut arguments = Arguments::of_message(items, form, None);
            Set::read(command, &mut arguments)
                .and_then(|set| arguments.done(set))
                .map(Request::Set)
        }
        Row::Number(_) | Row::Setting(_) => None,
    }
    .ok_or(Malformed::Values(first))
}

/// Returns the start of a message: request, interface, loop and joints.
fn say(
    what: Vocab32,
    spelling: &Spelling,
    kind: Option<PidKind>,
    selection: &Selection,
) -> Option<Bottle> {
    let mut message = start(what, spelling, selection)?;
    if let Some(kind) = kind {
        message.push(pid_messages::kind_word(kind, V3));
    }
    selection.write(&mut message);
    Some(message)
}

/// Returns the words in front of the arguments.
fn start(what: Vocab32, spelling: &Spelling, selection: &Selection) -> Option<Bottle> {
    let said = spelling.words.of(selection)?;
    if spelling.first {
        return Some(Bottle::of(said));
    }
    let mut message = Bottle::of(what);
    if let Some(interface) = spelling.interface {
        message.push(interface);
    }
    message.push(said);
    Some(message)
}

impl Get {
    fn to_bottle(&self) -> Option<Bottle> {
        match self {
            Self::Values(quantity, selection) => {
                say(word::GET, &quantity.spelling(), quantity.kind(), selection)
            }
            Self::About(question, selection) => {
                say(word::GET, &question.spelling(), question.kind(), selection)
            }
            Self::Variable(name) => Some(
                Bottle::of(word::GET)
                    .with(word::REMOTE_VARIABLES_INTERFACE)
                    .with(word::VARIABLE)
                    .with(name.as_str()),
            ),
        }
    }
}

impl Set {
    fn to_bottle(&self) -> Option<Bottle> {
        match self {
            Self::Values(setting, selection, values) => {
                let mut message = say(word::SET, &setting.spelling(), setting.kind(), selection)?;
                let items = values.iter().copied().map(Value::Float64);
                if *setting == Setting::ImpedanceOffset {
                    message.push(items.collect::<Bottle>());
                } else {
                    push(&mut message, selection.form(), items);
                }
                Some(message)
            }
            Self::Act(action, selection) => {
                let spelling = action.spelling();
                let mut message = say(word::SET, &spelling, action.kind(), selection)?;
                if spelling.first {
                    // Stock's own client sends the first word alone, which its server does not look at.
                    message.push(0);
                }
                Some(message)
            }
            command => {
                let selection = Selection::from(command.axes());
                let spelling = command.command()?.spelling();
                let mut message = start(word::SET, &spelling, &selection)?;
                command.write_v3(selection.form(), &mut message)?;
                Some(message)
            }
        }
    }
}

#[cfg(test)]
#[path = "board_vocab_requests_tests.rs"]
pub(super) mod tests;
