//! The content of a message as it came.

use bytes::Bytes;

use crate::bottle::{Bottle, DecodeError, detect};
use crate::dialect::Dialect;
use crate::limits::Limits;

/// Which form a payload came in.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Form {
    /// Binary, most likely of this generation.
    Binary(Dialect),
    /// The text of a bottle.
    Text,
}

/// The content of a message, unread.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Payload {
    bytes: Bytes,
    form: Form,
}

impl Payload {
    /// A payload of these bytes.
    pub const fn new(bytes: Bytes, form: Form) -> Self {
        Self { bytes, form }
    }

    /// The bytes as they came.
    pub fn bytes(&self) -> &Bytes {
        &self.bytes
    }

    /// The form they came in.
    pub fn form(&self) -> Form {
        self.form
    }

    /// The generation of the bytes: what they betray, else what the connection assumes.
    pub fn dialect(&self) -> Dialect {
        match self.form {
            Form::Text => Dialect::V3,
            Form::Binary(assumed) => detect(&self.bytes, Limits::DEFAULT).unwrap_or(assumed),
        }
    }

    /// The content as a bottle.
    pub fn to_bottle(&self) -> Result<Bottle, DecodeError> {
        match self.form {
            Form::Binary(assumed) => {
                Bottle::decode_any(&self.bytes, assumed, Limits::DEFAULT).map(|(bottle, _)| bottle)
            }
            Form::Text => Bottle::parse_bytes(&self.bytes).map_err(|_| DecodeError::TooDeep {
                limit: Limits::DEFAULT.depth,
            }),
        }
    }

    /// The content in binary: as it came, or translated from text.
    pub fn to_binary(&self, dialect: Dialect) -> Result<Bytes, DecodeError> {
        match self.form {
            Form::Binary(_) => Ok(self.bytes.clone()),
            Form::Text => Ok(self.to_bottle()?.encode(dialect)),
        }
    }
}
