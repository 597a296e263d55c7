//! Properties of registered ports.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use yarp_wire::name_service::plain_text;
use yarp_wire::{Bottle, Value};

use super::memory_budget::{Account, Charge, SLOT_COST, text_cost, values_cost};
use super::registry_limits::{self, Refusal};

/// List of texts that many ports may share.
pub(super) type Values = Arc<[String]>;

/// Properties of one port: lists of texts by key, few enough for a linear search.
#[derive(Debug, Default)]
pub(super) struct Properties(Vec<Slot>);

/// One property.
#[derive(Debug)]
struct Slot {
    key: Arc<str>,
    values: Values,
    /// Charge for the property, unless the address that registered the port pays for it.
    charge: Option<Box<Charge>>,
}

/// Keys and values that are held, each once: the ports of one machine say mostly the same.
///
/// The first holder of a key or a value pays for it.
#[derive(Debug, Default)]
pub(super) struct Pool {
    keys: HashMap<Arc<str>, Charge>,
    values: HashMap<Values, Charge>,
    /// Number of values that were returned while another holder kept them.
    unused: usize,
}

impl Pool {
    fn key(&mut self, account: &Account, key: &str) -> Result<Arc<str>, Refusal> {
        if let Some((held, _)) = self.keys.get_key_value(key) {
            return Ok(held.clone());
        }
        let charge = self.charge(account, text_cost([key]))?;
        let key = Arc::from(key);
        prune(&mut self.keys);
        self.keys.insert(Arc::clone(&key), charge);
        Ok(key)
    }

    fn values(&mut self, account: &Account, values: Vec<String>) -> Result<Values, Refusal> {
        if let Some((held, _)) = self.values.get_key_value(values.as_slice()) {
            return Ok(held.clone());
        }
        let charge = self.charge(account, values_cost(&values))?;
        let values = Values::from(values);
        prune(&mut self.values);
        self.values.insert(Arc::clone(&values), charge);
        Ok(values)
    }

    fn slot(
        &mut self,
        account: &Account,
        key: &str,
        values: Vec<String>,
        charge: Option<Box<Charge>>,
    ) -> Result<Slot, Refusal> {
        let values = self.values(account, values)?;
        match self.key(account, key) {
            Ok(key) => Ok(Slot {
                key,
                values,
                charge,
            }),
            Err(refusal) => {
                self.release_values(values);
                Err(refusal)
            }
        }
    }

    /// Charges `bytes`; before it is refused, what nobody holds any more is forgotten, if that is
    /// worth looking at everything.
    fn charge(&mut self, account: &Account, bytes: usize) -> Result<Charge, Refusal> {
        let charged = account.charge(bytes);
        if charged.is_ok() || self.unused <= self.values.len() / 64 {
            return charged;
        }
        self.unused = 0;
        self.keys.retain(|key, _| Arc::strong_count(key) > 1);
        self.values
            .retain(|values, _| Arc::strong_count(values) > 1);
        account.charge(bytes)
    }

    fn release(&mut self, slot: Slot) {
        self.release_values(slot.values);
        // The pool itself has the other one.
        if Arc::strong_count(&slot.key) == 2 {
            self.keys.remove(&slot.key);
        }
    }

    fn release_values(&mut self, values: Values) {
        match Arc::strong_count(&values) {
            2 => drop(self.values.remove(&values)),
            // Perhaps a change that is being kept is the last to hold them.
            _ => self.unused += 1,
        }
    }
}

/// Removes entries that no port uses; runs whenever the set would have to grow.
fn prune<T: ?Sized + Eq + std::hash::Hash>(held: &mut HashMap<Arc<T>, Charge>) {
    if held.len() == held.capacity() {
        held.retain(|one, _| Arc::strong_count(one) > 1);
    }
}

impl Properties {
    /// Replaces the values of `key`; none leaves the property empty.
    ///
    /// Values are kept sorted by their bytes, each as often as it came: stock 3.5.0 answers
    /// `set /a k z y x z y a` with `a x y y z z`.
    ///
    /// `account` pays for what is new, `port` for the place among the properties if it belongs to the
    /// same address.
    pub(super) fn set(
        &mut self,
        pool: &mut Pool,
        account: &Account,
        port: &mut Charge,
        key: &str,
        values: &[String],
    ) -> Result<(), Refusal> {
        let others = self.0.iter().filter(|slot| &*slot.key != key);
        let others: usize = others.map(|slot| size(&slot.key, &slot.values)).sum();
        if others + size(key, values) > registry_limits::MAX_PROPERTY_BYTES {
            return Err(Refusal::Full {
                what: "bytes of properties per port",
                limit: registry_limits::MAX_PROPERTY_BYTES,
            });
        }
        let mut values = values.to_vec();
        values.sort_unstable();
        let held = self.0.iter().position(|slot| &*slot.key == key);
        match (held, values.is_empty()) {
            (Some(index), true) => {
                let slot = self.0.swap_remove(index);
                if slot.charge.is_none() {
                    port.shrink(SLOT_COST);
                }
                pool.release(slot);
            }
            (Some(index), false) => {
                let values = pool.values(account, values)?;
                let before = std::mem::replace(&mut self.0[index].values, values);
                pool.release_values(before);
            }
            (None, true) => {}
            (None, false) => {
                let charge = match account.pays(port) {
                    true => {
                        port.grow(account, SLOT_COST)?;
                        None
                    }
                    false => Some(Box::new(account.charge(SLOT_COST)?)),
                };
                let is_port = charge.is_none();
                let slot = pool.slot(account, key, values, charge);
                if slot.is_err() && is_port {
                    port.shrink(SLOT_COST);
                }
                self.0.reserve_exact(1);
                self.0.push(slot?);
            }
        }
        Ok(())
    }

    /// Gives everything back, before the port goes.
    pub(super) fn clear(&mut self, pool: &mut Pool, port: &mut Charge) {
        for slot in self.0.drain(..) {
            if slot.charge.is_none() {
                port.shrink(SLOT_COST);
            }
            pool.release(slot);
        }
    }

    /// Returns the values of `key`, sorted.
    pub(super) fn get(&self, key: &str) -> &[String] {
        let held = self.0.iter().find(|slot| &*slot.key == key);
        held.map_or(&[], |slot| &slot.values)
    }

    /// Returns the shared values of `key`.
    pub(super) fn shared(&self, key: &str) -> Values {
        let held = self.0.iter().find(|slot| &*slot.key == key);
        held.map_or_else(|| Values::from([]), |slot| slot.values.clone())
    }

    /// Returns a copy of all properties.
    pub(super) fn all(&self) -> BTreeMap<String, Vec<String>> {
        let all = self.0.iter();
        all.map(|slot| ((*slot.key).to_owned(), slot.values.to_vec()))
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
    use crate::registry::registry_limits::Capacity;

    /// One port, and what it pays with.
    struct One {
        account: Account,
        charge: Charge,
        held: Properties,
    }

    impl One {
        fn of(account: &Account) -> Self {
            Self {
                account: account.clone(),
                charge: account.charge_name(0).unwrap(),
                held: Properties::default(),
            }
        }

        fn new() -> Self {
            Self::of(&Account::new(Capacity::default()))
        }

        fn set(&mut self, pool: &mut Pool, key: &str, values: &[String]) -> Result<(), Refusal> {
            let Self {
                account,
                charge,
                held,
            } = self;
            held.set(pool, account, charge, key, values)
        }
    }

    fn properties(key: &str, values: &[&str]) -> Properties {
        let mut one = One::new();
        let values: Vec<_> = values.iter().map(|value| value.to_string()).collect();
        one.set(&mut Pool::default(), key, &values).unwrap();
        one.held
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
        let mut held = One::new();
        let mut pool = Pool::default();
        let value = ["x".repeat(1000)];
        let refused = (0..1000).find_map(|key| held.set(&mut pool, &key.to_string(), &value).err());
        assert!(matches!(refused, Some(Refusal::Full { .. })));
        held.set(&mut pool, "0", &value).unwrap();
    }

    #[test]
    fn shared_values_are_interned() {
        let mut pool = Pool::default();
        let account = Account::new(Capacity::default());
        let mut ports: Vec<One> = Vec::new();
        for index in 0..1000 {
            let mut port = One::of(&account);
            let carriers = ["tcp".to_owned(), "udp".to_owned()];
            port.set(&mut pool, "offers", &carriers).unwrap();
            port.set(&mut pool, "process", &[index.to_string()])
                .unwrap();
            ports.push(port);
        }
        assert_eq!((pool.keys.len(), pool.values.len()), (2, 1001));
        ports.clear();
        // Who forgets to give something back has it forgotten when the sets grow.
        for index in 0..10_000 {
            let mut port = One::of(&account);
            port.set(&mut pool, "process", &[index.to_string()])
                .unwrap();
        }
        assert!(pool.values.len() < 2500, "{} lists", pool.values.len());
    }

    /// A list that many ports have in common is paid for once, and not for longer than it is held.
    #[test]
    fn what_is_given_back_can_be_held_again() {
        let account = Account::new(Capacity {
            memory: 6000,
            ..Capacity::default()
        });
        let mut pool = Pool::default();
        let text = ["x".repeat(1000)];
        let mut ports: Vec<_> = (0..8).map(|_| One::of(&account)).collect();
        for port in &mut ports {
            port.set(&mut pool, "key", &text).unwrap();
        }
        let mut full = One::of(&account);
        let others = |index: usize| [format!("{index}{}", "y".repeat(1000))];
        let refused = (0..8).find_map(|index| full.set(&mut pool, "k", &others(index)).err());
        assert_eq!(refused, None, "a value is replaced, not added");
        let refused = (0..8).find_map(|index| {
            let key = index.to_string();
            full.set(&mut pool, &key, &others(index)).err()
        });
        assert!(matches!(refused, Some(Refusal::Full { .. })), "{refused:?}");
        for port in &mut ports {
            port.held.clear(&mut pool, &mut port.charge);
        }
        full.set(&mut pool, "k", &[]).unwrap();
        full.set(&mut pool, "another", &others(9)).unwrap();
        full.held.clear(&mut pool, &mut full.charge);
        assert!(pool.keys.is_empty() && pool.values.is_empty());
        let everything = account.charge(6000);
        assert!(everything.is_ok(), "{everything:?}");
    }
}
