//! What is known of a port beside its address.

use std::collections::BTreeMap;

use yarp_wire::name_service::plain_text;
use yarp_wire::{Bottle, Value};

use super::limits::{self, Refusal};

/// The properties of one port: lists of texts by key.
#[derive(Debug, Default)]
pub(super) struct Properties(BTreeMap<String, Vec<String>>);

impl Properties {
    /// Replaces the values of `key`; none leaves the property empty.
    ///
    /// Values are kept sorted by their bytes, each as often as it came: stock 3.5.0 answers
    /// `set /a k z y x z y a` with `a x y y z z`.
    pub(super) fn set(&mut self, key: &str, values: &[String]) -> Result<(), Refusal> {
        let others = self.0.iter().filter(|(other, _)| *other != key);
        let others: usize = others.map(|(key, values)| size(key, values)).sum();
        if others + size(key, values) > limits::PROPERTIES {
            return Err(Refusal::Full {
                what: "bytes of properties per port",
                limit: limits::PROPERTIES,
            });
        }
        let mut values = values.to_vec();
        values.sort_unstable();
        if values.is_empty() {
            self.0.remove(key);
        } else {
            self.0.insert(key.to_owned(), values);
        }
        Ok(())
    }

    /// The values of `key`, sorted.
    pub(super) fn get(&self, key: &str) -> &[String] {
        self.0.get(key).map_or(&[], Vec::as_slice)
    }

    pub(super) fn has(&self, key: &str, value: &str) -> bool {
        self.get(key).iter().any(|held| held == value)
    }

    /// The line `port NAME property KEY = V...`.
    pub(super) fn line(&self, name: &str, key: &str) -> String {
        let mut line = format!("port {} property {} =", plain_text(name), plain_text(key));
        for value in self.get(key) {
            line.push(' ');
            line.push_str(&plain_text(value));
        }
        line
    }

    /// The values as `bot get` answers them.
    pub(super) fn bottle(&self, key: &str) -> Bottle {
        self.get(key)
            .iter()
            .filter_map(|text| parsed(text))
            .collect()
    }
}

/// What a property costs; every value counts some bytes more than its text.
fn size(key: &str, values: &[String]) -> usize {
    let one = |text: &str| text.len() + 32;
    one(key) + values.iter().map(|value| one(value)).sum::<usize>()
}

/// The value that a stored text stands for.
///
/// Stock 3.5.0 stores text only and reads it again as one value: `5` is a number, `(a b)` a
/// list, `abc def` a string; an empty text is nothing.
fn parsed(text: &str) -> Option<Value> {
    if text.is_empty() {
        return None;
    }
    let items = Bottle::parse(text).map(Bottle::into_items);
    Some(match items.as_deref() {
        Ok([Value::String(_)]) => text.into(),
        Ok([value]) => value.clone(),
        _ => text.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn properties(key: &str, values: &[&str]) -> Properties {
        let mut properties = Properties::default();
        let values: Vec<_> = values.iter().map(|value| value.to_string()).collect();
        properties.set(key, &values).unwrap();
        properties
    }

    #[test]
    fn values_are_sorted_and_kept_as_often_as_they_came() {
        let held = properties("k", &["z", "y", "x", "z", "y", "a"]);
        assert_eq!(held.line("/a", "k"), "port /a property k = a x y y z z");
        assert_eq!(held.line("/a", "none"), "port /a property none =");
        assert_eq!(
            properties("k", &["", "b"]).line("/a", "k"),
            "port /a property k =  b"
        );
    }

    /// Answers of stock 3.5.0.
    #[test]
    fn values_are_read_again_for_programs() {
        let held = properties("k", &["5", "abc def", "(a b)", "[vo]", "true", ""]);
        assert_eq!(
            held.bottle("k").to_string(),
            r#"(a b) 5 [vo] "abc def" true"#
        );
        let held = properties("k", &["1 (2 3)", "1.0", "a \"quoted\" b", "x,"]);
        let expected = r#""1 (2 3)" 1.0 "a \"quoted\" b" "x,""#;
        assert_eq!(held.bottle("k").to_string(), expected);
    }

    #[test]
    fn one_port_cannot_fill_the_server() {
        let mut held = Properties::default();
        let value = ["x".repeat(1000)];
        let refused = (0..1000).find_map(|key| held.set(&key.to_string(), &value).err());
        assert!(matches!(refused, Some(Refusal::Full { .. })));
        held.set("0", &value).unwrap();
    }
}
