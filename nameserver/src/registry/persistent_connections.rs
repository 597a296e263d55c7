//! Connections that outlive their ports, and topics.

use std::collections::BTreeMap;

use yarp_wire::vocab::Vocab32;
use yarp_wire::{Bottle, Value};

use super::memory_budget::{Account, Charge, text_cost};
use super::registry_limits::{self, Refusal};

/// All persistent connections and topics.
///
/// A topic is a name between ports: all ports that write to it are connected to all ports that read
/// from it.
#[derive(Debug, Default)]
pub(super) struct PersistentConnections {
    /// Keyed by the bare names of source and destination, in the order of stock's listing.
    subscriptions: BTreeMap<(String, String), Subscription>,
    topics: BTreeMap<String, Topic>,
    topics_made: u64,
}

#[derive(Debug)]
struct Topic {
    /// Sequence number: stock lists topics in the order of their creation.
    order: u64,
    structure: String,
    _charge: Charge,
}

#[derive(Debug)]
struct Subscription {
    source: ConnectionEnd,
    destination: ConnectionEnd,
    mode: String,
    _charge: Charge,
}

/// One end of a subscription.
#[derive(Clone, Debug)]
pub(super) struct ConnectionEnd {
    /// Text as written: `udp://b`.
    text: String,
    carrier: Option<String>,
    /// Bare name: `/b`.
    pub(super) name: String,
}

impl ConnectionEnd {
    pub(super) fn parse(text: &str) -> Self {
        let (carrier, name) = split_carrier(text);
        Self {
            text: text.to_owned(),
            carrier: carrier.map(str::to_owned),
            name: name.to_owned(),
        }
    }

    /// Returns the text as written.
    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// Returns the carrier, if one was written.
    pub(super) fn carrier(&self) -> Option<&str> {
        self.carrier
            .as_deref()
            .filter(|carrier| *carrier != "topic")
    }

    pub(super) fn names_topic(&self) -> bool {
        self.carrier.as_deref() == Some("topic")
    }
}

/// Splits `CARRIER:/NAME`. The slash of `://` belongs to the name: `tcp://a` is `/a`, and stock
/// reads `tcp:/a` as `a`.
pub(super) fn split_carrier(text: &str) -> (Option<&str>, &str) {
    match text.split_once(":/") {
        Some((carrier, name)) if !carrier.is_empty() && !carrier.contains('/') => {
            (Some(carrier), name)
        }
        _ => (None, text),
    }
}

impl PersistentConnections {
    /// Adds a subscription, or replaces the one between the same two names; creates the topics that
    /// it names.
    pub(super) fn subscribe(
        &mut self,
        account: &Account,
        source: ConnectionEnd,
        destination: ConnectionEnd,
        mode: &str,
    ) -> Result<(), Refusal> {
        self.check(&source, &destination, mode)?;
        let topics = [&source, &destination].map(|end| end.names_topic().then(|| end.name.clone()));
        let mut new: Vec<String> = topics.into_iter().flatten().collect();
        new.retain(|name| !self.is_topic(name));
        let added = new
            .iter()
            .try_for_each(|name| self.add_topic(account, name, ""));
        let added = added.and_then(|()| self.insert(account, source, destination, mode));
        if added.is_err() {
            // A topic that is not stored would be lost at the next start.
            for name in &new {
                self.topics.remove(name);
            }
        }
        added
    }

    /// Restores a stored subscription. Topics are stored separately, and one that it names may have
    /// been removed since.
    pub(super) fn restore(
        &mut self,
        account: &Account,
        source: ConnectionEnd,
        destination: ConnectionEnd,
        mode: &str,
    ) -> Result<(), Refusal> {
        self.check(&source, &destination, mode)?;
        self.insert(account, source, destination, mode)
    }

    /// Checks that a subscription is within the limits and can be listed.
    fn check(
        &self,
        source: &ConnectionEnd,
        destination: &ConnectionEnd,
        mode: &str,
    ) -> Result<(), Refusal> {
        registry_limits::check_name(&source.name)?;
        registry_limits::check_name(&destination.name)?;
        for end in [source, destination] {
            if let Some(carrier) = &end.carrier {
                registry_limits::check_word("carrier", carrier)?;
            }
        }
        if !mode.is_empty() {
            registry_limits::check_word("mode", mode)?;
        }
        let key = (source.name.clone(), destination.name.clone());
        let full = self.subscriptions.len() >= registry_limits::MAX_SUBSCRIPTIONS;
        if full && !self.subscriptions.contains_key(&key) {
            return Err(Refusal::Full {
                what: "persistent connections",
                limit: registry_limits::MAX_SUBSCRIPTIONS,
            });
        }
        Ok(())
    }

    fn insert(
        &mut self,
        account: &Account,
        source: ConnectionEnd,
        destination: ConnectionEnd,
        mode: &str,
    ) -> Result<(), Refusal> {
        let key = (source.name.clone(), destination.name.clone());
        // Both names stand there twice, and with a carrier once more.
        let texts = [&source, &destination].map(|end| end.text.as_str());
        let charge = account.charge(3 * text_cost(texts) + mode.len())?;
        let subscription = Subscription {
            source,
            destination,
            mode: mode.to_owned(),
            _charge: charge,
        };
        self.subscriptions.insert(key, subscription);
        Ok(())
    }

    /// Removes the subscription between two names; returns true if it existed.
    pub(super) fn unsubscribe(
        &mut self,
        source: &ConnectionEnd,
        destination: &ConnectionEnd,
    ) -> bool {
        let key = (source.name.clone(), destination.name.clone());
        self.subscriptions.remove(&key).is_some()
    }

    /// Returns source and destination as written, and the mode, of the subscription between two
    /// bare names.
    pub(super) fn held(&self, source: &str, destination: &str) -> Option<(&str, &str, &str)> {
        let key = (source.to_owned(), destination.to_owned());
        let held = self.subscriptions.get(&key)?;
        Some((&held.source.text, &held.destination.text, &held.mode))
    }

    /// Removes the subscriptions that end with the port `name`: mode `from` if it writes, `to` if
    /// it reads. Returns the bare names of their ends.
    pub(super) fn remove_port(&mut self, name: &str) -> Vec<(String, String)> {
        let mut gone = Vec::new();
        self.subscriptions.retain(|(source, destination), held| {
            let from = held.mode == "from" && source == name;
            let to = held.mode == "to" && destination == name;
            if from || to {
                gone.push((source.clone(), destination.clone()));
            }
            !(from || to)
        });
        gone
    }

    /// Returns the pairs of ports to connect that involve `name`, a port or a topic, up to the
    /// limit of one request.
    pub(super) fn pairs(&self, name: &str) -> Vec<(&ConnectionEnd, &ConnectionEnd)> {
        let mut pairs = BTreeMap::new();
        for held in self.subscriptions.values() {
            if self.is_topic(&held.source.name) {
                continue;
            }
            if !self.is_topic(&held.destination.name) {
                if held.source.name == name || held.destination.name == name {
                    let key = (&held.source.name, &held.destination.name);
                    pairs.insert(key, (&held.source, &held.destination));
                }
                continue;
            }
            let topic = &held.destination.name;
            let concerned = topic == name || held.source.name == name;
            for reader in self.readers(topic) {
                if concerned || reader.name == name {
                    let key = (&held.source.name, &reader.name);
                    pairs.entry(key).or_insert((&held.source, reader));
                }
                if pairs.len() >= registry_limits::MAX_LINKS_PER_REQUEST {
                    return pairs.into_values().collect();
                }
            }
        }
        pairs.into_values().collect()
    }

    /// Returns the ports that read from a topic.
    fn readers<'a>(&'a self, topic: &'a str) -> impl Iterator<Item = &'a ConnectionEnd> {
        let from = (topic.to_owned(), String::new());
        let held = self.subscriptions.range(from..);
        held.take_while(move |((source, _), _)| source == topic)
            .map(|(_, held)| &held.destination)
            .filter(|end| !self.is_topic(&end.name))
    }

    pub(super) fn is_topic(&self, name: &str) -> bool {
        self.topics.contains_key(name)
    }

    /// Adds a topic; an existing topic keeps its structure unless a new one is given.
    pub(super) fn add_topic(
        &mut self,
        account: &Account,
        name: &str,
        structure: &str,
    ) -> Result<(), Refusal> {
        registry_limits::check_name(name)?;
        if structure.len() > registry_limits::MAX_DEFINITION_BYTES {
            return Err(Refusal::Full {
                what: "bytes of structure per topic",
                limit: registry_limits::MAX_DEFINITION_BYTES,
            });
        }
        if let Some(topic) = self.topics.get_mut(name) {
            if !structure.is_empty() {
                topic._charge = account.charge(text_cost([name, structure]))?;
                topic.structure = structure.to_owned();
            }
            return Ok(());
        }
        if self.topics.len() >= registry_limits::MAX_TOPICS {
            return Err(Refusal::Full {
                what: "topics",
                limit: registry_limits::MAX_TOPICS,
            });
        }
        let topic = Topic {
            order: self.topics_made,
            structure: structure.to_owned(),
            _charge: account.charge(text_cost([name, structure]))?,
        };
        self.topics_made += 1;
        self.topics.insert(name.to_owned(), topic);
        Ok(())
    }

    /// Removes a topic; returns true if it existed.
    pub(super) fn remove_topic(&mut self, name: &str) -> bool {
        self.topics.remove(name).is_some()
    }

    /// Returns the structure of a topic, if it exists.
    pub(super) fn structure(&self, name: &str) -> Option<&str> {
        let topic = self.topics.get(name)?;
        Some(&topic.structure)
    }

    /// Returns the answer to `topic`.
    pub(super) fn topics(&self) -> Bottle {
        let mut topics: Vec<_> = self.topics.iter().collect();
        topics.sort_by_key(|(_, topic)| topic.order);
        topics
            .into_iter()
            .map(|(name, _)| Value::from(name.as_str()))
            .collect()
    }

    /// Returns the answer to `subscribe [PORT]`.
    pub(super) fn listing(&self, port: &str) -> Bottle {
        let (_, port) = split_carrier(port);
        let mut bottle = Bottle::of("subscriptions");
        for held in self.subscriptions.values() {
            let ends = [&held.source, &held.destination];
            if port.is_empty() || ends.iter().any(|end| end.name == port) {
                bottle.push(self.describe(held));
            }
        }
        bottle
    }

    fn describe(&self, held: &Subscription) -> Bottle {
        let pair = |key: &str, text: &str| Bottle::of(key).with(text);
        let mut bottle = Bottle::of("subscription")
            .with(pair("src", &held.source.text))
            .with(pair("dest", &held.destination.text));
        if !held.mode.is_empty() {
            bottle.push(pair("mode", &held.mode));
        }
        let topics = [&held.source, &held.destination].map(|end| self.is_topic(&end.name));
        if topics != [false, false] {
            let flags = topics.map(i32::from);
            bottle.push(Bottle::of("topic").with(flags[0]).with(flags[1]));
        }
        bottle
    }
}

/// Returns `[ok]`, or `[fail]` with the reason, which stock omits.
pub(super) fn ok_or_fail(result: Result<(), Refusal>) -> Bottle {
    match result {
        Ok(()) => Bottle::of(Vocab32::OK),
        Err(refusal) => Bottle::of(Vocab32::FAIL).with(refusal.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::registry_limits::Capacity;

    fn account() -> Account {
        Account::new(Capacity::default())
    }

    fn with(subscriptions: &[(&str, &str)]) -> PersistentConnections {
        let mut held = PersistentConnections::default();
        for (source, destination) in subscriptions {
            held.subscribe(
                &account(),
                ConnectionEnd::parse(source),
                ConnectionEnd::parse(destination),
                "",
            )
            .unwrap();
        }
        held
    }

    #[track_caller]
    fn check_pairs(held: &PersistentConnections, name: &str, expected: &[(&str, &str)]) {
        let pairs = held.pairs(name);
        let pairs: Vec<_> = pairs
            .iter()
            .map(|(a, b)| (a.name.as_str(), b.name.as_str()))
            .collect();
        assert_eq!(pairs, expected, "{name}");
    }

    #[test]
    fn carriers_are_split_as_in_stock() {
        assert_eq!(split_carrier("tcp://a"), (Some("tcp"), "/a"));
        assert_eq!(split_carrier("tcp:/a"), (Some("tcp"), "a"));
        assert_eq!(split_carrier("tcp:///a"), (Some("tcp"), "//a"));
        assert_eq!(split_carrier("/a:/b"), (None, "/a:/b"));
        assert_eq!(split_carrier("://a"), (None, "://a"));
    }

    #[test]
    fn topics_join_writers_with_readers() {
        let held = with(&[
            ("/w1", "topic://t"),
            ("tcp://w2", "/t"),
            ("topic://t", "/r1"),
            ("topic://t", "udp://r2"),
            ("/w1", "/other"),
        ]);
        let all = [
            ("/w1", "/r1"),
            ("/w1", "/r2"),
            ("/w2", "/r1"),
            ("/w2", "/r2"),
        ];
        check_pairs(&held, "/t", &all);
        check_pairs(&held, "/w1", &[("/w1", "/other"), all[0], all[1]]);
        check_pairs(&held, "/r2", &[all[1], all[3]]);
        check_pairs(&held, "/other", &[("/w1", "/other")]);
        check_pairs(&held, "/nobody", &[]);
    }

    #[test]
    fn removed_topics_connect_no_ports() {
        let mut held = with(&[("/w", "topic://t"), ("topic://t", "/r")]);
        held.remove_topic("/t");
        check_pairs(&held, "/t", &[("/t", "/r"), ("/w", "/t")]);
        check_pairs(&held, "/w", &[("/w", "/t")]);
    }

    /// 2000 writers and 2000 readers of one topic are four million pairs.
    #[test]
    fn one_request_starts_a_bounded_number_of_connections() {
        let mut held = PersistentConnections::default();
        for index in 0..2000 {
            let topic = || ConnectionEnd::parse("topic://t");
            let port = |kind: &str| ConnectionEnd::parse(&format!("/{kind}/{index}"));
            held.subscribe(&account(), port("w"), topic(), "").unwrap();
            held.subscribe(&account(), topic(), port("r"), "").unwrap();
        }
        assert_eq!(
            held.pairs("/t").len(),
            registry_limits::MAX_LINKS_PER_REQUEST
        );
        let more = held
            .subscribe(
                &account(),
                ConnectionEnd::parse("/a"),
                ConnectionEnd::parse("/b"),
                "",
            )
            .is_ok();
        assert!(more);
        let full = (0..200).any(|i| {
            let end = ConnectionEnd::parse(&format!("/more/{i}"));
            held.subscribe(&account(), end, ConnectionEnd::parse("/b"), "")
                .is_err()
        });
        assert!(full);
    }
}
