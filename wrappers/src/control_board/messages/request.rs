//! Questions and orders on `rpc:i`.
//!
//! ```text
//! [get] [word] SELECTION              [get] [icmd] [word] SELECTION
//! [set] [word] SELECTION VALUES       [set] [icmd] [word] SELECTION MODES
//! ```
//!
//! Words are compared as vocabs, and a string counts as the vocab of its first four characters, so that a person can
//! type them. Whatever is not wholly understood is refused, above all orders to move.

use yarp_devices::{AxisIndex, Limits, Mode};
use yarp_wire::{Bottle, Value, Vocab32};

use super::number;
use super::quantity::{DONE, MODE, QUANTITIES, Quantity, RESET, SETTINGS, STOP, Setting};
use super::selection::{Form, Selection, Words};
use super::vocabulary as word;

/// What a client wants of a control board.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Usage for people (`help more`).
    Help,
    /// `[get] [prot]`.
    ProtocolVersion,
    /// A question.
    Get(Get),
    /// An order.
    Set(Set),
}

/// A question.
#[derive(Clone, Debug, PartialEq)]
pub enum Get {
    /// Number of axes.
    Axes,
    /// Name of an axis.
    Name(AxisIndex),
    /// Kind of an axis.
    Type(AxisIndex),
    /// A number for each joint.
    Values(Quantity, Selection),
    /// Whether the joints are at rest.
    MotionDone(Selection),
    /// Position limits of an axis.
    PositionLimits(AxisIndex),
    /// Velocity limits of an axis.
    VelocityLimits(AxisIndex),
    /// Control modes.
    ControlModes(Selection),
}

/// An order. Values are degrees or metres, per second, per second squared.
#[derive(Clone, Debug, PartialEq)]
pub enum Set {
    /// A number for each joint.
    Values(Setting, Selection, Vec<f64>),
    /// Come to rest.
    Stop(Selection),
    /// Call the present positions 0.
    ResetEncoders(Selection),
    /// Position limits of an axis.
    PositionLimits(AxisIndex, Limits),
    /// Velocity limits of an axis.
    VelocityLimits(AxisIndex, Limits),
    /// Control modes.
    ControlModes(Selection, Vec<Mode>),
}

/// Why a message is no request.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Malformed {
    /// Fewer than two items: stock does not even look at it.
    #[error("expected two items or more")]
    TooShort,
    /// A word that is none of the protocol, or not in this place.
    #[error("unknown word [{0}]")]
    UnknownWord(Vocab32),
    /// An interface that is not served here.
    #[error("interface [{0}] is not served")]
    NotServed(Vocab32),
    /// Values are missing, too many, or of another kind.
    #[error("wrong number or kind of values for [{0}]")]
    Values(Vocab32),
}

impl Set {
    /// The words for stopping.
    pub const STOP: Words = STOP;
    /// The words for declaring positions 0.
    pub const RESET_ENCODERS: Words = RESET;
}

impl Request {
    /// Reads a message; the order of the decisions is that of stock.
    pub fn parse(message: &Bottle) -> Result<Self, Malformed> {
        let [first, second, rest @ ..] = message.as_slice() else {
            return Err(Malformed::TooShort);
        };
        let first = first.as_vocab().unwrap_or_default();
        let second = second.as_vocab().unwrap_or_default();
        // Item 1 decides before item 0 does.
        match (first, second) {
            (_, interface) if word::INTERFACES_NOT_SERVED.contains(&interface) => {
                Err(Malformed::NotServed(interface))
            }
            (word::GET, word::PROTOCOL_VERSION) => Ok(Self::ProtocolVersion),
            (word::GET, word::CONTROL_MODE_INTERFACE) => mode_question(rest).map(Self::Get),
            (word::SET, word::CONTROL_MODE_INTERFACE) => mode_order(rest).map(Self::Set),
            (word::GET, asked) => question(asked, rest).map(Self::Get),
            (word::SET, ordered) => order(ordered, rest).map(Self::Set),
            (word::HELP, word::MORE) => Ok(Self::Help),
            (unknown, _) => Err(Malformed::UnknownWord(unknown)),
        }
    }

    /// The message that says it, or `None` where the protocol has no word for this selection.
    pub fn to_bottle(&self) -> Option<Bottle> {
        Some(match self {
            Self::Help => Bottle::from_iter(["help".into(), "more".into()]),
            Self::ProtocolVersion => Bottle::of(word::GET).with(word::PROTOCOL_VERSION),
            Self::Get(get) => get.to_bottle()?,
            Self::Set(set) => set.to_bottle()?,
        })
    }
}

fn question(asked: Vocab32, items: &[Value]) -> Result<Get, Malformed> {
    let wrong = Malformed::Values(asked);
    // What comes after a question does no harm, and stock does not look at it.
    let selection = |form| Selection::read(form, &mut &*items).ok_or(wrong);
    if let Some((quantity, form)) = find(&QUANTITIES, Quantity::words, asked) {
        return Ok(Get::Values(quantity, selection(form)?));
    }
    if let Some(form) = DONE.form(asked) {
        return Ok(Get::MotionDone(selection(form)?));
    }
    let axis = || items.first().and_then(number::axis).ok_or(wrong);
    match asked {
        word::AXES => Ok(Get::Axes),
        word::NAME => axis().map(Get::Name),
        word::TYPE => axis().map(Get::Type),
        word::POSITION_LIMITS => axis().map(Get::PositionLimits),
        word::VELOCITY_LIMITS => axis().map(Get::VelocityLimits),
        unknown => Err(Malformed::UnknownWord(unknown)),
    }
}

fn order(ordered: Vocab32, items: &[Value]) -> Result<Set, Malformed> {
    let wrong = Malformed::Values(ordered);
    if let Some((setting, form)) = find(&SETTINGS, Setting::words, ordered) {
        let order = setting_of(setting, form, items);
        return order.ok_or(wrong);
    }
    if let Some(form) = STOP.form(ordered) {
        return stop(form, items).map(Set::Stop).ok_or(wrong);
    }
    if let Some(form) = RESET.form(ordered) {
        let mut rest = items;
        let selection = Selection::read(form, &mut rest).filter(|_| rest.is_empty());
        return selection.map(Set::ResetEncoders).ok_or(wrong);
    }
    match ordered {
        word::POSITION_LIMITS => {
            limits(items).map(|(axis, limits)| Set::PositionLimits(axis, limits))
        }
        word::VELOCITY_LIMITS => {
            limits(items).map(|(axis, limits)| Set::VelocityLimits(axis, limits))
        }
        unknown => return Err(Malformed::UnknownWord(unknown)),
    }
    .ok_or(wrong)
}

/// Nothing may be missing, left over, or of another kind.
fn setting_of(setting: Setting, form: Form, mut items: &[Value]) -> Option<Set> {
    let selection = Selection::read(form, &mut items)?;
    let values = match (&selection, items) {
        (Selection::One(_), [value]) => vec![number::float(value)?],
        (Selection::Group(_) | Selection::All, [list]) => number::floats(list.as_list()?)?,
        _ => return None,
    };
    Some(Set::Values(setting, selection, values))
}

/// A stop is not refused over a detail: with a wrong count, or words after it, it still is a stop.
fn stop(form: Form, mut items: &[Value]) -> Option<Selection> {
    match (form, items) {
        (Form::Group, [_, list, ..]) => {
            let axes = list.as_list()?.iter().map(number::axis);
            axes.collect::<Option<_>>().map(Selection::Group)
        }
        _ => Selection::read(form, &mut items),
    }
}

fn limits(items: &[Value]) -> Option<(AxisIndex, Limits)> {
    let [axis, min, max] = items else {
        return None;
    };
    let limits = Limits::new(number::float(min)?, number::float(max)?);
    Some((number::axis(axis)?, limits))
}

fn mode_question(items: &[Value]) -> Result<Get, Malformed> {
    let (word, form, mut rest) = mode_form(items)?;
    let selection = Selection::read(form, &mut rest).ok_or(Malformed::Values(word))?;
    Ok(Get::ControlModes(selection))
}

fn mode_order(items: &[Value]) -> Result<Set, Malformed> {
    let (word, form, mut rest) = mode_form(items)?;
    let wrong = Malformed::Values(word);
    let selection = Selection::read(form, &mut rest).ok_or(wrong)?;
    let mode = |value: &Value| value.as_vocab().map(|word| Mode::from(word.code()));
    let modes = match (&selection, rest) {
        (Selection::One(_), [value]) => mode(value).map(|mode| vec![mode]),
        (Selection::Group(_) | Selection::All, [list]) => list
            .as_list()
            .and_then(|list| list.iter().map(mode).collect()),
        _ => None,
    };
    Ok(Set::ControlModes(selection, modes.ok_or(wrong)?))
}

fn mode_form(items: &[Value]) -> Result<(Vocab32, Form, &[Value]), Malformed> {
    let [first, rest @ ..] = items else {
        return Err(Malformed::Values(word::CONTROL_MODE_INTERFACE));
    };
    // Stock tries items 3 and 4 as joint and mode when it does not know this word; a mode is not set on a guess.
    let asked = first.as_vocab().unwrap_or_default();
    let form = MODE.form(asked).ok_or(Malformed::UnknownWord(asked))?;
    Ok((asked, form, rest))
}

fn find<T: Copy>(all: &[T], words: impl Fn(T) -> Words, word: Vocab32) -> Option<(T, Form)> {
    all.iter()
        .find_map(|&one| words(one).form(word).map(|form| (one, form)))
}

impl Get {
    fn to_bottle(&self) -> Option<Bottle> {
        let ask = |word: Vocab32| Bottle::of(word::GET).with(word);
        let ask_axis =
            |word: Vocab32, axis: &AxisIndex| ask(word).with(number::integer(axis.index()));
        let ask_selection = |words: Words, selection: &Selection| {
            let mut message = ask(words.word(selection)?);
            selection.write(&mut message);
            Some(message)
        };
        Some(match self {
            Self::Axes => ask(word::AXES),
            Self::Name(axis) => ask_axis(word::NAME, axis),
            Self::Type(axis) => ask_axis(word::TYPE, axis),
            Self::PositionLimits(axis) => ask_axis(word::POSITION_LIMITS, axis),
            Self::VelocityLimits(axis) => ask_axis(word::VELOCITY_LIMITS, axis),
            Self::Values(quantity, selection) => ask_selection(quantity.words(), selection)?,
            Self::MotionDone(selection) => ask_selection(DONE, selection)?,
            Self::ControlModes(selection) => {
                let mut message = ask(word::CONTROL_MODE_INTERFACE).with(MODE.word(selection)?);
                selection.write(&mut message);
                message
            }
        })
    }
}

impl Set {
    fn to_bottle(&self) -> Option<Bottle> {
        let order = |words: Words, selection: &Selection| {
            let mut message = Bottle::of(word::SET).with(words.word(selection)?);
            selection.write(&mut message);
            Some(message)
        };
        let limit = |word: Vocab32, axis: &AxisIndex, limits: &Limits| {
            Bottle::of(word::SET)
                .with(word)
                .with(number::integer(axis.index()))
                .with(limits.min)
                .with(limits.max)
        };
        Some(match self {
            Self::Values(setting, selection, values) => {
                let mut message = order(setting.words(), selection)?;
                let items = values.iter().copied().map(Value::Float64);
                push(&mut message, selection, items);
                message
            }
            Self::Stop(selection) => order(STOP, selection)?,
            Self::ResetEncoders(selection) => order(RESET, selection)?,
            Self::PositionLimits(axis, limits) => limit(word::POSITION_LIMITS, axis, limits),
            Self::VelocityLimits(axis, limits) => limit(word::VELOCITY_LIMITS, axis, limits),
            Self::ControlModes(selection, modes) => {
                let mut message = Bottle::of(word::SET)
                    .with(word::CONTROL_MODE_INTERFACE)
                    .with(MODE.word(selection)?);
                selection.write(&mut message);
                let words = modes.iter().map(|&mode| Vocab32::from_code(mode.into()));
                push(&mut message, selection, words.map(Value::from));
                message
            }
        })
    }
}

/// Appends one value as it is, several as a list.
fn push(message: &mut Bottle, selection: &Selection, values: impl Iterator<Item = Value>) {
    match selection {
        Selection::One(_) => message.extend(values),
        Selection::Group(_) | Selection::All => message.push(values.collect::<Bottle>()),
    }
}

#[cfg(test)]
#[path = "request_tests.rs"]
mod tests;
