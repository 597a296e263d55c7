//! Messages for cameras on IEEE 1394, in both wire versions.
//!
//! ```text
//! [fgfw] [DR2m]                    ->  16777235                  getVideoModeMaskDC1394RPC            ->  ([ok]) 16777235
//! [fgfw] [DR2o] 1                  ->  1 (0 if it is refused)    setVideoModeDC1394RPC 1              ->  [ok]
//! [fgfw] [DR2B] 160 120 8 8        ->  1                         setFormat7WindowDC1394RPC 160 120 8 8  ->  [ok]
//! ```
//!
//! Masks are unsigned numbers in signed ones, truth values 0 or 1 in 3.x.
//!
//! Source: `CameraVocabs.h` and `FrameGrabberControlsDC1394_Forwarder.cpp` of 3.5, `frameGrabberMsgs.thrift` of
//! 4.0.0. The servers of 3.5 to 3.12 take the word itself for the first value of a command, so that no client of
//! stock's or ours can set anything there.

use yarp_wire::{Bottle, Value, Vocab32};

use super::camera_request::{Malformed, Request, flag, integer};
use super::camera_vocab_requests::Reply;
use super::reply_value::Answer;
use crate::thrift::Item;

pub(super) const INTERFACE: Vocab32 = Vocab32::new("fgfw");

/// A query or a command to a camera on IEEE 1394.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[allow(missing_docs, reason = "the methods of `FirewireControls`")]
pub enum Firewire {
    VideoModes,
    VideoMode,
    SetVideoMode,
    Rates,
    Rate,
    SetRate,
    IsoSpeed,
    SetIsoSpeed,
    ColorCodings,
    ColorCoding,
    SetColorCoding,
    WindowLimits,
    Window,
    SetWindow,
    Set1394b,
    Is1394b,
    SetTransmission,
    IsTransmitting,
    SetBroadcast,
    SetDefaults,
    Reset,
    SetPower,
    SetCapture,
    BytesPerPacket,
    SetBytesPerPacket,
}

/// Message, function in 4.0, word in 3.x, and the kinds of arguments and results: `i` an integer, `b` a truth value.
/// Requests without results are commands. In the order of stock's `help`.
const ALL: [(Firewire, &str, &str, &str, &str); 25] = {
    use Firewire as F;
    [
        (F::VideoModes, "getVideoModeMaskDC1394", "DR2m", "", "i"),
        (F::VideoMode, "getVideoModeDC1394", "DR2n", "", "i"),
        (F::SetVideoMode, "setVideoModeDC1394", "DR2o", "i", ""),
        (F::Rates, "getFPSMaskDC1394", "DR2p", "", "i"),
        (F::Rate, "getFPSDC1394", "DR2q", "", "i"),
        (F::SetRate, "setFPSDC1394", "DR2r", "i", ""),
        (F::IsoSpeed, "getISOSpeedDC1394", "DR2s", "", "i"),
        (F::SetIsoSpeed, "setISOSpeedDC1394", "DR2t", "i", ""),
        (
            F::ColorCodings,
            "getColorCodingMaskDC1394",
            "DR2u",
            "i",
            "i",
        ),
        (F::ColorCoding, "getColorCodingDC1394", "DR2v", "", "i"),
        (F::SetColorCoding, "setColorCodingDC1394", "DR2w", "i", ""),
        (
            F::WindowLimits,
            "getFormat7MaxWindowDC1394",
            "DR2z",
            "",
            "iiiiii",
        ),
        (F::Window, "getFormat7WindowDC1394", "DR2A", "", "iiii"),
        (F::SetWindow, "setFormat7WindowDC1394", "DR2B", "iiii", ""),
        (F::Set1394b, "setOperationModeDC1394", "DR2C", "b", ""),
        (F::Is1394b, "getOperationModeDC1394", "DR2D", "", "b"),
        (F::SetTransmission, "setTransmissionDC1394", "DR2E", "b", ""),
        (F::IsTransmitting, "getTransmissionDC1394", "DR2F", "", "b"),
        (F::SetBroadcast, "setBroadcastDC1394", "DR2I", "b", ""),
        (F::SetDefaults, "setDefaultsDC1394", "DR2J", "", ""),
        (F::Reset, "setResetDC1394", "DR2K", "", ""),
        (F::SetPower, "setPowerDC1394", "DR2L", "b", ""),
        (F::SetCapture, "setCaptureDC1394", "DR2M", "b", ""),
        (
            F::BytesPerPacket,
            "getBytesPerPacketDC1394",
            "DR2O",
            "",
            "i",
        ),
        (
            F::SetBytesPerPacket,
            "setBytesPerPacketDC1394",
            "DR2N",
            "i",
            "",
        ),
    ]
};

/// The names of the functions in 4.0.
pub(super) fn functions() -> impl Iterator<Item = &'static str> {
    ALL.iter().map(|(_, function, ..)| *function)
}

impl Firewire {
    #[cfg(test)]
    pub(super) fn all() -> impl Iterator<Item = Self> {
        ALL.iter().map(|(what, ..)| *what)
    }

    /// Returns the message of this function in 4.0.
    pub(super) fn of_function(name: &str) -> Option<Self> {
        let found = ALL.iter().find(|(_, function, ..)| *function == name);
        found.map(|(what, ..)| *what)
    }

    pub(super) fn function(self) -> &'static str {
        ALL[self as usize].1
    }

    fn word(self) -> Vocab32 {
        Vocab32::new(ALL[self as usize].2)
    }

    fn arguments(self) -> &'static str {
        ALL[self as usize].3
    }

    fn results(self) -> &'static str {
        ALL[self as usize].4
    }

    pub(super) fn is_order(self) -> bool {
        self.results().is_empty()
    }

    /// Reads the values behind a word or a function: exactly those that it has.
    pub(super) fn request(self, values: &[Value]) -> Option<Request> {
        let kinds = self.arguments();
        if kinds.len() != values.len() {
            return None;
        }
        let read = |(kind, value)| match kind {
            'b' => flag(value).map(i32::from),
            _ => integer(value),
        };
        let values = kinds.chars().zip(values).map(read);
        Some(Request::Firewire(self, values.collect::<Option<_>>()?))
    }

    /// Values as arguments of 4.0.
    pub(super) fn items(self, values: &[i32]) -> Vec<Item> {
        let item = |(kind, value): (char, &i32)| match kind {
            'b' => Item::Bool(*value != 0),
            _ => Item::I32(*value),
        };
        self.arguments().chars().zip(values).map(item).collect()
    }

    /// The results that 4.0 reads behind an error.
    pub(super) fn nothing(self) -> Vec<Item> {
        let item = |kind| match kind {
            'b' => Item::Bool(false),
            _ => Item::I32(0),
        };
        self.results().chars().map(item).collect()
    }

    /// Reads results; exactly those that it has.
    pub(super) fn answer(self, values: &[Value]) -> Option<Answer> {
        if self.results().len() != values.len() {
            return None;
        }
        Some(match (self.results(), values) {
            (_, []) => Answer::Done,
            ("b", [value]) => Answer::Flag(flag(value)?),
            (_, [value]) => Answer::Integer(integer(value)?),
            (_, many) => Answer::Integers(many.iter().map(integer).collect::<Option<_>>()?),
        })
    }
}

/// A request in words.
pub(super) fn to_bottle(what: Firewire, values: &[i32]) -> Bottle {
    let mut bottle = Bottle::of(INTERFACE).with(what.word());
    bottle.extend(values.iter().copied().map(Value::from));
    bottle
}

/// Parses a message in words, up to its second word.
fn said(message: &Bottle) -> Option<Firewire> {
    let word = message.get(1).and_then(Value::as_vocab)?;
    let found = ALL.iter().find(|(what, ..)| what.word() == word);
    found.map(|(what, ..)| *what)
}

/// Reads a request in words.
pub(super) fn parse(message: &Bottle) -> Result<Request, Malformed> {
    let word = message.get(1).and_then(Value::as_vocab);
    let word = word.unwrap_or(Vocab32::from_code(0));
    let what = said(message).ok_or(Malformed::UnknownWord(word))?;
    let values = message.as_slice().get(2..).unwrap_or_default();
    what.request(values)
        .ok_or_else(|| Malformed::Values(format!("[{INTERFACE}] [{word}]")))
}

/// Encodes the reply in words to a request that succeeded: the bare results, or 1.
pub(super) fn reply(what: Firewire, results: Vec<Item>) -> Bottle {
    match what.is_order() {
        true => Bottle::of(1),
        false => results.into_iter().map(Value::from).collect(),
    }
}

/// Encodes the reply in words to a request that failed. The value of a query is the number of its first item: a text
/// is 0.
pub(super) fn refusal(message: &Bottle) -> Bottle {
    match said(message) {
        Some(what) if what.is_order() => Bottle::of(0),
        _ => Bottle::of("command not recognized"),
    }
}

/// Reads a reply in words; `None` if it is not a reply to it.
pub(super) fn read(what: Firewire, reply: &Bottle) -> Option<Reply> {
    if let Some(Value::Vocab32(_) | Value::String(_)) = reply.get(0) {
        return Some(Reply::Refused);
    }
    if what.is_order() {
        return match reply.get(0).and_then(flag)? {
            true => Some(Reply::Done(Answer::Done)),
            false => Some(Reply::Refused),
        };
    }
    what.answer(reply.as_slice()).map(Reply::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stands_at_its_place() {
        for (place, (what, ..)) in ALL.iter().enumerate() {
            assert_eq!(*what as usize, place);
        }
    }
}
