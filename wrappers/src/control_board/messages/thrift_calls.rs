//! Requests of YARP 4.0, on `nws/rpc:i`.
//!
//! ```text
//! "FUNCTIONRPC"  [kind of loop]  SELECTION  VALUES        SELECTION = j | (j..) | nothing
//! ```
//!
//! The name determines the selection that follows. Joints are int16 for limits and control loops, int32 for all else.
//! Arguments that are missing, too many or of another kind make a call malformed, as with stock.
//!
//! Source: `ControlBoardMsgs.thrift` of YARP 4.0; recorded traffic of 4.0.0.

use yarp_devices::{
    AxisIndex, CalibrationParameters, Impedance, Interaction, Limits, Mode, MotorTorqueParameters,
    PidKind,
};
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

use super::axis_selection::{Form, Forms, Functions, Selection};
use super::number_parsing;
use super::pid_messages;
use super::quantity::{Quantity, Setting, Spelling};
use super::request::{Action, Get, Malformed, Query, Range, Request, Set};
use super::variable_value;
use crate::thrift::{GET_VERSION, Item, Message};

const V4: WireVersion = WireVersion::V4;
/// The names of all functions, as a stock 4.0.0 board lists them.
pub(crate) const FUNCTIONS: &str = include_str!("functions_4.0.txt");
/// Suffix of every function of a control board.
const SUFFIX: &str = "RPC";
/// Stock skips this word in front of a call.
const DIRECT: &str = "__direct__";
const HELP: &str = "help";

const INTERFACES: &str = "getDeviceInterfaces";
const GET_VARIABLE: &str = "getRemoteVariable";
const SET_VARIABLE: &str = "setRemoteVariable";
const POSITION_LIMITS: &str = "setPosLimits";
const VELOCITY_LIMITS: &str = "setVelLimits";
const PIDS: Functions = Forms::two("setPid", "setPids");
const MODES: Functions = Forms::three(
    "setControlModeOne",
    "setControlModeGroup",
    "setControlModeAll",
);
const INTERACTIONS: Functions = Forms::three(
    "setInteractionModeOne",
    "setInteractionModesGroup",
    "setInteractionModesAll",
);
const IMPEDANCE: &str = "setImpedance";
const MOTOR_PARAMETERS: &str = "setMotorTorqueParams";
const CALIBRATE_AXIS: &str = "calibrateAxisWithParams";
const CALIBRATION_PARAMETERS: &str = "setCalibrationParameters";
const MANUAL_BRAKE: &str = "setManualBrakeActive";
const AUTO_BRAKE: &str = "setAutoBrakeEnabled";

impl Request {
    /// Reads a call of 4.0.
    pub fn parse_call(message: &Bottle) -> Result<Self, Malformed> {
        let mut items = message.as_slice();
        if items.first().and_then(Value::as_str) == Some(DIRECT) {
            items = &items[1..];
        }
        let [name, arguments @ ..] = items else {
            return Err(Malformed::UnknownFunction(String::new()));
        };
        // A tag of up to four letters may come as a vocab.
        let said = name.to_plain_string();
        if said == HELP {
            return Ok(Self::Help);
        }
        let arguments = Arguments(arguments);
        let known = if said == GET_VERSION {
            Some(arguments.done(Self::ProtocolVersion))
        } else {
            said.strip_suffix(SUFFIX)
                .and_then(|name| function(name, arguments))
        };
        match known {
            Some(Some(request)) => Ok(request),
            Some(None) => Err(Malformed::Arguments(said)),
            None => Err(Malformed::UnknownFunction(said)),
        }
    }

    /// Returns the call for 4.0, or `None` if there is no function for it.
    pub fn to_call(&self) -> Option<Message> {
        let (name, arguments) = match self {
            Self::Help => return Some(Message::call(HELP, [])),
            Self::ProtocolVersion => return Some(Message::call(GET_VERSION, [])),
            Self::Interfaces => (INTERFACES, Vec::new()),
            Self::Get(get) => get.to_call()?,
            Self::Set(set) => set.to_call()?,
        };
        Some(Message::call(&format!("{name}{SUFFIX}"), arguments))
    }
}

/// The arguments that have not been read yet.
struct Arguments<'a>(&'a [Value]);

impl<'a> Arguments<'a> {
    fn next(&mut self) -> Option<&'a Value> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(first)
    }

    fn axis(&mut self) -> Option<AxisIndex> {
        number_parsing::axis(self.next()?)
    }

    fn float(&mut self) -> Option<f64> {
        number_parsing::float(self.next()?)
    }

    fn floats<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut all = [0.0; N];
        for number in &mut all {
            *number = self.float()?;
        }
        Some(all)
    }

    fn code(&mut self) -> Option<u32> {
        self.next()?.as_vocab().map(Vocab32::code)
    }

    /// Stock takes an integer or a vocab for a truth value.
    fn flag(&mut self) -> Option<bool> {
        let word = self.next()?.as_vocab()?;
        Some(word != Vocab32::FAIL && word.code() != 0)
    }

    fn text(&mut self) -> Option<String> {
        self.next()?.as_str().map(str::to_owned)
    }

    fn list(&mut self) -> Option<&'a Bottle> {
        self.next()?.as_list()
    }

    fn selection(&mut self, form: Form) -> Option<Selection> {
        Some(match form {
            Form::One => Selection::One(self.axis()?),
            Form::Group => {
                let axes = self.list()?.iter().map(number_parsing::axis);
                Selection::Group(axes.collect::<Option<_>>()?)
            }
            Form::All => Selection::All,
        })
    }

    fn values(&mut self, selection: &Selection) -> Option<Vec<f64>> {
        match selection {
            Selection::One(_) => Some(vec![self.float()?]),
            _ => number_parsing::floats(self.list()?),
        }
    }

    fn codes(&mut self, selection: &Selection) -> Option<Vec<u32>> {
        match selection {
            Selection::One(_) => Some(vec![self.code()?]),
            _ => {
                let words = self.list()?.iter().map(Value::as_vocab);
                words.map(|word| word.map(Vocab32::code)).collect()
            }
        }
    }

    /// The kind of control loop, where there is one.
    fn kind(&mut self, about_loops: bool) -> Option<PidKind> {
        if !about_loops {
            return Some(PidKind::Position);
        }
        Some(pid_messages::kind_of(Vocab32::from_code(self.code()?), V4))
    }

    /// Returns the parsed value, if nothing is left.
    fn done<T>(&self, read: T) -> Option<T> {
        self.0.is_empty().then_some(read)
    }
}

/// Parses a function; `None` for an unknown one, `Some(None)` for arguments that it does not have.
fn function(name: &str, arguments: Arguments<'_>) -> Option<Option<Request>> {
    if let Some((quantity, form)) = find(Quantity::all(), Quantity::spelling, name) {
        let read = |mut rest: Arguments<'_>| {
            let kind = rest.kind(quantity.kind().is_some())?;
            let selection = rest.selection(form)?;
            rest.done(Get::Values(quantity.of_kind(kind), selection))
        };
        return Some(read(arguments).map(Request::Get));
    }
    if let Some((question, form)) = find(Query::ALL, Query::spelling, name) {
        let read = |mut rest: Arguments<'_>| {
            let kind = rest.kind(question.kind().is_some())?;
            let selection = rest.selection(form)?;
            rest.done(Get::About(question.of_kind(kind), selection))
        };
        return Some(read(arguments).map(Request::Get));
    }
    if let Some((setting, form)) = find(Setting::all(), Setting::spelling, name) {
        let read = |mut rest: Arguments<'_>| {
            let kind = rest.kind(setting.kind().is_some())?;
            let selection = rest.selection(form)?;
            let values = rest.values(&selection)?;
            rest.done(Set::Values(setting.of_kind(kind), selection, values))
        };
        return Some(read(arguments).map(Request::Set));
    }
    if let Some((action, form)) = find(Action::ALL, Action::spelling, name) {
        let read = |mut rest: Arguments<'_>| {
            let kind = rest.kind(action.kind().is_some())?;
            let selection = rest.selection(form)?;
            if waits(action, &selection) {
                rest.flag()?;
            }
            rest.done(Set::Act(action.of_kind(kind), selection))
        };
        return Some(read(arguments).map(Request::Set));
    }
    lone(name, arguments)
}

/// Calls that take whether to wait for the end. Never used here: a call that blocks delays its client.
fn waits(action: Action, selection: &Selection) -> bool {
    match action {
        Action::Park => matches!(selection, Selection::One(_)),
        Action::ParkRobot => true,
        _ => false,
    }
}

/// The functions without variants.
fn lone(name: &str, mut rest: Arguments<'_>) -> Option<Option<Request>> {
    let read: fn(&mut Arguments<'_>) -> Option<Set> = match name {
        INTERFACES => return Some(rest.done(Request::Interfaces)),
        GET_VARIABLE => {
            let mut read = || {
                let name = rest.text()?;
                rest.done(Request::Get(Get::Variable(name)))
            };
            return Some(read());
        }
        SET_VARIABLE => |rest| {
            let name = rest.text()?;
            let values = variable_value::read(rest.list()?.as_slice())?;
            Some(Set::Variable(name, values))
        },
        POSITION_LIMITS => |rest| limits(Range::Position, rest),
        VELOCITY_LIMITS => |rest| limits(Range::Velocity, rest),
        IMPEDANCE => |rest| {
            let axis = rest.axis()?;
            let [stiffness, damping] = rest.floats()?;
            Some(Set::Impedance(axis, Impedance { stiffness, damping }))
        },
        MOTOR_PARAMETERS => |rest| {
            let axis = rest.axis()?;
            let parameters = MotorTorqueParameters::from_array(rest.floats()?);
            Some(Set::MotorParameters(axis, parameters, 9))
        },
        CALIBRATE_AXIS => |rest| {
            let (axis, method) = (rest.axis()?, rest.code()?);
            Some(Set::CalibrateAxis(axis, method, rest.floats()?))
        },
        CALIBRATION_PARAMETERS => |rest| {
            let axis = rest.axis()?;
            let parameters = CalibrationParameters {
                method: rest.code()?,
                parameters: rest.floats()?,
                zero: rest.float()?,
            };
            Some(Set::CalibrationParameters(axis, parameters))
        },
        MANUAL_BRAKE => |rest| Some(Set::ManualBrake(rest.axis()?, rest.flag()?)),
        AUTO_BRAKE => |rest| Some(Set::AutoBrake(rest.axis()?, rest.flag()?)),
        name => return grouped(name, rest),
    };
    Some(read(&mut rest).and_then(|set| rest.done(Request::Set(set))))
}

/// The functions with a form for one joint, several, all, and values that are not plain numbers.
fn grouped(name: &str, mut rest: Arguments<'_>) -> Option<Option<Request>> {
    let set = if let Some(form) = MODES.form(name) {
        modes(form, &mut rest)
    } else if let Some(form) = INTERACTIONS.form(name) {
        interactions(form, &mut rest)
    } else {
        let form = PIDS.form(name)?;
        gains(form, &mut rest)
    };
    Some(set.and_then(|set| rest.done(Request::Set(set))))
}

fn modes(form: Form, rest: &mut Arguments<'_>) -> Option<Set> {
    let selection = rest.selection(form)?;
    let modes = rest.codes(&selection)?.into_iter().map(Mode::from);
    Some(Set::ControlModes(selection, modes.collect()))
}

fn interactions(form: Form, rest: &mut Arguments<'_>) -> Option<Set> {
    let selection = rest.selection(form)?;
    let interactions = rest.codes(&selection)?.into_iter().map(Interaction::from);
    Some(Set::Interactions(selection, interactions.collect()))
}

fn gains(form: Form, rest: &mut Arguments<'_>) -> Option<Set> {
    let kind = rest.kind(true)?;
    let selection = rest.selection(form)?;
    let pids = match selection {
        Selection::One(_) => vec![pid_messages::read_gains(rest.list()?, V4)?],
        _ => pid_messages::read_all_gains(rest.list()?, V4)?,
    };
    Some(Set::Pids(kind, selection, pids))
}

fn limits(range: Range, rest: &mut Arguments<'_>) -> Option<Set> {
    let axis = rest.axis()?;
    let [min, max] = rest.floats()?;
    Some(Set::Limits(range, axis, Limits::new(min, max)))
}

fn find<T: Copy>(
    all: impl IntoIterator<Item = T>,
    spelling: impl Fn(T) -> Spelling,
    name: &str,
) -> Option<(T, Form)> {
    all.into_iter().find_map(|one| {
        let functions = spelling(one).functions;
        let named = [
            (functions.one, Form::One),
            (functions.group, Form::Group),
            (functions.all, Form::All),
        ];
        let (_, form) = named.into_iter().find(|(ours, _)| *ours == Some(name))?;
        Some((one, form))
    })
}

/// Returns whether joints are int16 in a call.
fn is_short(question: Query) -> bool {
    use Query as Q;
    matches!(
        question,
        Q::Range(Range::Position | Range::Velocity)
            | Q::AvailableModes
            | Q::AvailablePids
            | Q::Pids(_)
            | Q::PidEnabled(_)
            | Q::PidInfo(_)
    )
}

fn integer(axis: AxisIndex) -> i32 {
    // No device has more axes than this; a larger number names none of them either way.
    i32::try_from(axis.index()).unwrap_or(i32::MAX)
}

fn joint(axis: AxisIndex, short: bool) -> Item {
    let axis = integer(axis);
    match i16::try_from(axis) {
        Ok(axis) if short => Item::I16(axis),
        // Stock reads an int32 there as well.
        _ => Item::I32(axis),
    }
}

/// The kind of loop and the joints, as arguments.
fn arguments(kind: Option<PidKind>, selection: &Selection, short: bool) -> Vec<Item> {
    let mut items = Vec::new();
    if let Some(kind) = kind {
        items.push(Item::Enum(pid_messages::kind_word(kind, V4).code()));
    }
    match selection {
        Selection::One(axis) => items.push(joint(*axis, short)),
        Selection::Group(group) => {
            items.push(Item::I32s(group.iter().copied().map(integer).collect()));
        }
        Selection::All => {}
    }
    items
}

type Call = (&'static str, Vec<Item>);

impl Get {
    fn to_call(&self) -> Option<Call> {
        match self {
            Self::Values(quantity, selection) => {
                let name = quantity.spelling().functions.of(selection)?;
                let kind = quantity.kind();
                Some((name, arguments(kind, selection, kind.is_some())))
            }
            Self::About(question, selection) => {
                let name = question.spelling().functions.of(selection)?;
                let short = is_short(*question);
                Some((name, arguments(question.kind(), selection, short)))
            }
            Self::Variable(name) => Some((GET_VARIABLE, vec![Item::Text(name.clone())])),
        }
    }
}

impl Set {
    fn to_call(&self) -> Option<Call> {
        let one = |axis: &AxisIndex| vec![joint(*axis, false)];
        let numbers = |values: &[f64]| values.iter().copied().map(Item::F64).collect::<Vec<_>>();
        Some(match self {
            Self::Values(setting, selection, values) => {
                let name = setting.spelling().functions.of(selection)?;
                let kind = setting.kind();
                let mut items = arguments(kind, selection, kind.is_some());
                items.push(match (selection, setting, &values[..]) {
                    // A whole number of degrees.
                    (Selection::One(_), Setting::Encoder, [value]) => {
                        let whole = *value as i32;
                        if f64::from(whole) != *value {
                            return None;
                        }
                        Item::I32(whole)
                    }
                    (Selection::One(_), _, [value]) => Item::F64(*value),
                    _ => Item::F64s(values.clone()),
                });
                (name, items)
            }
            Self::Act(action, selection) => {
                let name = action.spelling().functions.of(selection)?;
                let kind = action.kind();
                let mut items = arguments(kind, selection, kind.is_some());
                if waits(*action, selection) {
                    items.push(Item::Bool(false));
                }
                (name, items)
            }
            Self::Limits(range, axis, limits) => {
                let name = match range {
                    Range::Position => POSITION_LIMITS,
                    Range::Velocity => VELOCITY_LIMITS,
                    Range::Torque | Range::Current => return None,
                };
                let mut items = vec![joint(*axis, true)];
                items.extend(numbers(&[limits.min, limits.max]));
                (name, items)
            }
            Self::ControlModes(selection, modes) => {
                let codes = modes.iter().map(|&mode| mode.into()).collect();
                with_codes(MODES, selection, codes)?
            }
            Self::Interactions(selection, interactions) => {
                let codes = interactions.iter().map(|&one| one.into()).collect();
                with_codes(INTERACTIONS, selection, codes)?
            }
            Self::Pids(kind, selection, pids) => {
                let mut items = arguments(Some(*kind), selection, true);
                let lists = pids.iter().map(|pid| {
                    let gains = pid_messages::gains(pid, V4);
                    Item::List(gains.map(Item::F64).to_vec())
                });
                match selection {
                    Selection::One(_) => items.extend(lists),
                    _ => items.push(Item::List(lists.collect())),
                }
                (PIDS.of(selection)?, items)
            }
            Self::Impedance(axis, impedance) => {
                let mut items = one(axis);
                items.extend(numbers(&[impedance.stiffness, impedance.damping]));
                (IMPEDANCE, items)
            }
            Self::MotorParameters(axis, parameters, _) => {
                let mut items = one(axis);
                items.extend(numbers(&parameters.to_array()));
                (MOTOR_PARAMETERS, items)
            }
            Self::CalibrateAxis(axis, method, parameters) => {
                let mut items = one(axis);
                items.push(Item::Enum(*method));
                items.extend(numbers(parameters));
                (CALIBRATE_AXIS, items)
            }
            Self::CalibrationParameters(axis, calibration) => {
                let mut items = one(axis);
                items.push(Item::Enum(calibration.method));
                items.extend(numbers(&calibration.parameters));
                items.push(Item::F64(calibration.zero));
                (CALIBRATION_PARAMETERS, items)
            }
            Self::Variable(name, values) => {
                let value: Bottle = variable_value::to_values(values).collect();
                let items = vec![Item::Text(name.clone()), Item::Bottle(value)];
                (SET_VARIABLE, items)
            }
            Self::ManualBrake(axis, active) => {
                let mut items = one(axis);
                items.push(Item::Bool(*active));
                (MANUAL_BRAKE, items)
            }
            Self::AutoBrake(axis, enabled) => {
                let mut items = one(axis);
                items.push(Item::Bool(*enabled));
                (AUTO_BRAKE, items)
            }
        })
    }
}

fn with_codes(functions: Functions, selection: &Selection, codes: Vec<u32>) -> Option<Call> {
    let mut items = arguments(None, selection, false);
    items.push(match (selection, &codes[..]) {
        (Selection::One(_), [code]) => Item::Enum(*code),
        _ => Item::Enums(codes),
    });
    Some((functions.of(selection)?, items))
}

#[cfg(test)]
#[path = "thrift_calls_tests.rs"]
mod tests;
