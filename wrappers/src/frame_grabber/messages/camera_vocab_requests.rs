//! Requests and replies of 3.x.
//!
//! ```text
//! [fgi] [get] [w]                  ->  [fgi] [w] [is] 320
//! [visr] [set] [res] 640 480       ->  [visr] [set] 1
//! [fgc] [has] [feat] 0             ->  [fgc] [has] [feat] 1952540006 1
//! ```
//!
//! Source: `FrameGrabberOf_Responder-inl.h`, `FrameGrabberControls_Responder.cpp`, `RgbVisualParams_Responder.cpp` of
//! 3.5; `[fgc] [set] 1` is 3.12's, where 3.5 answers a command to a feature with `[nak]`, which clients ignore.

use yarp_devices::image::Crop;
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

use super::camera_request::{Ability, Channel, Malformed, Request, flag, integer};
use super::firewire_messages;
use super::reply_value::Answer;
use crate::control_board::messages::float;

const COLOUR: Vocab32 = Vocab32::new("fgi");
const RAW: Vocab32 = Vocab32::new("fgir");
const PARAMETERS: Vocab32 = Vocab32::new("visr");
const CONTROLS: Vocab32 = Vocab32::new("fgc");
const GET: Vocab32 = Vocab32::new("get");
const SET: Vocab32 = Vocab32::new("set");
const HAS: Vocab32 = Vocab32::new("has");
const IS: Vocab32 = Vocab32::new("is");
const FEATURE: Vocab32 = Vocab32::new("feat");
const NAK: Vocab32 = Vocab32::new("nak");
const CROP: Vocab32 = Vocab32::new("crop");

const ABILITIES: [(Ability, Vocab32); 5] = [
    (Ability::Feature, FEATURE),
    (Ability::OnOff, Vocab32::new("onof")),
    (Ability::Auto, Vocab32::new("auto")),
    (Ability::Manual, Vocab32::new("man")),
    (Ability::OnePush, Vocab32::new("onep")),
];

/// The words of a request; `None` if 3.x has no message for it.
fn spelling(request: &Request) -> Option<[Vocab32; 3]> {
    use Request as R;
    let image = |channel: &Channel, word| {
        let interface = match channel {
            Channel::Colour => COLOUR,
            Channel::Raw => RAW,
        };
        [interface, GET, Vocab32::new(word)]
    };
    let of = |interface, act, word| [interface, act, Vocab32::new(word)];
    Some(match request {
        R::Help | R::ProtocolVersion | R::Firewire(..) => return None,
        R::Width(channel) => image(channel, "w"),
        R::Height(channel) => image(channel, "h"),
        R::Image(channel) => image(channel, "imgr"),
        R::Crop(channel, _) => image(channel, "crop"),
        R::RgbWidth => of(PARAMETERS, GET, "w"),
        R::RgbHeight => of(PARAMETERS, GET, "h"),
        R::Configurations => of(PARAMETERS, GET, "conf"),
        R::Resolution => of(PARAMETERS, GET, "res"),
        R::FieldOfView => of(PARAMETERS, GET, "fov"),
        R::Intrinsics => of(PARAMETERS, GET, "intp"),
        R::Mirroring => of(PARAMETERS, GET, "mirr"),
        R::SetResolution(..) => of(PARAMETERS, SET, "res"),
        R::SetFieldOfView(..) => of(PARAMETERS, SET, "fov"),
        R::SetMirroring(_) => of(PARAMETERS, SET, "mirr"),
        R::Description => of(CONTROLS, GET, "camd"),
        R::Has(ability, _) => {
            let word = ABILITIES.iter().find(|(known, _)| known == ability);
            [CONTROLS, HAS, word.map_or(FEATURE, |(_, word)| *word)]
        }
        R::Value(_) => of(CONTROLS, GET, "feat"),
        R::Pair(_) => of(CONTROLS, GET, "fea2"),
        R::Active(_) => of(CONTROLS, GET, "actv"),
        R::Mode(_) => of(CONTROLS, GET, "mode"),
        R::SetValue(..) => of(CONTROLS, SET, "feat"),
        R::SetPair(..) => of(CONTROLS, SET, "fea2"),
        R::SetActive(..) => of(CONTROLS, SET, "actv"),
        R::SetMode(..) => of(CONTROLS, SET, "mode"),
        R::OnePush(_) => of(CONTROLS, SET, "onep"),
    })
}

/// A request in words.
pub(super) fn to_bottle(request: &Request) -> Option<Bottle> {
    use Request as R;
    if let R::Firewire(what, values) = request {
        return Some(firewire_messages::to_bottle(*what, values));
    }
    let mut bottle: Bottle = spelling(request)?.map(Value::from).into_iter().collect();
    let values: Vec<Value> = match request {
        R::Crop(_, crop) => {
            let (kind, places) = kind_of(crop);
            let numbers = places.into_iter().flat_map(|(x, y)| [x.into(), y.into()]);
            vec![kind.into(), Value::List(numbers.collect())]
        }
        R::SetResolution(width, height) => vec![(*width).into(), (*height).into()],
        R::SetFieldOfView(across, down) => vec![(*across).into(), (*down).into()],
        R::SetMirroring(value) => vec![i32::from(*value).into()],
        R::Has(_, code)
        | R::Value(code)
        | R::Pair(code)
        | R::Active(code)
        | R::Mode(code)
        | R::OnePush(code) => vec![(*code).into()],
        R::SetValue(code, value) => vec![(*code).into(), (*value).into()],
        R::SetPair(code, one, other) => vec![(*code).into(), (*one).into(), (*other).into()],
        R::SetActive(code, value) => vec![(*code).into(), i32::from(*value).into()],
        R::SetMode(code, mode) => vec![(*code).into(), (*mode).into()],
        _ => Vec::new(),
    };
    bottle.extend(values);
    Some(bottle)
}

/// Reads a request in words. Numbers must be there, and be numbers.
pub(super) fn parse(message: &Bottle) -> Result<Request, Malformed> {
    use Request as R;
    let word = |place: usize| message.get(place).and_then(Value::as_vocab);
    let unknown =
        |place: usize| Malformed::UnknownWord(word(place).unwrap_or(Vocab32::from_code(0)));
    let interface = word(0).ok_or(Malformed::Interface)?;
    if interface == firewire_messages::INTERFACE {
        return firewire_messages::parse(message);
    }
    if ![COLOUR, RAW, PARAMETERS, CONTROLS].contains(&interface) {
        return Err(Malformed::Interface);
    }
    let act = word(1).ok_or_else(|| unknown(1))?;
    let what = word(2).ok_or_else(|| unknown(2))?;
    let values = message.as_slice().get(3..).unwrap_or_default();
    let wrong = || Malformed::Values(format!("[{interface}] [{act}] [{what}]"));
    let text = what.to_string();
    if interface == COLOUR || interface == RAW {
        let channel = if interface == RAW {
            Channel::Raw
        } else {
            Channel::Colour
        };
        return match (act, text.as_str(), values) {
            (GET, "w", _) => Ok(R::Width(channel)),
            (GET, "h", _) => Ok(R::Height(channel)),
            (GET, "imgr", _) => Ok(R::Image(channel)),
            (GET, "crop", [kind, Value::List(places)]) => {
                let crop = read_crop(kind, places).ok_or_else(wrong)?;
                Ok(R::Crop(channel, crop))
            }
            (GET, "crop", _) => Err(wrong()),
            (GET, ..) => Err(unknown(2)),
            _ => Err(unknown(1)),
        };
    }
    let read = || -> Option<Result<Request, Malformed>> {
        let int = |place: usize| values.get(place).and_then(integer);
        let number = |place: usize| values.get(place).and_then(float);
        let switch = |place: usize| values.get(place).and_then(flag);
        Some(Ok(match (interface, act, text.as_str()) {
            (PARAMETERS, GET, "w") => R::RgbWidth,
            (PARAMETERS, GET, "h") => R::RgbHeight,
            (PARAMETERS, GET, "conf") => R::Configurations,
            (PARAMETERS, GET, "res") => R::Resolution,
            (PARAMETERS, GET, "fov") => R::FieldOfView,
            (PARAMETERS, GET, "intp") => R::Intrinsics,
            (PARAMETERS, GET, "mirr") => R::Mirroring,
            (PARAMETERS, SET, "res") => R::SetResolution(int(0)?, int(1)?),
            (PARAMETERS, SET, "fov") => R::SetFieldOfView(number(0)?, number(1)?),
            (PARAMETERS, SET, "mirr") => R::SetMirroring(switch(0)?),
            (CONTROLS, HAS, _) => match ABILITIES.iter().find(|(_, word)| *word == what) {
                Some((ability, _)) => R::Has(*ability, int(0)?),
                None => return Some(Err(unknown(2))),
            },
            (CONTROLS, GET, "camd") => R::Description,
            (CONTROLS, GET, "feat") => R::Value(int(0)?),
            (CONTROLS, GET, "fea2") => R::Pair(int(0)?),
            (CONTROLS, GET, "actv") => R::Active(int(0)?),
            (CONTROLS, GET, "mode") => R::Mode(int(0)?),
            (CONTROLS, SET, "feat") => R::SetValue(int(0)?, number(1)?),
            (CONTROLS, SET, "fea2") => R::SetPair(int(0)?, number(1)?, number(2)?),
            (CONTROLS, SET, "actv") => R::SetActive(int(0)?, switch(1)?),
            (CONTROLS, SET, "mode") => R::SetMode(int(0)?, int(1)?),
            (CONTROLS, SET, "onep") => R::OnePush(int(0)?),
            (_, GET | SET, _) => return Some(Err(unknown(2))),
            _ => return Some(Err(unknown(1))),
        }))
    };
    read().unwrap_or_else(|| Err(wrong()))
}

/// A crop of type 0 with two corners, or of type 1 with any number of places.
fn read_crop(kind: &Value, places: &Bottle) -> Option<Crop> {
    let numbers: Vec<i32> = places.iter().map(integer).collect::<Option<_>>()?;
    if !numbers.len().is_multiple_of(2) {
        return None;
    }
    let places = numbers.chunks_exact(2).map(|pair| (pair[0], pair[1]));
    crop(integer(kind)?, places.collect())
}

/// The type of stock's that a crop has, and its places.
pub(super) fn kind_of(crop: &Crop) -> (i32, Vec<(i32, i32)>) {
    match crop {
        Crop::Rectangle(one, other) => (0, vec![*one, *other]),
        Crop::Pixels(places) => (1, places.clone()),
    }
}

/// A crop of a type of stock's.
pub(super) fn crop(kind: i32, places: Vec<(i32, i32)>) -> Option<Crop> {
    match (kind, &places[..]) {
        (0, [one, other]) => Some(Crop::Rectangle(*one, *other)),
        (1, _) => Some(Crop::Pixels(places)),
        _ => None,
    }
}

/// The reply to a request that was done.
pub(super) fn reply(request: &Request, answer: &Answer) -> Option<Bottle> {
    if let Request::Firewire(what, _) = request {
        return Some(firewire_messages::reply(
            *what,
            answer.items(WireVersion::V3)?,
        ));
    }
    let [interface, act, what] = spelling(request)?;
    let head = match act {
        SET => vec![interface, SET],
        HAS => vec![interface, HAS, FEATURE],
        _ => vec![interface, what, IS],
    };
    let mut reply: Bottle = head.into_iter().map(Value::from).collect();
    if act == SET {
        return Some(reply.with(1));
    }
    if act == HAS {
        reply.push(what.code() as i32);
    }
    reply.extend(answer.items(WireVersion::V3)?.into_iter().map(Value::from));
    Some(reply)
}

/// The reply to a message that was not parsed or not executed, in the form of its interface.
pub(super) fn refusal(message: &Bottle, why: &str) -> Bottle {
    let interface = message.get(0).and_then(Value::as_vocab);
    let act = message.get(1).and_then(Value::as_vocab);
    match interface {
        Some(interface @ (PARAMETERS | CONTROLS)) if act == Some(SET) => {
            Bottle::of(interface).with(SET).with(0)
        }
        Some(COLOUR | RAW) => Bottle::of(Vocab32::FAIL).with(why),
        Some(PARAMETERS | CONTROLS) => Bottle::of(Vocab32::FAIL),
        Some(firewire_messages::INTERFACE) => firewire_messages::refusal(message),
        _ => Bottle::of(NAK),
    }
}

/// Reads the reply to a request; `None` if it is not a reply to it.
pub(super) fn read(request: &Request, reply: &Bottle) -> Option<Reply> {
    if let Request::Firewire(what, _) = request {
        return firewire_messages::read(*what, reply);
    }
    let [interface, act, what] = spelling(request)?;
    let word = |place: usize| reply.get(place).and_then(Value::as_vocab);
    if word(0) == Some(Vocab32::FAIL) {
        return Some(Reply::Refused);
    }
    if word(0) == Some(NAK) {
        // So 3.5 answers successful commands to features.
        let done = interface == CONTROLS && act == SET;
        return Some(if done {
            Reply::Done(Answer::Done)
        } else {
            Reply::Refused
        });
    }
    let values = |from: usize| reply.as_slice().get(from..).unwrap_or_default();
    if word(0) != Some(interface) {
        return None;
    }
    if act == SET {
        return match reply.get(2).and_then(flag)? {
            true => Some(Reply::Done(Answer::Done)),
            false => Some(Reply::Refused),
        };
    }
    let values = if act == HAS {
        values(4)
    } else if word(1) == Some(what) || what == CROP {
        values(3)
    } else {
        return None;
    };
    Answer::read(request, values, WireVersion::V3).map(Reply::Done)
}

/// Outcome of a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// It was done.
    Done(Answer),
    /// It was refused.
    Refused,
}
