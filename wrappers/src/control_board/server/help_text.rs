//! Help texts for typed requests.

use yarp_wire::{Bottle, Vocab32};

use super::super::messages::{FUNCTIONS, Reply};
use crate::thrift::{Item, Message};

/// Requests that can be typed, and their effect.
const LINES: [(&str, &str); 25] = [
    ("help more", "this list"),
    ("get axes", "number of axes"),
    ("get name 0", "name of an axis"),
    ("get encs", "measured positions, degrees or metres"),
    ("get esps", "measured speeds"),
    ("get poss", "where the joints were last told to go"),
    ("get vels", "how fast point-to-point moves may become"),
    ("get accs", "how hard the joints accelerate"),
    ("get vmos", "velocities last asked for"),
    ("get dons", "1 if all joints are at rest, else 0"),
    ("get llim 0", "position limits of an axis"),
    ("get vlim 0", "velocity limits of an axis"),
    ("get icmd cmds", "control modes"),
    (
        "set icmd cmod 0 pos",
        "put an axis into a mode: pos, vel, idl",
    ),
    ("set icmd cmds (pos vel)", "put all axes into modes"),
    ("set pos 0 10.0", "move an axis to a position"),
    ("set poss (10.0 20.0)", "move all axes to positions"),
    ("set rel 0 -5.0", "move an axis by a distance"),
    (
        "set vel 0 10.0",
        "how fast point-to-point moves of an axis may become",
    ),
    ("set acc 0 20.0", "how hard an axis accelerates"),
    ("set vmos (1.0 0.0)", "move all axes at velocities"),
    ("set stos", "stop all axes; set sto 0 stops one"),
    (
        "numb set pos 0 10.0",
        "move, and tell a number; async:o tells how it ends",
    ),
    ("numb get 1234", "what became of the move of this number"),
    ("numb drop", "how many orders made way for newer ones"),
];

/// The answer to `help more`, laid out as stock's: `[many]`, then a list and a string in turn.
pub(super) fn reply() -> Reply {
    Reply::usage(LINES.map(|(typed, meaning)| (Bottle::of(typed), meaning.to_owned())))
}

/// The answer to `help` in 4.0, in the order of stock: `[many]`, then a list of a title and the names of all functions.
pub(super) fn functions() -> Message {
    let title = "*** Available commands:";
    let names = std::iter::once(title)
        .chain(FUNCTIONS.lines())
        .chain(["help"]);
    let names = names.map(|name| Item::Text(name.to_owned())).collect();
    Message(vec![Item::Vocab(Vocab32::MANY), Item::List(names)])
}
