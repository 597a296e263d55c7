//! Messages of your own.

use bytes::Bytes;

use crate::bottle::{Bottle, Text, Value};
use crate::vocab::{Vocab32, Vocab64};

/// A struct that travels as the list of its fields. [`wire_struct!`](crate::wire_struct)
/// declares one.
pub trait Record: Sized {
    /// Name and fields, for errors.
    const SHAPE: &'static str;

    /// Returns the fields in order.
    fn to_bottle(&self) -> Bottle;

    /// Returns the record with these fields, or `None` if their number or kinds are others.
    fn from_bottle(bottle: &Bottle) -> Option<Self>;
}

/// A type that can be a field of a [`Record`].
///
/// | field | value | also read from |
/// | --- | --- | --- |
/// | `bool` | `true`, `false` | any number; 0 is false |
/// | `i8` to `i64` | integer of that width | any integer that fits |
/// | `f32`, `f64` | float of that width | any number |
/// | `String`, [`Text`] | string | |
/// | [`Vocab32`], [`Vocab64`] | word | the other width, if it fits |
/// | [`Bytes`] | blob | |
/// | `Vec` of fields, [`Bottle`], another record | list | |
/// | [`Value`] | anything | |
///
/// The leniency is for typed input: `yarp write` sends `5` as an integer, and text has no widths.
pub trait Field: Sized {
    /// Returns the field as one value.
    fn to_value(&self) -> Value;

    /// Returns the field of this value, or `None` if it is of another kind.
    fn from_value(value: &Value) -> Option<Self>;
}

/// Declares structs that travel as the list of their fields, in their order.
///
/// Stock reads such a message as a bottle, and as the struct of the same fields that its interface
/// compiler generates. A list of another length, or with a value of another kind, is refused with
/// [`DecodeError::Shape`](crate::bottle::DecodeError::Shape).
///
/// ```
/// use yarp_wire::message::{ReadObject, WireObject};
/// use yarp_wire::typed::Record;
/// use yarp_wire::{Bottle, WireVersion, wire_struct};
///
/// wire_struct! {
///     /// How to take hold of something.
///     #[derive(Clone, Debug, PartialEq)]
///     pub struct Grasp {
///         /// What to take.
///         pub name: String,
///         /// Newtons.
///         pub force: f64,
///     }
/// }
///
/// let grasp = Grasp { name: "cup".into(), force: 2.5 };
/// assert_eq!(grasp.to_bottle().to_string(), "cup 2.5");
/// let typed = Bottle::parse("cup 3").unwrap().encode(WireVersion::V3);
/// assert_eq!(Grasp::read_binary(&typed, WireVersion::V3).unwrap().force, 3.0);
/// ```
#[macro_export]
macro_rules! wire_struct {
    ($(
        $(#[$attribute:meta])*
        $visibility:vis struct $name:ident {
            $($(#[$field_attribute:meta])* $field_visibility:vis $field:ident: $type:ty),+ $(,)?
        }
    )+) => {$(
        $(#[$attribute])*
        $visibility struct $name {
            $($(#[$field_attribute])* $field_visibility $field: $type,)+
        }

        impl $crate::typed::Record for $name {
            const SHAPE: &'static str = concat!(
                stringify!($name),
                $(" ", stringify!($field), ": ", stringify!($type),)+
            );

            fn to_bottle(&self) -> $crate::Bottle {
                $crate::Bottle::new()$(.with($crate::typed::Field::to_value(&self.$field)))+
            }

            fn from_bottle(bottle: &$crate::Bottle) -> Option<Self> {
                let mut items = bottle.iter();
                let record = Self {
                    $($field: $crate::typed::Field::from_value(items.next()?)?,)+
                };
                items.next().is_none().then_some(record)
            }
        }

        $crate::wire_record!($name);
    )+};
}

/// Implements everything that a [`Record`] needs to travel: [`Field`], [`WireObject`](crate::message::WireObject),
/// [`ReadObject`](crate::message::ReadObject) and [`ReadPrefix`](crate::typed::ReadPrefix).
///
/// [`wire_struct!`](crate::wire_struct) and the derive macro of `yarp-client` use it; programs do not need it.
#[macro_export]
macro_rules! wire_record {
    ($name:ident) => {
        impl $crate::typed::Field for $name {
            fn to_value(&self) -> $crate::Value {
                $crate::Value::List($crate::typed::Record::to_bottle(self))
            }

            fn from_value(value: &$crate::Value) -> Option<Self> {
                $crate::typed::Record::from_bottle(value.as_list()?)
            }
        }

        impl $crate::message::WireObject for $name {
            fn write_binary(
                &self,
                out: &mut $crate::typed::private::BytesMut,
                wire_version: $crate::WireVersion,
            ) {
                $crate::typed::Record::to_bottle(self).encode_into(out, wire_version);
            }
        }

        impl $crate::typed::ReadPrefix for $name {
            fn take(
                bytes: &mut $crate::typed::private::Bytes,
                wire_version: $crate::WireVersion,
            ) -> Result<Self, $crate::bottle::DecodeError> {
                let bottle =
                    <$crate::Bottle as $crate::typed::ReadPrefix>::take(bytes, wire_version)?;
                $crate::typed::Record::from_bottle(&bottle).ok_or(
                    $crate::bottle::DecodeError::Shape {
                        expected: <Self as $crate::typed::Record>::SHAPE,
                    },
                )
            }
        }

        impl $crate::message::ReadObject for $name {
            fn read_binary(
                bytes: &$crate::typed::private::Bytes,
                wire_version: $crate::WireVersion,
            ) -> Result<Self, $crate::bottle::DecodeError> {
                $crate::typed::read_whole(bytes, wire_version)
            }

            fn max_read_size(payload: &$crate::message::Payload) -> usize {
                payload.max_bottle_size()
            }
        }
    };
}

macro_rules! integers {
    ($($type:ty),*) => {$(
        impl Field for $type {
            fn to_value(&self) -> Value {
                (*self).into()
            }

            fn from_value(value: &Value) -> Option<Self> {
                match value {
                    Value::Int8(_) | Value::Int16(_) | Value::Int32(_) | Value::Int64(_) => {
                        value.as_i64()?.try_into().ok()
                    }
                    _ => None,
                }
            }
        }
    )*};
}

integers!(i8, i16, i32, i64);

/// A field whose value is of one variant, which has a getter.
macro_rules! fields {
    ($($type:ty, $value:ident => $read:expr;)*) => {$(
        impl Field for $type {
            fn to_value(&self) -> Value {
                self.clone().into()
            }

            fn from_value($value: &Value) -> Option<Self> {
                $read
            }
        }
    )*};
}

fields! {
    f64, value => number(value);
    f32, value => number(value).map(|number| number as f32);
    String, value => value.as_str().map(str::to_owned);
    Bytes, value => value.as_blob().cloned();
    Bottle, value => value.as_list().cloned();
    Text, value => match value {
        Value::String(text) => Some(text.clone()),
        _ => None,
    };
    Vocab32, value => match value {
        Value::Vocab32(word) => Some(*word),
        Value::Vocab64(word) => u32::try_from(word.code()).ok().map(Vocab32::from_code),
        _ => None,
    };
    Vocab64, value => match value {
        Value::Vocab32(word) => Some(Vocab64::from_code(word.code().into())),
        Value::Vocab64(word) => Some(*word),
        _ => None,
    };
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Vocab32(_) | Value::Vocab64(_) => None,
        other => other.as_f64(),
    }
}

impl Field for bool {
    fn to_value(&self) -> Value {
        Value::bool(*self)
    }

    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Vocab32(Vocab32::TRUE) => Some(true),
            Value::Vocab32(Vocab32::FALSE) => Some(false),
            other => number(other).map(|number| number != 0.0),
        }
    }
}

impl Field for Value {
    fn to_value(&self) -> Value {
        self.clone()
    }

    fn from_value(value: &Value) -> Option<Self> {
        Some(value.clone())
    }
}

impl<T: Field> Field for Vec<T> {
    fn to_value(&self) -> Value {
        Value::List(self.iter().map(Field::to_value).collect())
    }

    fn from_value(value: &Value) -> Option<Self> {
        value.as_list()?.iter().map(T::from_value).collect()
    }
}
