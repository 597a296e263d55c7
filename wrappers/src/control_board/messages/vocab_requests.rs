//! Requests of YARP 3.5 to 3.12, on `rpc:i`.
//!
//! ```text
//! [get] [word] SELECTION              [get] [interface] [word] SELECTION
//! [set] [word] SELECTION VALUES       [set] [interface] [word] SELECTION VALUES
//! ```
//!
//! Words are compared as vocabs, and a string counts as the vocab of its first four characters, so that a person can
//! type them. A message that is not parsed completely is refused, above all commands to move.

use yarp_devices::{
    AxisIndex, CalibrationParameters, Impedance, Interaction, Limits, Mode, PidKind,
};
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

use super::axis_selection::{Form, Selection, Words};
use super::number_parsing;
use super::pid_messages;
use super::quantity::{Quantity, Setting, Spelling};
use super::request::{Action, Get, INTERACTIONS, MODES, Malformed, Query, Range, Request, Set};
use super::variable_value;
use super::vocabulary as word;

const V3: WireVersion = WireVersion::V3;

/// The words that, as item 1, make the rest words of an interface.
const INTERFACES: [Vocab32; 10] = [
    word::PID_INTERFACE,
    word::TORQUE_INTERFACE,
    word::FAULT_INTERFACE,
    word::CONTROL_MODE_INTERFACE,
    word::IMPEDANCE_INTERFACE,
    word::INTERACTION_MODE_INTERFACE,
    word::REMOTE_CALIBRATOR_INTERFACE,
    word::REMOTE_VARIABLES_INTERFACE,
    word::CURRENT_INTERFACE,
    word::PWM_INTERFACE,
];

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
            (word::GET, interface) if INTERFACES.contains(&interface) => {
                behind(interface, rest, question).map(Self::Get)
            }
            (word::SET, interface) if INTERFACES.contains(&interface) => {
                behind(interface, rest, order).map(Self::Set)
            }
            (_, interface) if INTERFACES.contains(&interface) => Err(Malformed::UnknownWord(first)),
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

/// Finds the request of a word behind an interface, or without one.
fn find<T: Copy>(
    all: impl IntoIterator<Item = T>,
    spelling: impl Fn(T) -> Spelling,
    interface: Option<Vocab32>,
    said: Vocab32,
) -> Option<(T, Form)> {
    all.into_iter().find_map(|one| {
        let spelling = spelling(one);
        let form = spelling.words.form(said)?;
        (spelling.interface == interface).then_some((one, form))
    })
}

fn question(
    interface: Option<Vocab32>,
    asked: Vocab32,
    kind: Option<PidKind>,
    items: &[Value],
) -> Result<Get, Malformed> {
    let wrong = || Malformed::Values(asked);
    let of_kind = kind.unwrap_or(PidKind::Position);
    // Items after a query are harmless, and stock ignores them.
    let selection = |form| Selection::read(form, &mut &*items).ok_or_else(wrong);
    if interface == Some(word::REMOTE_VARIABLES_INTERFACE) && asked == word::VARIABLE {
        let name = items.first().and_then(Value::as_str).ok_or_else(wrong)?;
        return Ok(Get::Variable(name.to_owned()));
    }
    if let Some((quantity, form)) = find(Quantity::all(), Quantity::spelling, interface, asked) {
        return Ok(Get::Values(quantity.of_kind(of_kind), selection(form)?));
    }
    match find(Query::ALL, Query::spelling, interface, asked) {
        Some((about, form)) => Ok(Get::About(about.of_kind(of_kind), selection(form)?)),
        None => Err(Malformed::UnknownWord(asked)),
    }
}

fn order(
    interface: Option<Vocab32>,
    ordered: Vocab32,
    kind: Option<PidKind>,
    items: &[Value],
) -> Result<Set, Malformed> {
    let wrong = Malformed::Values(ordered);
    let of_kind = kind.unwrap_or(PidKind::Position);
    if let Some((setting, form)) = find(Setting::all(), Setting::spelling, interface, ordered) {
        return setting_of(setting.of_kind(of_kind), form, items).ok_or(wrong);
    }
    if let Some((action, form)) = find(Action::ALL, Action::spelling, interface, ordered) {
        let action = action.of_kind(of_kind);
        return acting(action, form, items)
            .map(|selection| Set::Act(action, selection))
            .ok_or(wrong);
    }
    match (interface, ordered) {
        (None, word::POSITION_LIMITS) => limits(Range::Position, items),
        (None, word::VELOCITY_LIMITS) => limits(Range::Velocity, items),
        (Some(word::CONTROL_MODE_INTERFACE), said) => {
            let form = MODES.form(said).ok_or(Malformed::UnknownWord(said))?;
            coded(form, items).map(|(selection, codes)| {
                Set::ControlModes(selection, codes.into_iter().map(Mode::from).collect())
            })
        }
        (Some(word::INTERACTION_MODE_INTERFACE), said) => {
            let form = INTERACTIONS
                .form(said)
                .ok_or(Malformed::UnknownWord(said))?;
            coded(form, items).map(|(selection, codes)| {
                let interactions = codes.into_iter().map(Interaction::from).collect();
                Set::Interactions(selection, interactions)
            })
        }
        (Some(word::IMPEDANCE_INTERFACE), word::IMPEDANCE) => impedance(items),
        (Some(word::TORQUE_INTERFACE), word::MOTOR_PARAMETERS) => motor_parameters(items),
        (Some(word::PID_INTERFACE), word::PID) => gains(of_kind, Form::One, items),
        (Some(word::PID_INTERFACE), word::PIDS) => gains(of_kind, Form::All, items),
        (Some(word::REMOTE_VARIABLES_INTERFACE), word::VARIABLE) => set_variable(items),
        (_, unknown) => return Err(Malformed::UnknownWord(unknown)),
    }
    .ok_or(wrong)
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

fn limits(range: Range, items: &[Value]) -> Option<Set> {
    let [axis, min, max] = items else {
        return None;
    };
    let limits = Limits::new(number_parsing::float(min)?, number_parsing::float(max)?);
    Some(Set::Limits(range, number_parsing::axis(axis)?, limits))
}

/// One word for each joint.
fn coded(form: Form, mut items: &[Value]) -> Option<(Selection, Vec<u32>)> {
    let selection = Selection::read(form, &mut items)?;
    let code = |value: &Value| value.as_vocab().map(Vocab32::code);
    let codes = match (&selection, items) {
        (Selection::One(_), [value]) => vec![code(value)?],
        (Selection::Group(_) | Selection::All, [list]) => {
            list.as_list()?.iter().map(code).collect::<Option<_>>()?
        }
        _ => return None,
    };
    Some((selection, codes))
}

fn impedance(items: &[Value]) -> Option<Set> {
    let [axis, list] = items else {
        return None;
    };
    let [stiffness, damping] = number_parsing::floats(list.as_list()?)?[..] else {
        return None;
    };
    let impedance = Impedance { stiffness, damping };
    Some(Set::Impedance(number_parsing::axis(axis)?, impedance))
}

fn motor_parameters(items: &[Value]) -> Option<Set> {
    let [axis, list] = items else {
        return None;
    };
    let numbers = number_parsing::floats(list.as_list()?)?;
    let parameters = number_parsing::motor_parameters(&numbers)?;
    let axis = number_parsing::axis(axis)?;
    Some(Set::MotorParameters(axis, parameters, numbers.len()))
}

fn gains(kind: PidKind, form: Form, mut items: &[Value]) -> Option<Set> {
    let selection = Selection::read(form, &mut items)?;
    let [list] = items else {
        return None;
    };
    let pids = match selection {
        Selection::One(_) => vec![pid_messages::read_gains(list.as_list()?, V3)?],
        _ => pid_messages::read_all_gains(list.as_list()?, V3)?,
    };
    Some(Set::Pids(kind, selection, pids))
}

fn set_variable(items: &[Value]) -> Option<Set> {
    let [name, values @ ..] = items else {
        return None;
    };
    Some(Set::Variable(
        name.as_str()?.to_owned(),
        variable_value::read(values)?,
    ))
}

/// The words for calibration are in the first place.
fn calibration(first: Vocab32, items: &[Value]) -> Result<Request, Malformed> {
    let act = |action| Some(Request::Set(Set::Act(action, Selection::All)));
    match first {
        word::CALIBRATE => act(Action::CalibrateRobot),
        word::PARK_ROBOT => act(Action::ParkRobot),
        word::ABORT_CALIBRATION => act(Action::AbortCalibration),
        word::ABORT_PARK => act(Action::AbortPark),
        word::CALIBRATION_DONE => items
            .first()
            .and_then(number_parsing::axis)
            .map(|axis| Request::Get(Get::About(Query::CalibrationDone, Selection::One(axis)))),
        word::CALIBRATE_JOINT => calibrate_axis(items).map(Request::Set),
        word::CALIBRATION_PARAMETERS => calibration_parameters(items).map(Request::Set),
        unknown => return Err(Malformed::UnknownWord(unknown)),
    }
    .ok_or(Malformed::Values(first))
}

fn calibrate_axis(items: &[Value]) -> Option<Set> {
    let [axis, method, numbers @ ..] = items else {
        return None;
    };
    let numbers: Option<Vec<f64>> = numbers.iter().map(number_parsing::float).collect();
    let numbers = numbers?.try_into().ok()?;
    let method = u32::try_from(number_parsing::count(method)?).ok()?;
    Some(Set::CalibrateAxis(
        number_parsing::axis(axis)?,
        method,
        numbers,
    ))
}

/// 3.x has four parameters.
fn calibration_parameters(items: &[Value]) -> Option<Set> {
    let [axis, method, numbers @ ..] = items else {
        return None;
    };
    let numbers: Option<Vec<f64>> = numbers.iter().map(number_parsing::float).collect();
    let [first, second, third, fourth] = numbers?[..] else {
        return None;
    };
    let parameters = CalibrationParameters {
        method: u32::try_from(number_parsing::count(method)?).ok()?,
        parameters: [first, second, third, fourth, 0.0],
        zero: 0.0,
    };
    Some(Set::CalibrationParameters(
        number_parsing::axis(axis)?,
        parameters,
    ))
}

/// Returns the start of a message: request, interface, loop and joints.
fn say(
    what: Vocab32,
    spelling: &Spelling,
    kind: Option<PidKind>,
    selection: &Selection,
) -> Option<Bottle> {
    start(what, spelling.interface, spelling.words, kind, selection)
}

fn start(
    what: Vocab32,
    interface: Option<Vocab32>,
    words: Words,
    kind: Option<PidKind>,
    selection: &Selection,
) -> Option<Bottle> {
    let mut message = Bottle::of(what);
    if let Some(interface) = interface {
        message.push(interface);
    }
    message.push(words.of(selection)?);
    if let Some(kind) = kind {
        message.push(pid_messages::kind_word(kind, V3));
    }
    selection.write(&mut message);
    Some(message)
}

impl Get {
    fn to_bottle(&self) -> Option<Bottle> {
        match self {
            Self::Values(quantity, selection) => {
                say(word::GET, &quantity.spelling(), quantity.kind(), selection)
            }
            Self::About(Query::CalibrationDone, Selection::One(axis)) => {
                Some(Bottle::of(word::CALIBRATION_DONE).with(number_parsing::integer(axis.index())))
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
        let about = |interface: Vocab32, said: Vocab32, axis: &AxisIndex| {
            let message = Bottle::of(word::SET).with(interface).with(said);
            message.with(number_parsing::integer(axis.index()))
        };
        Some(match self {
            Self::Values(setting, selection, values) => {
                let mut message = say(word::SET, &setting.spelling(), setting.kind(), selection)?;
                let items = values.iter().copied().map(Value::Float64);
                if *setting == Setting::ImpedanceOffset {
                    message.push(items.collect::<Bottle>());
                } else {
                    push(&mut message, selection, items);
                }
                message
            }
            Self::Act(action, selection) => match (action, selection) {
                // Stock's own client sends the first word alone, which its server does not look at.
                (Action::CalibrateRobot, Selection::All) => Bottle::of(word::CALIBRATE).with(0),
                (Action::ParkRobot, Selection::All) => Bottle::of(word::PARK_ROBOT).with(0),
                (Action::AbortCalibration, Selection::All) => {
                    Bottle::of(word::ABORT_CALIBRATION).with(0)
                }
                (Action::AbortPark, Selection::All) => Bottle::of(word::ABORT_PARK).with(0),
                _ => say(word::SET, &action.spelling(), action.kind(), selection)?,
            },
            Self::Limits(range, axis, limits) => {
                let said = match range {
                    Range::Position => word::POSITION_LIMITS,
                    Range::Velocity => word::VELOCITY_LIMITS,
                    Range::Torque | Range::Current => return None,
                };
                Bottle::of(word::SET)
                    .with(said)
                    .with(number_parsing::integer(axis.index()))
                    .with(limits.min)
                    .with(limits.max)
            }
            Self::ControlModes(selection, modes) => {
                let codes = modes.iter().map(|&mode| mode.into());
                words_for(word::CONTROL_MODE_INTERFACE, MODES, selection, codes)?
            }
            Self::Interactions(selection, interactions) => {
                let codes = interactions.iter().map(|&interaction| interaction.into());
                let interface = word::INTERACTION_MODE_INTERFACE;
                words_for(interface, INTERACTIONS, selection, codes)?
            }
            Self::Pids(kind, selection, pids) => {
                let spelling = Query::Pids(*kind).spelling();
                let mut message = say(word::SET, &spelling, Some(*kind), selection)?;
                let lists = pids.iter().map(|pid| {
                    let gains = pid_messages::gains(pid, V3).map(Value::Float64);
                    Value::List(gains.into_iter().collect())
                });
                push(&mut message, selection, lists);
                message
            }
            Self::Impedance(axis, impedance) => {
                let list = [impedance.stiffness, impedance.damping].map(Value::Float64);
                about(word::IMPEDANCE_INTERFACE, word::IMPEDANCE, axis)
                    .with(Bottle::from_iter(list))
            }
            Self::MotorParameters(axis, parameters, count) => {
                let numbers = parameters.to_array().into_iter().take(*count);
                about(word::TORQUE_INTERFACE, word::MOTOR_PARAMETERS, axis)
                    .with(numbers.map(Value::Float64).collect::<Bottle>())
            }
            Self::CalibrateAxis(axis, method, parameters) => {
                calibrating(word::CALIBRATE_JOINT, *axis, *method, parameters)
            }
            Self::CalibrationParameters(axis, calibration) => {
                let [four @ .., fifth] = calibration.parameters;
                if fifth != 0.0 || calibration.zero != 0.0 {
                    return None;
                }
                calibrating(
                    word::CALIBRATION_PARAMETERS,
                    *axis,
                    calibration.method,
                    &four,
                )
            }
            Self::Variable(name, values) => {
                let mut message = Bottle::of(word::SET)
                    .with(word::REMOTE_VARIABLES_INTERFACE)
                    .with(word::VARIABLE)
                    .with(name.as_str());
                message.extend(variable_value::to_values(values));
                message
            }
            Self::ManualBrake(..) | Self::AutoBrake(..) => return None,
        })
    }
}

fn words_for(
    interface: Vocab32,
    words: Words,
    selection: &Selection,
    codes: impl Iterator<Item = u32>,
) -> Option<Bottle> {
    let mut message = start(word::SET, Some(interface), words, None, selection)?;
    let words = codes.map(|code| Value::from(Vocab32::from_code(code)));
    push(&mut message, selection, words);
    Some(message)
}

fn calibrating(said: Vocab32, axis: AxisIndex, method: u32, numbers: &[f64]) -> Bottle {
    let mut message = Bottle::of(said).with(number_parsing::integer(axis.index()));
    message.push(number_parsing::integer(method as usize));
    message.extend(numbers.iter().copied().map(Value::Float64));
    message
}

/// Appends one value by itself, several as a list.
fn push(message: &mut Bottle, selection: &Selection, values: impl Iterator<Item = Value>) {
    match selection {
        Selection::One(_) => message.extend(values),
        Selection::Group(_) | Selection::All => message.push(values.collect::<Bottle>()),
    }
}

#[cfg(test)]
#[path = "vocab_requests_tests.rs"]
pub(super) mod tests;
