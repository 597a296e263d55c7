//! Requests and replies of 4.0: calls of the service `FrameGrabberMsgs`.
//!
//! ```text
//! getWidthRPC                ->  ([ok]) 320
//! setRgbResolutionRPC 640 480  ->  [ok]
//! hasFeatureRPC 0            ->  ([ok]) [ok]
//! ```
//!
//! Source: `frameGrabberMsgs.thrift` and `vertex_t::write` of 4.0.0.

use yarp_wire::typed;
use yarp_wire::{Bottle, Value, WireVersion};

use super::camera_request::{Ability, Channel, Malformed, Request, flag, integer};
use super::firewire_messages::{self, Firewire};
use super::reply_value::Answer;
use super::{camera_vocab_requests, image_message};
use crate::control_board::messages::float;
use crate::thrift::{GET_VERSION, Item, Message, ReturnCode};
use yarp_devices::image::Crop;

/// Names of the service's functions, without the `RPC` at the end, in the order of stock's `help`.
const FUNCTIONS: [&str; 29] = [
    "getHeight",
    "getWidth",
    "getImage",
    "getImageCrop",
    "getRgbWidth",
    "getRgbHeight",
    "getRgbSupportedConfigurations",
    "getRgbResolution",
    "setRgbResolution",
    "getRgbFOV",
    "setRgbFOV",
    "getRgbIntrinsicParam",
    "getRgbMirroring",
    "setRgbMirroring",
    "getCameraDescription",
    "hasFeature",
    "setFeature1",
    "getFeature1",
    "setFeature2",
    "getFeature2",
    "hasOnOff",
    "setActive",
    "getActive",
    "hasAuto",
    "hasManual",
    "hasOnePush",
    "setMode",
    "getMode",
    "setOnePush",
];

const HELP: &str = "help";
const SUFFIX: &str = "RPC";

/// Returns whether a message that begins with this text is a call.
pub(super) fn is_name(text: &str) -> bool {
    text == HELP || text == GET_VERSION || text.ends_with(SUFFIX)
}

/// The names of all functions, as stock lists them.
pub fn help() -> Message {
    let all = FUNCTIONS.into_iter().chain(firewire_messages::functions());
    let names = all.map(|name| format!("{name}{SUFFIX}"));
    let title = "*** Available commands:".to_owned();
    let items = std::iter::once(title).chain(names).chain([HELP.to_owned()]);
    Message(vec![
        Item::Vocab(yarp_wire::Vocab32::MANY),
        Item::List(items.map(Item::Text).collect()),
    ])
}

/// Reads a call.
pub(super) fn parse(message: &Bottle) -> Result<Request, Malformed> {
    use Request as R;
    let full = message.get(0).and_then(Value::as_str).unwrap_or_default();
    let name = match full {
        HELP => return Ok(R::Help),
        GET_VERSION => return Ok(R::ProtocolVersion),
        _ => full.strip_suffix(SUFFIX).unwrap_or(full),
    };
    let values = message.as_slice().get(1..).unwrap_or_default();
    if let Some(what) = Firewire::of_function(name) {
        let request = what.request(values);
        return request.ok_or_else(|| Malformed::Values(full.to_owned()));
    }
    if !FUNCTIONS.contains(&name) {
        return Err(Malformed::UnknownFunction(full.to_owned()));
    }
    let int = |place: usize| values.get(place).and_then(integer);
    let number = |place: usize| values.get(place).and_then(float);
    let switch = |place: usize| values.get(place).and_then(flag);
    let read = || -> Option<(usize, Request)> {
        Some(match name {
            "getHeight" => (0, R::Height(Channel::Colour)),
            "getWidth" => (0, R::Width(Channel::Colour)),
            "getImage" => (0, R::Image(Channel::Colour)),
            "getImageCrop" => (2, R::Crop(Channel::Colour, read_crop(values)?)),
            "getRgbWidth" => (0, R::RgbWidth),
            "getRgbHeight" => (0, R::RgbHeight),
            "getRgbSupportedConfigurations" => (0, R::Configurations),
            "getRgbResolution" => (0, R::Resolution),
            "setRgbResolution" => (2, R::SetResolution(int(0)?, int(1)?)),
            "getRgbFOV" => (0, R::FieldOfView),
            "setRgbFOV" => (2, R::SetFieldOfView(number(0)?, number(1)?)),
            "getRgbIntrinsicParam" => (0, R::Intrinsics),
            "getRgbMirroring" => (0, R::Mirroring),
            "setRgbMirroring" => (1, R::SetMirroring(switch(0)?)),
            "getCameraDescription" => (0, R::Description),
            "hasFeature" => (1, R::Has(Ability::Feature, int(0)?)),
            "setFeature1" => (2, R::SetValue(int(0)?, number(1)?)),
            "getFeature1" => (1, R::Value(int(0)?)),
            "setFeature2" => (3, R::SetPair(int(0)?, number(1)?, number(2)?)),
            "getFeature2" => (1, R::Pair(int(0)?)),
            "hasOnOff" => (1, R::Has(Ability::OnOff, int(0)?)),
            "setActive" => (2, R::SetActive(int(0)?, switch(1)?)),
            "getActive" => (1, R::Active(int(0)?)),
            "hasAuto" => (1, R::Has(Ability::Auto, int(0)?)),
            "hasManual" => (1, R::Has(Ability::Manual, int(0)?)),
            "hasOnePush" => (1, R::Has(Ability::OnePush, int(0)?)),
            "setMode" => (2, R::SetMode(int(0)?, int(1)?)),
            "getMode" => (1, R::Mode(int(0)?)),
            _ => (1, R::OnePush(int(0)?)),
        })
    };
    match read() {
        Some((count, request)) if count == values.len() => Ok(request),
        _ => Err(Malformed::Values(full.to_owned())),
    }
}

fn read_crop(values: &[Value]) -> Option<Crop> {
    let [kind, places] = values else {
        return None;
    };
    let place = |value: &Value| match value.as_list()?.as_slice() {
        [x, y] => Some((integer(x)?, integer(y)?)),
        _ => None,
    };
    let places: Option<Vec<_>> = places.as_list()?.iter().map(place).collect();
    camera_vocab_requests::crop(integer(kind)?, places?)
}

/// A request as a call; `None` if 4.0 has no function for it.
pub(super) fn to_call(request: &Request) -> Option<Message> {
    use Request as R;
    let int = |number: &i32| Item::I32(*number);
    let number = |number: &f64| Item::F64(*number);
    let (name, arguments) = match request {
        R::Help => return Some(Message::call(HELP, [])),
        R::ProtocolVersion => return Some(Message::call(GET_VERSION, [])),
        R::Firewire(what, values) => (what.function(), what.items(values)),
        R::Height(Channel::Colour) => ("getHeight", vec![]),
        R::Width(Channel::Colour) => ("getWidth", vec![]),
        R::Image(Channel::Colour) => ("getImage", vec![]),
        R::Crop(Channel::Colour, crop) => {
            let (kind, places) = camera_vocab_requests::kind_of(crop);
            let place = |(x, y)| Item::List(vec![Item::I32(x), Item::I32(y)]);
            let places = Item::List(places.into_iter().map(place).collect());
            ("getImageCrop", vec![Item::I32(kind), places])
        }
        R::Height(_) | R::Width(_) | R::Image(_) | R::Crop(..) => return None,
        R::RgbWidth => ("getRgbWidth", vec![]),
        R::RgbHeight => ("getRgbHeight", vec![]),
        R::Configurations => ("getRgbSupportedConfigurations", vec![]),
        R::Resolution => ("getRgbResolution", vec![]),
        R::SetResolution(width, height) => ("setRgbResolution", vec![int(width), int(height)]),
        R::FieldOfView => ("getRgbFOV", vec![]),
        R::SetFieldOfView(across, down) => ("setRgbFOV", vec![number(across), number(down)]),
        R::Intrinsics => ("getRgbIntrinsicParam", vec![]),
        R::Mirroring => ("getRgbMirroring", vec![]),
        R::SetMirroring(value) => ("setRgbMirroring", vec![Item::Bool(*value)]),
        R::Description => ("getCameraDescription", vec![]),
        R::Has(ability, code) => {
            let name = match ability {
                Ability::Feature => "hasFeature",
                Ability::OnOff => "hasOnOff",
                Ability::Auto => "hasAuto",
                Ability::Manual => "hasManual",
                Ability::OnePush => "hasOnePush",
            };
            (name, vec![int(code)])
        }
        R::Value(code) => ("getFeature1", vec![int(code)]),
        R::SetValue(code, value) => ("setFeature1", vec![int(code), number(value)]),
        R::Pair(code) => ("getFeature2", vec![int(code)]),
        R::SetPair(code, one, other) => {
            ("setFeature2", vec![int(code), number(one), number(other)])
        }
        R::Active(code) => ("getActive", vec![int(code)]),
        R::SetActive(code, value) => ("setActive", vec![int(code), Item::Bool(*value)]),
        R::Mode(code) => ("getMode", vec![int(code)]),
        R::SetMode(code, mode) => ("setMode", vec![int(code), int(mode)]),
        R::OnePush(code) => ("setOnePush", vec![int(code)]),
    };
    Some(Message::call(&format!("{name}{SUFFIX}"), arguments))
}

/// The reply to a call that was done.
pub(super) fn reply(answer: &Answer) -> Option<Message> {
    let items = answer.items(WireVersion::V4)?;
    Some(Message(match items.is_empty() {
        true => ReturnCode::Ok.alone(),
        false => ReturnCode::Ok.with(items),
    }))
}

/// Encodes the reply to a call that failed: the code, and the results that stock reads after it, empty.
pub(super) fn refusal(request: &Request, code: ReturnCode) -> Message {
    use Request as R;
    let nothing = match request {
        R::Width(_) | R::Height(_) | R::RgbWidth | R::RgbHeight | R::Mode(_) => vec![Item::I32(0)],
        R::Image(_) | R::Crop(..) => vec![Item::Bottle(image_message::to_list(
            &typed::Image::default(),
        ))],
        R::Configurations => vec![Item::List(Vec::new())],
        R::Resolution => vec![Item::I32(0), Item::I32(0)],
        R::FieldOfView | R::Pair(_) => vec![Item::F64(0.0), Item::F64(0.0)],
        R::Intrinsics => vec![Item::Bottle(Bottle::new())],
        R::Mirroring | R::Has(..) | R::Active(_) => vec![Item::Bool(false)],
        R::Description => vec![Item::I32(0), Item::Text(String::new())],
        R::Value(_) => vec![Item::F64(0.0)],
        R::Firewire(what, _) => what.nothing(),
        _ => Vec::new(),
    };
    Message(match nothing.is_empty() {
        true => code.alone(),
        false => code.with(nothing),
    })
}
