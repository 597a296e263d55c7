//! Changes of a registry, from which a store restores it.
//!
//! Every request returns its [`Change`]s in the [`Reply`](super::Reply), in order. A store that
//! applies them, and later returns its content as changes again, restores the registry. The server
//! itself and its multicast group are never among them: they come from its settings.

use std::sync::Arc;
use std::time::Instant;

use yarp_wire::name_service::Registration;

use super::liveness::LivenessRecord;
use super::persistent_connections::ConnectionEnd;
use super::{Entry, FALLBACK, Registry};

/// One change of the registry.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Change {
    /// A port has this address now; its properties are unchanged.
    Port(Registration),
    /// A port and its properties are removed.
    PortGone(String),
    /// A property has these values now, sorted; no values remove it.
    Property {
        /// Name of the port.
        name: String,
        /// Name of the property.
        key: String,
        /// Values.
        values: Arc<[String]>,
    },
    /// A port announced that it listens, or was found not to.
    Announced {
        /// Name of the port.
        name: String,
        /// True if it listens.
        announced: bool,
    },
    /// A persistent connection was added.
    Subscription {
        /// Writing end as written, carrier included.
        source: String,
        /// Reading end as written, carrier included.
        destination: String,
        /// Mode: `from`, `to`, or empty.
        mode: String,
    },
    /// A persistent connection was removed.
    SubscriptionGone {
        /// Bare name of the writing end.
        source: String,
        /// Bare name of the reading end.
        destination: String,
    },
    /// A topic was added.
    Topic {
        /// Name of the topic.
        name: String,
        /// Type of its messages; empty if unknown.
        structure: String,
    },
    /// A topic was removed.
    TopicGone(String),
    /// A type was defined.
    Type {
        /// Name of the type.
        name: String,
        /// Definition.
        value: String,
    },
}

impl Change {
    /// Returns the bare names of both ends of a subscription, given as written.
    pub fn bare_ends(source: &str, destination: &str) -> (String, String) {
        (
            ConnectionEnd::parse(source).name,
            ConnectionEnd::parse(destination).name,
        )
    }

    /// Returns the port that the change concerns, if it concerns one.
    fn port(&self) -> Option<&str> {
        match self {
            Self::Port(registration) => Some(&registration.name),
            Self::PortGone(name) | Self::Property { name, .. } | Self::Announced { name, .. } => {
                Some(name)
            }
            _ => None,
        }
    }
}

impl Registry {
    /// Records a change.
    pub(super) fn record(&mut self, change: Change) {
        if !self.is_own(&change) {
            self.journal.push(change);
        }
    }

    fn is_own(&self, change: &Change) -> bool {
        let own = |name: &str| name == self.settings.name || name == FALLBACK;
        change.port().is_some_and(own)
    }

    /// Restores what an earlier registry left: `changes` in any order in which they could have
    /// happened.
    ///
    /// Changes that do not apply, such as a property of an unknown port, are ignored. Ports that
    /// had announced themselves count as announced at `now`.
    pub fn restore(&mut self, now: Instant, changes: impl IntoIterator<Item = Change>) {
        for change in changes {
            if !self.is_own(&change) {
                self.restore_one(now, change);
            }
        }
        self.numbers.free_unused();
    }

    /// Returns a registry built from `changes`, which keeps the entry of the server itself and the
    /// liveness of ports whose address is unchanged.
    pub(crate) fn rebuilt(&self, now: Instant, changes: Vec<Change>) -> Self {
        let mut rebuilt = Self::new(self.settings.clone());
        rebuilt.restore(now, changes);
        let own = self.settings.name.as_str();
        if let (Some(entry), Some(old)) = (rebuilt.ports.get_mut(own), self.ports.get(own)) {
            entry.properties = old.properties.clone();
        }
        for (name, entry) in &mut rebuilt.ports {
            let same = |old: &&Entry| old.registration == entry.registration;
            if let Some(old) = self.ports.get(name).filter(same) {
                entry.liveness = old.liveness.clone();
            }
        }
        rebuilt
    }

    pub(super) fn restore_one(&mut self, now: Instant, change: Change) {
        match change {
            Change::Port(registration) => self.restore_port(registration),
            Change::PortGone(name) => {
                if let Some(Entry { registration, .. }) = self.ports.remove(&name) {
                    self.release(&registration);
                }
            }
            Change::Property { name, key, values } => {
                if let Some(entry) = self.ports.get_mut(&name) {
                    // It was within the limits when it was stored.
                    let _ = entry.properties.set(&mut self.pool, &key, &values);
                }
            }
            Change::Announced { name, announced } => {
                if let Some(entry) = self.ports.get_mut(&name) {
                    entry.announced = announced.then_some(now);
                }
            }
            Change::Subscription {
                source,
                destination,
                mode,
            } => {
                let ends = [&source, &destination].map(|text| ConnectionEnd::parse(text));
                let [source, destination] = ends;
                // It was within the limits, as above.
                let _ = self.persistent.restore(source, destination, &mode);
            }
            Change::SubscriptionGone {
                source,
                destination,
            } => {
                let [source, destination] =
                    [source, destination].map(|name| ConnectionEnd::parse(&name));
                self.persistent.unsubscribe(&source, &destination);
            }
            Change::Topic { name, structure } => {
                let _ = self.persistent.add_topic(&name, &structure);
            }
            Change::TopicGone(name) => drop(self.persistent.remove_topic(&name)),
            Change::Type { name, value } => drop(self.types.insert(name, value)),
        }
    }

    fn restore_port(&mut self, registration: Registration) {
        let name = registration.name.clone();
        if let Some(entry) = self.ports.get_mut(&name) {
            self.numbers.free(entry.registration.port);
            self.numbers.restore(&name, registration.port);
            entry.registration = registration;
            return;
        }
        self.numbers.restore(&name, registration.port);
        self.names.restore(&name);
        if registration.carrier == "mcast" {
            self.groups.restore(&registration.host);
        }
        self.place(registration, LivenessRecord::restored());
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use proptest::prelude::*;
    use yarp_wire::name_service::Request;

    use super::*;
    use crate::registry::Settings;

    fn settings() -> Settings {
        Settings::at("192.0.2.2", 10310)
    }

    /// Returns every answer that a registry can give.
    fn all_answers(registry: &mut Registry, names: &[&str]) -> Vec<String> {
        let ask = |registry: &mut Registry, line: &str| {
            let request = Request::parse(line).unwrap();
            let reply = registry.handle(Instant::now(), None, &request);
            reply.body.to_text()
        };
        let mut told = vec![
            ask(registry, "list"),
            ask(registry, "subscribe"),
            ask(registry, "topic"),
            ask(registry, "type yarp /n"),
        ];
        for name in names {
            for key in ["offers", "carrier", "type", "owns", "\"a b\""] {
                told.push(ask(registry, &format!("get {name} {key}")));
            }
        }
        told
    }

    fn run(registry: &mut Registry, lines: &[String]) -> Vec<Change> {
        let from = Some(Ipv4Addr::LOCALHOST.into());
        let mut changes = Vec::new();
        for line in lines {
            let request = Request::parse(line).unwrap();
            changes.extend(registry.handle(Instant::now(), from, &request).changes);
        }
        changes
    }

    #[test]
    fn queries_change_nothing() {
        let mut registry = Registry::new(settings());
        let lines = [
            "query /a",
            "list",
            "unregister /nobody",
            "set /root offers tcp",
            "set /nobody k v",
            "announce /nobody",
            "announce /root",
            "unsubscribe /a /b",
            "untopic /t",
            "register \"/a b\"",
        ];
        let changes = run(&mut registry, &lines.map(str::to_owned));
        assert_eq!(changes, []);
    }

    /// Checks that a restored server never gives one number or name to two ports.
    #[test]
    fn numbers_and_names_in_use_are_not_handed_out() {
        let mut registry = Registry::new(settings());
        let lines = ["register ...", "register ... mcast", "register /c"].map(str::to_owned);
        let mut changes = run(&mut registry, &lines);
        changes.extend(run(&mut registry, &["unregister /tmp/port/1".to_owned()]));
        let mut rebuilt = Registry::new(settings());
        rebuilt.restore(Instant::now(), changes);
        run(&mut rebuilt, &lines[..2]);
        run(&mut rebuilt, &["register /d".to_owned()]);
        let places: Vec<_> = rebuilt.registrations().map(ToString::to_string).collect();
        let expected = [
            "registration name /c ip 127.0.0.1 port 10314 type tcp",
            "registration name /d ip 127.0.0.1 port 10316 type tcp",
            "registration name /root ip 192.0.2.2 port 10310 type tcp",
            "registration name /tmp/port/1 ip 127.0.0.1 port 10312 type tcp",
            "registration name /tmp/port/2 ip 224.1.1.3 port 10313 type mcast",
            "registration name /tmp/port/3 ip 224.1.1.4 port 10315 type mcast",
            "registration name fallback ip 224.2.1.1 port 10000 type mcast",
        ];
        assert_eq!(places, expected);
    }

    proptest! {
        #[test]
        fn a_restored_registry_answers_the_same(lines in prop::collection::vec(line(), 0..60)) {
            let names = ["/a", "/b", "/tmp/port/1", "/t"];
            let mut registry = Registry::new(settings());
            let changes = run(&mut registry, &lines);
            let mut rebuilt = Registry::new(settings());
            rebuilt.restore(Instant::now(), changes);
            prop_assert_eq!(all_answers(&mut rebuilt, &names), all_answers(&mut registry, &names));
        }
    }

    proptest! {
        /// Checks that a registry which adopts items as they are written answers like their origin,
        /// and returns to its former state when it adopts the items of a third one.
        #[test]
        fn a_registry_that_adopts_all_items_answers_the_same(
            lines in prop::collection::vec(line(), 0..60),
            back in 0..60usize,
        ) {
            use crate::registry::Item;
            use crate::shared::store_format;
            let names = ["/a", "/b", "/tmp/port/1", "/t"];
            let [mut registry, mut other, mut past] = [(); 3].map(|()| Registry::new(settings()));
            let mut later = Vec::new();
            for (index, line) in lines.iter().enumerate() {
                let changes = run(&mut registry, std::slice::from_ref(line));
                let mut items: Vec<_> = changes.iter().map(Item::of).collect();
                items.sort();
                items.dedup();
                for item in items {
                    let write = store_format::write(&item, registry.item_value(&item).as_ref());
                    let read = store_format::item_of(&write.key, write.value.as_deref());
                    let (read, held) = read.expect("what is written is understood");
                    prop_assert_eq!(&read, &item);
                    other.adopt(Instant::now(), &read, held.clone());
                    match index < back {
                        true => drop(past.adopt(Instant::now(), &read, held)),
                        false => later.push(item),
                    }
                }
            }
            prop_assert_eq!(all_answers(&mut other, &names), all_answers(&mut registry, &names));
            later.sort();
            later.dedup();
            for item in &later {
                other.adopt(Instant::now(), item, past.item_value(item));
            }
            // A topic that was added again is listed last.
            let unordered = |mut told: Vec<String>| {
                told[2].clear();
                told
            };
            let [back, past] = [&mut other, &mut past].map(|one| unordered(all_answers(one, &names)));
            prop_assert_eq!(back, past);
        }

        /// Checks any key and value that another program may write.
        #[test]
        fn foreign_values_do_not_panic(key in "(port|connection|topic|type)/[ -~]{0,9}", value in "\\PC{0,40}") {
            let item = crate::shared::store_format::item_of(&key, Some(value.as_bytes()));
            prop_assert!(item.is_none_or(|(_, held)| held.is_some()));
        }
    }

    fn line() -> impl Strategy<Value = String> {
        let name = || prop::sample::select(vec!["/a", "/b", "/tmp/port/1", "...", "tcp://a"]);
        let end = || prop::sample::select(vec!["/a", "udp://b", "topic://t", "/t"]);
        let key = prop::sample::select(vec!["offers", "carrier", "type", "owns", "\"a b\""]);
        prop_oneof![
            (name(), 0..3).prop_map(|(name, kind)| match kind {
                0 => format!("register {name}"),
                1 => format!("register {name} mcast"),
                _ => format!("register {name} tcp host 10313 yarp/image"),
            }),
            name().prop_map(|name| format!("unregister {name}")),
            (name(), key, "[a-z ]{0,6}").prop_map(|(name, key, v)| format!("set {name} {key} {v}")),
            (name(), 0..2).prop_map(|(name, kind)| match kind {
                0 => format!("announce {name}"),
                _ => format!("announce {name} 0"),
            }),
            (end(), end(), 0..3usize).prop_map(|(a, b, mode)| {
                let mode = ["", "from", "to"][mode];
                format!("subscribe {a} {b} {mode}")
            }),
            (end(), end()).prop_map(|(a, b)| format!("unsubscribe {a} {b}")),
            "[a-z]{0,3}".prop_map(|structure| format!("topic /t {structure}")),
            Just("untopic /t".to_owned()),
            "[a-z]{0,3}".prop_map(|value| format!("type yarp /n {value}")),
        ]
    }
}
