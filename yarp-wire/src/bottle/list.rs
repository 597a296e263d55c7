//! The list of values.

use super::Value;

/// A list of [`Value`]s, the message every stock tool reads.
///
/// ```
/// use yarp_wire::{Bottle, Vocab32};
/// let bottle = Bottle::from_iter(["hello".into(), 5.into(), Vocab32::OK.into()]);
/// assert_eq!(bottle.to_string(), "hello 5 [ok]");
/// assert_eq!(Bottle::parse("hello 5 [ok]").unwrap(), bottle);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bottle {
    items: Vec<Value>,
}

impl Bottle {
    /// The empty bottle.
    pub const fn new() -> Self {
        Self { items: Vec::new() }
    }

    /// Creates a bottle of one item.
    pub fn of(value: impl Into<Value>) -> Self {
        Self {
            items: vec![value.into()],
        }
    }

    /// Appends an item.
    pub fn push(&mut self, value: impl Into<Value>) {
        self.items.push(value.into());
    }

    /// Appends one item and returns the bottle, for building in one expression.
    pub fn with(mut self, value: impl Into<Value>) -> Self {
        self.push(value);
        self
    }

    /// Returns item `index`.
    pub fn get(&self, index: usize) -> Option<&Value> {
        self.items.get(index)
    }

    /// Returns the number of items.
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Returns whether there are no items.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Iterates over the items in order.
    pub fn iter(&self) -> std::slice::Iter<'_, Value> {
        self.items.iter()
    }

    /// Returns the items as a slice.
    pub fn as_slice(&self) -> &[Value] {
        &self.items
    }

    /// Returns the items by value.
    pub fn into_items(self) -> Vec<Value> {
        self.items
    }

    /// Finds the value of `key` as stock's `find` does.
    ///
    /// The first item equal to the key decides: inside a list that starts with the key it is the
    /// list's second item, otherwise the item that follows.
    pub fn find(&self, key: &str) -> Option<&Value> {
        let matches = |value: &Value| match value {
            Value::String(text) => text == key,
            Value::Vocab32(vocab) => vocab.bytes().eq(key.bytes()),
            Value::Vocab64(vocab) => vocab.bytes().eq(key.bytes()),
            _ => false,
        };
        for (index, item) in self.items.iter().enumerate() {
            if let Some(list) = item.as_list() {
                if list.get(0).is_some_and(matches) {
                    return list.get(1);
                }
            } else if matches(item) {
                return self.items.get(index + 1);
            }
        }
        None
    }

    /// Returns the whole nested list that starts with `key`.
    pub fn find_group(&self, key: &str) -> Option<&Bottle> {
        self.items.iter().filter_map(Value::as_list).find(|list| {
            list.get(0)
                .is_some_and(|first| first.to_plain_string() == key)
        })
    }
}

impl FromIterator<Value> for Bottle {
    fn from_iter<I: IntoIterator<Item = Value>>(items: I) -> Self {
        Self {
            items: items.into_iter().collect(),
        }
    }
}

impl From<Vec<Value>> for Bottle {
    fn from(items: Vec<Value>) -> Self {
        Self { items }
    }
}

impl Extend<Value> for Bottle {
    fn extend<I: IntoIterator<Item = Value>>(&mut self, items: I) {
        self.items.extend(items);
    }
}

impl IntoIterator for Bottle {
    type Item = Value;
    type IntoIter = std::vec::IntoIter<Value>;

    fn into_iter(self) -> Self::IntoIter {
        self.items.into_iter()
    }
}

impl<'a> IntoIterator for &'a Bottle {
    type Item = &'a Value;
    type IntoIter = std::slice::Iter<'a, Value>;

    fn into_iter(self) -> Self::IntoIter {
        self.items.iter()
    }
}
