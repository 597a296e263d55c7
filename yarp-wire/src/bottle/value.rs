//! One value.

use std::borrow::Cow;
use std::fmt;

use bytes::Bytes;

use super::Bottle;
use crate::vocab::{Vocab32, Vocab64};

/// One item of a [`Bottle`].
///
/// The numeric getters convert as stock readers do: any number, or the code of a vocab, answers
/// for any other.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Value {
    /// 8-bit integer; never comes from text.
    Int8(i8),
    /// 16-bit integer; never comes from text.
    Int16(i16),
    /// 32-bit integer.
    Int32(i32),
    /// 64-bit integer.
    Int64(i64),
    /// Single precision number; never comes from text.
    Float32(f32),
    /// Double precision number.
    Float64(f64),
    /// Word of up to four characters; also `true` and `false`.
    Vocab32(Vocab32),
    /// Word of up to eight characters (YARP 4.0 only).
    Vocab64(Vocab64),
    /// Characters.
    String(Text),
    /// Raw bytes.
    Blob(Bytes),
    /// Nested list.
    List(Bottle),
    /// Property: a list of `(key value...)` lists, marked as such in the binary form.
    Dictionary(Bottle),
}

/// A string as it travels: bytes that are usually UTF-8 but need not be.
#[derive(Clone, Default, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct Text(Bytes);

impl Text {
    /// Returns the string if it is UTF-8.
    pub fn as_str(&self) -> Option<&str> {
        std::str::from_utf8(&self.0).ok()
    }

    /// Returns the string with anything that is not UTF-8 replaced.
    pub fn to_lossy(&self) -> Cow<'_, str> {
        String::from_utf8_lossy(&self.0)
    }

    /// Returns the bytes as they travel.
    pub fn as_bytes(&self) -> &[u8] {
        &self.0
    }
}

impl From<&str> for Text {
    fn from(text: &str) -> Self {
        Self(Bytes::copy_from_slice(text.as_bytes()))
    }
}

impl From<String> for Text {
    fn from(text: String) -> Self {
        Self(text.into())
    }
}

impl From<Bytes> for Text {
    fn from(bytes: Bytes) -> Self {
        Self(bytes)
    }
}

impl From<Vec<u8>> for Text {
    fn from(bytes: Vec<u8>) -> Self {
        Self(bytes.into())
    }
}

impl PartialEq<str> for Text {
    fn eq(&self, other: &str) -> bool {
        self.as_bytes() == other.as_bytes()
    }
}

impl PartialEq<&str> for Text {
    fn eq(&self, other: &&str) -> bool {
        self == *other
    }
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.to_lossy())
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.to_lossy(), f)
    }
}

impl Value {
    /// `true` or `false` as a vocab.
    pub const fn bool(value: bool) -> Self {
        Self::Vocab32(if value { Vocab32::TRUE } else { Vocab32::FALSE })
    }

    /// Returns the value as an integer, floats rounded towards zero, vocabs by their code.
    pub fn as_i64(&self) -> Option<i64> {
        Some(match self {
            Self::Int8(v) => i64::from(*v),
            Self::Int16(v) => i64::from(*v),
            Self::Int32(v) => i64::from(*v),
            Self::Int64(v) => *v,
            Self::Float32(v) => *v as i64,
            Self::Float64(v) => *v as i64,
            Self::Vocab32(v) => i64::from(v.code()),
            Self::Vocab64(v) => v.code() as i64,
            _ => return None,
        })
    }

    /// Returns the value as a 32-bit integer; larger values wrap, as in stock.
    pub fn as_i32(&self) -> Option<i32> {
        self.as_i64().map(|v| v as i32)
    }

    /// Returns the value as a double.
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Float32(v) => Some(f64::from(*v)),
            Self::Float64(v) => Some(*v),
            other => other.as_i64().map(|v| v as f64),
        }
    }

    /// Returns the string, if the value is one and is UTF-8.
    pub fn as_str(&self) -> Option<&str> {
        match self {
            Self::String(text) => text.as_str(),
            _ => None,
        }
    }

    /// Returns the value as a vocab: a vocab itself, an integer code, or the first four characters of a string.
    pub fn as_vocab(&self) -> Option<Vocab32> {
        match self {
            Self::Vocab32(v) => Some(*v),
            Self::Vocab64(v) => Some(v.truncated()),
            Self::Int32(v) => Some(Vocab32::from_code(*v as u32)),
            Self::String(text) => Some(Vocab32::from_bytes(text.as_bytes())),
            _ => None,
        }
    }

    /// Returns the nested list, also that of a dictionary.
    pub fn as_list(&self) -> Option<&Bottle> {
        match self {
            Self::List(list) | Self::Dictionary(list) => Some(list),
            _ => None,
        }
    }

    /// Returns the bytes of a blob.
    pub fn as_blob(&self) -> Option<&Bytes> {
        match self {
            Self::Blob(bytes) => Some(bytes),
            _ => None,
        }
    }

    /// Returns the text without quotes or brackets, like stock's `Value::toString`.
    ///
    /// A string gives its characters, a vocab its word, a list its items, a blob its bytes.
    pub fn to_plain_string(&self) -> String {
        match self {
            Self::String(text) => text.to_lossy().into_owned(),
            Self::Vocab32(Vocab32::TRUE) => "true".to_owned(),
            Self::Vocab32(Vocab32::FALSE) => "false".to_owned(),
            Self::Vocab32(v) => v.to_string(),
            Self::Vocab64(v) => v.to_string(),
            Self::List(list) | Self::Dictionary(list) => list.to_string(),
            Self::Blob(bytes) => {
                let numbers: Vec<String> = bytes.iter().map(u8::to_string).collect();
                numbers.join(" ")
            }
            number => number.to_string(),
        }
    }
}

macro_rules! from {
    ($($source:ty => $variant:ident),* $(,)?) => {$(
        impl From<$source> for Value {
            fn from(value: $source) -> Self {
                Self::$variant(value.into())
            }
        }
    )*};
}

from! {
    i8 => Int8,
    i16 => Int16,
    i32 => Int32,
    i64 => Int64,
    f32 => Float32,
    f64 => Float64,
    Vocab32 => Vocab32,
    Vocab64 => Vocab64,
    Text => String,
    &str => String,
    String => String,
    Bytes => Blob,
    Bottle => List,
}
