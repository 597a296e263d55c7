//! What a registry remembers beyond its own life.
//!
//! Every request leaves its [`Change`]s in the [`Reply`](super::Reply), in order. A store that
//! applies them, and later gives back what is left as changes again, brings the registry back.
//! The server itself and its multicast group are never among them: they are what it is told at its
//! start.

use std::sync::Arc;
use std::time::Instant;

use yarp_wire::name_service::Registration;

use super::liveness::LivenessRecord;
use super::persistent_connections::ConnectionEnd;
use super::{Entry, FALLBACK, Registry};

/// One thing to remember, or to forget.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Change {
    /// A port is here now; its properties stay as they are.
    Port(Registration),
    /// A port and its properties are gone.
    PortGone(String),
    /// A property has these values now, sorted; none if it is gone.
    Property {
        /// The port.
        name: String,
        /// The property.
        key: String,
        /// Its values.
        values: Arc<[String]>,
    },
    /// A port said that it listens, or was found not to.
    Announced {
        /// The port.
        name: String,
        /// Whether it listens.
        announced: bool,
    },
    /// A connection outlives its ports.
    Subscription {
        /// The writing end as it was written, carrier included.
        source: String,
        /// The reading end as it was written, carrier included.
        destination: String,
        /// `from`, `to`, or empty.
        mode: String,
    },
    /// A connection does so no longer.
    SubscriptionGone {
        /// The bare name of the writing end.
        source: String,
        /// The bare name of the reading end.
        destination: String,
    },
    /// There is a topic.
    Topic {
        /// Its name.
        name: String,
        /// What it carries, empty if not said.
        structure: String,
    },
    /// A topic is gone.
    TopicGone(String),
    /// The definition of a type.
    Type {
        /// Its name.
        name: String,
        /// The definition.
        value: String,
    },
}

impl Change {
    /// The bare names of both ends of a subscription given as they were written.
    pub fn bare_ends(source: &str, destination: &str) -> (String, String) {
        (
            ConnectionEnd::parse(source).name,
            ConnectionEnd::parse(destination).name,
        )
    }

    /// The port that it is about, if it is about one.
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
    /// Takes note of a change.
    pub(super) fn record(&mut self, change: Change) {
        if !self.is_own(&change) {
            self.journal.push(change);
        }
    }

    fn is_own(&self, change: &Change) -> bool {
        let own = |name: &str| name == self.settings.name || name == FALLBACK;
        change.port().is_some_and(own)
    }

    /// Brings back what an earlier registry left: `changes` in any order that could have happened.
    ///
    /// Changes that make no sense here, such as a property of a port that is not there, are left
    /// out. Ports that had announced themselves count as announced at `now`.
    pub fn restore(&mut self, now: Instant, changes: impl IntoIterator<Item = Change>) {
        for change in changes {
            if !self.is_own(&change) {
                self.restore_one(now, change);
            }
        }
        self.numbers.settle();
    }

    /// The registry as it would be if `changes` were all that ever happened to others; what is known
    /// of the server itself, and of who lives, stays.
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
                    // It was within the bounds when it was kept.
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
                // As above.
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

    /// Everything that can be asked of a registry.
    fn told(registry: &mut Registry, names: &[&str]) -> Vec<String> {
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
    fn questions_change_nothing_and_the_server_is_not_remembered() {
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

    /// Two answers of a restored server must not give one number or name to two ports.
    #[test]
    fn what_is_in_use_is_not_handed_out_again() {
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
            prop_assert_eq!(told(&mut rebuilt, &names), told(&mut registry, &names));
        }
    }

    proptest! {
        /// Another registry that is told of items as they are written answers the same, and goes
        /// back to what it was when it adopts what a third one has.
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
                    let write = store_format::write(&item, registry.held(&item).as_ref());
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
            prop_assert_eq!(told(&mut other, &names), told(&mut registry, &names));
            later.sort();
            later.dedup();
            for item in &later {
                other.adopt(Instant::now(), item, past.held(item));
            }
            // A topic that was made again is listed last.
            let unordered = |mut told: Vec<String>| {
                told[2].clear();
                told
            };
            let [back, past] = [&mut other, &mut past].map(|one| unordered(told(one, &names)));
            prop_assert_eq!(back, past);
        }

        /// Whatever somebody else writes under our keys.
        #[test]
        fn no_value_makes_trouble(key in "(port|connection|topic|type)/[ -~]{0,9}", value in "\\PC{0,40}") {
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
