//! The words of a request, read as stock reads them.

use crate::{Bottle, Value};

use super::registering::LeaseHolder;

/// Any value as the text that stock stores; the bytes of a blob without their braces.
pub(super) fn text_of(value: &Value) -> String {
    match value.as_blob() {
        Some(bytes) => {
            let bytes: Vec<_> = bytes.iter().map(u8::to_string).collect();
            bytes.join(" ")
        }
        None => value.to_plain_string(),
    }
}

/// The words of one request, the command itself first.
pub(super) struct Arguments<'a>(pub(super) &'a [&'a Value]);

impl Arguments<'_> {
    /// A name: stock takes strings and vocabs, and reads an empty name from anything else.
    pub(super) fn name(&self, index: usize) -> String {
        match self.0.get(index) {
            Some(value @ (Value::String(_) | Value::Vocab32(_) | Value::Vocab64(_))) => {
                value.to_plain_string()
            }
            _ => String::new(),
        }
    }

    /// Anything, as text; empty if missing.
    pub(super) fn text(&self, index: usize) -> String {
        self.0
            .get(index)
            .map_or_else(String::new, |value| text_of(value))
    }

    /// A field of `register`: `...` and missing leave the choice to the server.
    pub(super) fn optional_text(&self, index: usize) -> Option<String> {
        let text = self.text(index);
        (!text.is_empty() && text != super::SERVER_CHOOSES).then_some(text)
    }

    /// The number of `register`. Stock chooses one also for 0, -1 and words.
    pub(super) fn number(&self, index: usize) -> Option<i64> {
        let number = match self.0.get(index)? {
            Value::String(_) => None,
            value => value.as_i64(),
        };
        number.filter(|number| !matches!(number, 0 | -1))
    }

    /// The ports of `lease`; what is no port is left out.
    pub(super) fn holders(&self) -> Vec<LeaseHolder> {
        let starts = (1..self.0.len()).step_by(3);
        let holders = starts.filter_map(|index| {
            Some(LeaseHolder {
                name: self.name(index),
                host: self.text(index + 1),
                number: self.number(index + 2)?.try_into().ok()?,
            })
        });
        holders.collect()
    }

    pub(super) fn rest(&self, from: usize) -> Bottle {
        self.0
            .iter()
            .skip(from)
            .map(|value| (*value).clone())
            .collect()
    }
}
