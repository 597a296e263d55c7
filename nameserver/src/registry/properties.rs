//! Properties of registered ports.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

use yarp_wire::name_service::plain_text;
use yarp_wire::{Bottle, Value};

use super::registry_limits::{self, Refusal};

/// List of texts that many ports may share.
pub(super) type Values = Arc<[String]>;

/// Properties of one port: lists of texts by key, few enough for a linear search.
#[derive(Clone, Debug, Default)]
pub(super) struct Properties(Vec<(Arc<str>, Values)>);

/// Interned keys and values: the ports of one machine have mostly the same.
#[derive(Debug, Default)]
pub(super) struct Pool {
    keys: HashSet<Arc<str>>,
    values: HashSet<Values>,
}

impl Pool {
    fn key(&mut self, key: &str) -> Arc<str> {
        if let Some(held) = self.keys.get(key) {
            return held.clone();
        }
        let key = Arc::from(key);
        prune(&mut self.keys);
        self.keys.insert(Arc::clone(&key));
        key
    }

    fn values(&mut self, values: Vec<String>) -> Values {
        if let Some(held) = self.values.get(values.as_slice()) {
            return held.clone();
        }
        let values = Values::from(values);
        prune(&mut self.values);
        self.values.insert(Arc::clone(&values));
        values
    }
}

/// Removes entries that no port uses; runs whenever the set would have to grow.
fn prune<T: ?Sized + Eq + std::hash::Hash>(held: &mut HashSet<Arc<T>>) {
    if held.len() == held.capacity() {
        held.retain(|one| Arc::strong_count(one) > 1);
    }
}

impl Properties {
    /// Replaces the values of `key`; no values remove the property.
    ///
    /// Values are sorted by their bytes, with duplicates: stock 3.5.0 answers `set /a k z y x z y
    /// a` with `a x y y z z`.
    pub(super) fn set(
        &mut self,
        pool: &mut Pool,
        key: &str,
        values: &[String],
    ) -> Result<(), Refusal> {
        let others = self.0.iter().filter(|(other, _)| &**other != key);
        let others: usize = others.map(|(key, values)| size(key, values)).sum();
        if others + size(key, values) > registry_limits::MAX_PROPERTY_BYTES {
            return Err(Refusal::Full {
                what: "bytes of properties per port",
                limit: registry_limits::MAX_PROPERTY_BYTES,
            });
        }
        let mut values = values.to_vec();
        values.sort_unstable();
        let held = self.0.iter().position(|(other, _)| &**other == key);
        match (held, values.is_empty()) {
            (Some(index), true) => drop(self.0.swap_remove(index)),
            (Some(index), false) => self.0[index].1 = pool.values(values),
            (None, true) => {}
            (None, false) => {
                self.0.reserve_exact(1);
                self.0.push((pool.key(key), pool.values(values)));
            }
        }
        Ok(())
    }

    /// Returns the values of `key`, sorted.
    pub(super) fn get(&self, key: &str) -> &[String] {
        let held = self.0.iter().find(|(held, _)| &**held == key);
        held.map_or(&[], |(_, values)| values)
    }

    /// Returns the shared values of `key`.
    pub(super) fn shared(&self, key: &str) -> Values {
        let held = self.0.iter().find(|(held, _)| &**held == key);
        held.map_or_else(|| Values::from([]), |(_, values)| values.clone())
    }

    /// Returns a copy of all properties.
    pub(super) fn all(&self) -> BTreeMap<String, Vec<String>> {
        let all = self.0.iter();
        all.map(|(key, values)| ((**key).to_owned(), values.to_vec()))
            .collect()
    }

    pub(super) fn has(&self, key: &str, value: &str) -> bool {
        self.get(key).iter().any(|held| held == value)
    }

    /// Returns the line `port NAME property KEY = V...`.
    pub(super) fn line(&self, name: &str, key: &str) -> String {
        let mut line = format!("port {} property {} =", plain_text(name), plain_text(key));
        for value in self.get(key) {
            line.push(' ');
            line.push_str(&plain_text(value));
        }
        line
    }

    /// Returns the values in the form in which `bot get` answers them.
    pub(super) fn bottle(&self, key: &str) -> Bottle {
        self.get(key)
            .iter()
            .filter_map(|text| parsed(text))
            .collect()
    }
}

/// Returns the size of a property; every value counts some bytes more than its text.
fn size(key: &str, values: &[String]) -> usize {
    let one = |text: &str| text.len() + 32;
    one(key) + values.iter().map(|value| one(value)).sum::<usize>()
}

/// Parses the value that a stored text represents.
///
/// Stock 3.5.0 stores text only and parses it as one value: `5` is a number, `(a b)` a list, `abc
/// def` a string; an empty text is no value.
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
        properties.set(&mut Pool::default(), key, &values).unwrap();
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
    fn stored_texts_are_parsed_as_values() {
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
        let mut pool = Pool::default();
        let value = ["x".repeat(1000)];
        let refused = (0..1000).find_map(|key| held.set(&mut pool, &key.to_string(), &value).err());
        assert!(matches!(refused, Some(Refusal::Full { .. })));
        held.set(&mut pool, "0", &value).unwrap();
    }

    #[test]
    fn shared_values_are_interned() {
        let mut pool = Pool::default();
        let mut ports: Vec<Properties> = Vec::new();
        for index in 0..1000 {
            let mut port = Properties::default();
            let carriers = ["tcp".to_owned(), "udp".to_owned()];
            port.set(&mut pool, "offers", &carriers).unwrap();
            port.set(&mut pool, "process", &[index.to_string()])
                .unwrap();
            ports.push(port);
        }
        assert_eq!((pool.keys.len(), pool.values.len()), (2, 1001));
        ports.clear();
        for index in 0..10_000 {
            let mut port = Properties::default();
            port.set(&mut pool, "process", &[index.to_string()])
                .unwrap();
        }
        assert!(pool.values.len() < 2500, "{} lists", pool.values.len());
    }
}
