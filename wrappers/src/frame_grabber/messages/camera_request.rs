//! Requests to a camera, in either wire version.

use yarp_devices::image::Crop;
use yarp_wire::{Bottle, Value, Vocab32};

use super::{Firewire, camera_thrift_calls, camera_vocab_requests};

/// Kind of images.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Channel {
    /// In colour; in 4.0 either kind that the camera has.
    Colour,
    /// Raw sensor images.
    Raw,
}

/// Capability of a feature.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Ability {
    /// To be there.
    Feature,
    /// To be switched off.
    OnOff,
    /// To be turned by the camera.
    Auto,
    /// To be turned from outside.
    Manual,
    /// To be turned by the camera once.
    OnePush,
}

/// A query or a command. Features are numbers here, because there are more of them than we know.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the names are those of stock's functions")]
pub enum Request {
    Help,
    ProtocolVersion,
    Width(Channel),
    Height(Channel),
    Image(Channel),
    Crop(Channel, Crop),
    RgbWidth,
    RgbHeight,
    Configurations,
    Resolution,
    FieldOfView,
    Intrinsics,
    Mirroring,
    SetResolution(i32, i32),
    SetFieldOfView(f64, f64),
    SetMirroring(bool),
    Description,
    Has(Ability, i32),
    Value(i32),
    Pair(i32),
    Active(i32),
    Mode(i32),
    SetValue(i32, f64),
    SetPair(i32, f64, f64),
    SetActive(i32, bool),
    SetMode(i32, i32),
    OnePush(i32),
    /// Requests of cameras on IEEE 1394, with their values.
    Firewire(Firewire, Vec<i32>),
}

/// Reasons why a message is not a request.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Malformed {
    /// It begins with no word of an interface.
    #[error("no interface of a camera")]
    Interface,
    /// A word that is none of the protocol, or not in this place.
    #[error("unknown word [{0}]")]
    UnknownWord(Vocab32),
    /// A function that is none of the protocol.
    #[error("unknown function {0}")]
    UnknownFunction(String),
    /// Values are missing, too many, or of another kind.
    #[error("wrong number or kind of values for {0}")]
    Values(String),
}

impl Request {
    /// Returns whether a message is a call of 4.0. Messages of 3.x on the same port begin with a word.
    pub fn is_call(message: &Bottle) -> bool {
        matches!(message.get(0), Some(Value::String(name)) if name.as_str().is_some_and(camera_thrift_calls::is_name))
    }

    /// Reads a message of either wire version.
    pub fn parse(message: &Bottle) -> Result<Self, Malformed> {
        match Self::is_call(message) {
            true => camera_thrift_calls::parse(message),
            false => camera_vocab_requests::parse(message),
        }
    }
}

/// A whole number of 32 bits.
pub(super) fn integer(value: &Value) -> Option<i32> {
    let number = crate::control_board::messages::float(value)?;
    let whole =
        number.fract() == 0.0 && (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&number);
    whole.then_some(number as i32)
}

/// Parses a truth value of either wire version: a word, or a number.
pub(super) fn flag(value: &Value) -> Option<bool> {
    match value {
        Value::Int8(_) | Value::Int16(_) | Value::Int32(_) | Value::Int64(_) => {
            Some(value.as_i64()? != 0)
        }
        Value::Vocab32(_) => crate::control_board::messages::read_flag(value),
        _ => None,
    }
}
