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

use yarp_devices::PidKind;
use yarp_wire::{Bottle, Value};

use super::axis_selection::{Form, Selection};
use super::board_arguments::{Argument, Arguments, CallLayout};
use super::board_request::{Get, Malformed, Request};
use super::request_table::{Action, Row, Set, Setting};
use crate::thrift::{GET_VERSION, Item, Message};

/// The names of all functions, as a stock 4.0.0 board lists them.
pub(crate) const FUNCTIONS: &str = include_str!("functions_4.0.txt");
/// Suffix of every function of a control board.
const SUFFIX: &str = "RPC";
/// Stock skips this word in front of a call.
const DIRECT: &str = "__direct__";
const HELP: &str = "help";

const INTERFACES: &str = "getDeviceInterfaces";
const GET_VARIABLE: &str = "getRemoteVariable";
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
        let known = if said == GET_VERSION {
            Some(arguments.is_empty().then_some(Self::ProtocolVersion))
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

/// Parses a function; `None` for an unknown one, `Some(None)` for arguments that it does not have.
fn function(name: &str, arguments: &[Value]) -> Option<Option<Request>> {
    let lone = |form| Arguments::of_call(arguments, form);
    match name {
        INTERFACES => return Some(lone(Form::All).done(Request::Interfaces)),
        GET_VARIABLE => {
            let mut rest = lone(Form::All);
            let name = rest.text();
            return Some(name.and_then(|name| rest.done(Request::Get(Get::Variable(name)))));
        }
        _ => {}
    }
    let (row, form) = Row::of_function(name)?;
    let mut rest = lone(form);
    Some(call_of(row, &mut rest).and_then(|request| rest.done(request)))
}

/// Reads the arguments of a function.
fn call_of(row: Row, rest: &mut Arguments<'_>) -> Option<Request> {
    Some(match row {
        Row::Number(quantity) => {
            let kind = rest.kind(quantity.kind().is_some())?;
            Request::Get(Get::Values(quantity.of_kind(kind), rest.selection()?))
        }
        Row::Query(query) => {
            let kind = rest.kind(query.kind().is_some())?;
            Request::Get(Get::About(query.of_kind(kind), rest.selection()?))
        }
        Row::Setting(setting) => {
            let kind = rest.kind(setting.kind().is_some())?;
            let selection = rest.selection()?;
            let values = rest.values()?;
            Request::Set(Set::Values(setting.of_kind(kind), selection, values))
        }
        Row::Action(action) => {
            let kind = rest.kind(action.kind().is_some())?;
            let selection = rest.selection()?;
            if waits(action, &selection) {
                rest.flag()?;
            }
            Request::Set(Set::Act(action.of_kind(kind), selection))
        }
        Row::Command(command) => Request::Set(Set::read(command, rest)?),
    })
}

/// Calls that take whether to wait for the end. Never used here: a call that blocks delays its client.
fn waits(action: Action, selection: &Selection) -> bool {
    match action {
        Action::Park => matches!(selection, Selection::One(_)),
        Action::ParkRobot => true,
        _ => false,
    }
}

/// Returns whether joints are int16 in a call of a function.
fn has_short_joints(function: &str) -> bool {
    let others = [
        "getPosLimits",
        "setPosLimits",
        "getVelLimits",
        "setVelLimits",
        "getAvailableControlModes",
    ];
    function.contains("Pid") || others.contains(&function)
}

/// The kind of loop and the joints, as arguments of a function.
fn arguments(function: &str, kind: Option<PidKind>, selection: &Selection) -> Vec<Item> {
    let layout = layout(function, selection);
    let mut items = Vec::new();
    if let Some(kind) = kind {
        kind.write_v4(layout, &mut items);
    }
    selection.write_v4(layout, &mut items);
    items
}

fn layout(function: &str, selection: &Selection) -> CallLayout {
    CallLayout {
        form: selection.form(),
        short_joints: has_short_joints(function),
    }
}

type Call = (&'static str, Vec<Item>);

impl Get {
    fn to_call(&self) -> Option<Call> {
        let (spelling, kind, selection) = match self {
            Self::Values(quantity, selection) => (quantity.spelling(), quantity.kind(), selection),
            Self::About(query, selection) => (query.spelling(), query.kind(), selection),
            Self::Variable(name) => return Some((GET_VARIABLE, vec![Item::Text(name.clone())])),
        };
        let name = spelling.functions.of(selection)?;
        Some((name, arguments(name, kind, selection)))
    }
}

impl Set {
    fn to_call(&self) -> Option<Call> {
        match self {
            Self::Values(setting, selection, values) => {
                let name = setting.spelling().functions.of(selection)?;
                let mut items = arguments(name, setting.kind(), selection);
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
                Some((name, items))
            }
            Self::Act(action, selection) => {
                let name = action.spelling().functions.of(selection)?;
                let mut items = arguments(name, action.kind(), selection);
                if waits(*action, selection) {
                    items.push(Item::Bool(false));
                }
                Some((name, items))
            }
            command => {
                let selection = Selection::from(command.axes());
                let name = command.command()?.spelling().functions.of(&selection)?;
                let mut items = Vec::new();
                command.write_v4(layout(name, &selection), &mut items);
                Some((name, items))
            }
        }
    }
}

#[cfg(test)]
#[path = "board_thrift_calls_tests.rs"]
mod tests;
